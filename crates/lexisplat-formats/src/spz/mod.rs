//! SPZ, versions 1 to 4 (nianticlabs/spz, `load-spz.cc`).
//!
//! Values are in 6 streams of bytes. Positions have 24 bits with a fixed point. Opacities, colours and logarithms of
//! scales have 8 bits. Rotations have 24 or 32 bits. SH have 8 bits, coefficient by coefficient, with the channels of a
//! coefficient side by side. In versions 1 to 3 one gzip stream holds a header and all streams; files that were inflated
//! before are read too. In version 4 each stream is a Zstandard frame. The axes are x right, y up, z back, unless an
//! extension states others.

mod extensions;
mod header;
mod inflate;
mod rotation;
mod write;

use std::ops::Range;

use half::f16;
use lexisplat::ply::ReadOptions;
use lexisplat::sh::{CHANNELS, COLOUR_OFFSET, MAX_COEFFICIENTS};
use lexisplat::{Error, FormatError, Result, SceneMeta};
use serde_json::json;

use self::extensions::Extensions;
use self::header::{BYTES, FIRST_ZSTD, Header, NAMES, OLD_BYTES, STREAMS};
use self::inflate::{Gunzip, unzstd};
use crate::axes::Flip;
use crate::numbers::u32_at;
use crate::opacity::{MOST, logits};
use crate::rows::{Described, Rows, RowsMut};

pub(crate) use self::write::write;

/// Factor of stored base colours: they are `0.5 + 0.15 * SH coefficient 0`, so that colours outside of 0 to 1 fit too
/// (`colorScale`).
const COLOUR_SCALE: f32 = 0.15;
/// Number of steps in a unit of the logarithm of a scale, and the logarithm for the byte 0.
const SCALE_STEPS: f32 = 16.0;
const SCALE_LEAST: f32 = -10.0;
/// Byte of SH that means 0; 128 more means 1 (`unquantizeSH`).
const SH_ZERO: f32 = 128.0;
/// Number of bytes of an entry of the table of streams: the lengths before and after inflating.
const ENTRY: usize = 16;
/// Offset of the version in a header.
const VERSION_AT: usize = 4;
/// First bytes of gzip.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Reads the SPZ in `bytes`, which messages call `name`.
///
/// # Errors
/// [`Error::Format`] for damage, [`Error::Limit`] for a file that asks for too much.
pub(crate) fn read(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<Described<'static>> {
    let is_old = !bytes.starts_with(&GZIP) && (1..FIRST_ZSTD).contains(&u32_at(bytes, VERSION_AT));
    let (header, streams, records) = match is_old {
        true => old(name, bytes.len(), Gunzip::plain(name, bytes), options)?,
        false if bytes.starts_with(&GZIP) => old(name, bytes.len(), Gunzip::new(name, bytes), options)?,
        false => new(name, bytes, options)?,
    };
    let mut extensions =
        if header.has_extensions { Extensions::read(name, &records)? } else { Extensions::default() };
    if is_old {
        let text =
            format!("SPZ version {} outside of gzip, where its programs do not read it", header.version);
        extensions.warnings.push(text);
    }
    Ok(Described {
        len: header.count as usize,
        degree: header.degree,
        meta: SceneMeta { antialiased: header.antialiased, ..SceneMeta::default() },
        warnings: extensions.warnings,
        facts: vec![
            ("version", json!(header.version)),
            ("fraction_bits", json!(header.fraction)),
            ("extensions", json!(extensions.count)),
        ],
        rows: Box::new(SpzRows { header, streams, flip: extensions.flip }),
    })
}

/// A header, the inflated streams, and the records of extensions.
type Parts = (Header, [Vec<u8>; STREAMS], Vec<u8>);

/// Returns zeroed streams for the Gaussians of `header`, if the limits allow them.
fn room(name: &str, file_bytes: usize, header: Header, options: &ReadOptions) -> Result<[Vec<u8>; STREAMS]> {
    options.limits.check_gaussians(name, header.count.into())?;
    let (count, widths) = (header.count as usize, header.widths());
    options.limits.check_arrays(name, file_bytes as u64, count, widths.iter().sum())?;
    Ok(widths.map(|width| vec![0; count * width]))
}

/// Reads the parts of a file of version 1 to 3.
fn old(name: &str, file_bytes: usize, mut gunzip: Gunzip<'_>, options: &ReadOptions) -> Result<Parts> {
    let mut head = [0; OLD_BYTES];
    gunzip.fill("the header", &mut head)?;
    let header = Header::parse(name, &head)?;
    let mut streams = room(name, file_bytes, header, options)?;
    for (stream, what) in streams.iter_mut().zip(NAMES) {
        gunzip.fill(what, stream)?;
    }
    // The checksum is at the end of the gzip stream, so the stream is read to its end.
    let records = gunzip.rest("extensions", options.limits.header_bytes)?;
    Ok((header, streams, records))
}

/// Reads the parts of a file of version 4.
fn new(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<Parts> {
    let header = Header::parse(name, bytes)?;
    let (count, table) = header.table.unwrap_or_default();
    let malformed = |text: String| Error::malformed(name, text);
    let records = bytes
        .get(BYTES..table)
        .ok_or_else(|| malformed(format!("the table of streams is at byte {table}, outside of the file")))?;
    options.limits.check_header(name, records.len() as u64)?;
    let mut at = table + count * ENTRY;
    let entries = bytes.get(table..at).ok_or_else(|| {
        let (expected, found) = (at as u64, bytes.len() as u64);
        Error::format(
            name,
            FormatError::Truncated { what: "the table of streams".to_owned(), expected, found },
        )
    })?;
    let mut entries = entries.as_chunks::<ENTRY>().0.iter();
    let mut streams = room(name, bytes.len(), header, options)?;
    // Streams without bytes have no entry in the table.
    for (stream, what) in streams.iter_mut().zip(NAMES).filter(|(stream, _)| !stream.is_empty()) {
        let Some(entry) = entries.next() else {
            return Err(malformed(format!("{count} streams, and none for {what}")));
        };
        let [packed, plain] =
            [0, 8].map(|k| entry[k..].first_chunk().map_or(0, |chunk| u64::from_le_bytes(*chunk)));
        if plain != stream.len() as u64 {
            return Err(malformed(format!("{what} have {plain} bytes, and {} are needed", stream.len())));
        }
        let frame = usize::try_from(packed).ok().and_then(|length| bytes.get(at..)?.get(..length));
        let frame = frame.ok_or_else(|| {
            let (expected, found) = ((at as u64).saturating_add(packed), bytes.len() as u64);
            Error::format(name, FormatError::Truncated { what: what.to_owned(), expected, found })
        })?;
        at += frame.len();
        unzstd(name, what, frame, stream)?;
    }
    if entries.len() > 0 || at != bytes.len() {
        return Err(malformed(format!("{count} streams, which end at byte {at} of {}", bytes.len())));
    }
    Ok((header, streams, records.to_vec()))
}

#[derive(Debug)]
struct SpzRows {
    header: Header,
    streams: [Vec<u8>; STREAMS],
    flip: Flip,
}

impl SpzRows {
    /// Returns the bytes of Gaussians `range` in stream number `k`.
    fn bytes(&self, k: usize, range: &Range<usize>) -> &[u8] {
        let width = self.header.widths()[k];
        &self.streams[k][range.start * width..range.end * width]
    }
}

/// Returns the values of all 8-bit codes.
fn table(value: impl Fn(f32) -> f32) -> [f32; 256] {
    std::array::from_fn(|k| value(k as f32))
}

impl Rows for SpzRows {
    fn fill(&self, range: Range<usize>, out: RowsMut<'_>) {
        let bytes = |k: usize| self.bytes(k, &range);
        let of = |table: &[f32; 256], row: &[u8; 3]| row.map(|v| table[usize::from(v)]);
        if self.header.version == 1 {
            for (position, row) in out.positions.iter_mut().zip(bytes(0).as_chunks::<6>().0) {
                let half = |k: usize| f16::from_le_bytes([row[k], row[k + 1]]).to_f32();
                *position = self.flip.position([half(0), half(2), half(4)]);
            }
        } else {
            let unit = 1.0 / (1_u32 << self.header.fraction) as f32;
            for (position, row) in out.positions.iter_mut().zip(bytes(0).as_chunks::<9>().0) {
                // The top byte has the sign.
                let fixed = |k: usize| i32::from_le_bytes([0, row[k], row[k + 1], row[k + 2]]) >> 8;
                *position = self.flip.position([0, 3, 6].map(|k| fixed(k) as f32 * unit));
            }
        }
        let opacities = logits();
        out.opacities.iter_mut().zip(bytes(1)).for_each(|(v, byte)| *v = opacities[usize::from(*byte)]);
        let colours = table(|v| (v / MOST - COLOUR_OFFSET) / COLOUR_SCALE);
        out.dc.iter_mut().zip(bytes(2).as_chunks().0).for_each(|(dc, row)| *dc = of(&colours, row));
        let scales = table(|v| v / SCALE_STEPS + SCALE_LEAST);
        out.scales.iter_mut().zip(bytes(3).as_chunks().0).for_each(|(scale, row)| *scale = of(&scales, row));
        if self.header.has_smallest_three() {
            for (turn, code) in out.rotations.iter_mut().zip(bytes(4).as_chunks().0) {
                *turn = self.flip.rotation(rotation::smallest_three(u32::from_le_bytes(*code)));
            }
        } else {
            for (turn, code) in out.rotations.iter_mut().zip(bytes(4).as_chunks().0) {
                *turn = self.flip.rotation(rotation::first_three(*code));
            }
        }
        let per = self.header.degree.rest_per_channel();
        let factors = self.flip.rest().map(|sign| sign / SH_ZERO);
        if per > 0 {
            let rows = bytes(5).chunks_exact(CHANNELS * per);
            for (rest, row) in out.sh_rest.chunks_exact_mut(CHANNELS * per).zip(rows) {
                spread(rest, row, per, &factors);
            }
        }
    }

    fn is_finite(&self) -> bool {
        self.header.version > 1
    }
}

/// Decodes the SH of one Gaussian: changes the order from coefficient by coefficient to channel by channel.
fn spread(rest: &mut [f32], row: &[u8], per: usize, factors: &[f32; MAX_COEFFICIENTS - 1]) {
    let (red, others) = rest.split_at_mut(per);
    let (green, blue) = others.split_at_mut(per);
    let colours = red.iter_mut().zip(green).zip(blue);
    for ((((r, g), b), bytes), factor) in colours.zip(row.as_chunks::<CHANNELS>().0).zip(factors) {
        *r = (f32::from(bytes[0]) - SH_ZERO) * factor;
        *g = (f32::from(bytes[1]) - SH_ZERO) * factor;
        *b = (f32::from(bytes[2]) - SH_ZERO) * factor;
    }
}

#[cfg(test)]
mod tests {
    use lexisplat::{Limits, Silent, Splats};
    use lexisplat_sample::{SampleOptions, scene};
    use lexisplat_testing::{Need, missing, real_data};

    use super::*;
    use crate::open::open;
    use crate::siblings::Siblings;
    use crate::write_options::WriteOptions;

    fn opened(bytes: &[u8]) -> Result<Splats> {
        let opened = open("a.spz", bytes, Siblings::NONE, &ReadOptions::default(), true, &Silent)?;
        Ok(opened.source().whole()?.into_owned())
    }

    fn options(version: u8) -> WriteOptions {
        WriteOptions { spz_version: version, ..WriteOptions::default() }
    }

    /// Warnings of scenes at the origin, far away, and with an offset.
    #[test]
    fn steps_that_are_coarse_far_away_are_told() {
        let near = scene(&SampleOptions::new(60, 1));
        let lost = |splats: &Splats| write(splats, &WriteOptions::default()).unwrap().1;
        assert_eq!(lost(&near).coarse, [""; 0]);
        let mut far = near.clone();
        far.geometry.positions.iter_mut().for_each(|p| p[0] += 500_000.0);
        let said = lost(&far).coarse.join("");
        assert!(said.contains("the steps of SPZ, of 0.0625, move positions by up to 0.031, and"), "{said}");
        let mut offset = near;
        offset.meta.offset = lexisplat::Offset::new([500_000.0, 0.0, 0.0]).unwrap();
        let lost = lost(&offset);
        assert_eq!((lost.offset, lost.coarse.len()), (offset.meta.offset, 0));
    }

    #[test]
    fn what_is_written_is_read_within_the_quantum_and_written_again() {
        for degree in 0..=4 {
            let mut splats = scene(&SampleOptions::new(400, 2));
            if degree < 4 {
                splats = splats.with_degree_cut(lexisplat::ShDegree::new(degree).unwrap());
            }
            splats.meta.antialiased = degree == 2;
            for version in 2..=4 {
                let (bytes, lost) = write(&splats, &options(version)).unwrap();
                let read = opened(&bytes).unwrap();
                assert_eq!((read.degree, read.meta.antialiased), (splats.degree, degree == 2));
                let most = |a: &[f32], b: &[f32]| -> f32 {
                    assert_eq!(a.len(), b.len());
                    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
                };
                let (a, b) = (&splats.geometry, &read.geometry);
                assert!(most(a.positions.as_flattened(), b.positions.as_flattened()) <= 0.5 / 4096.0 + 1e-6);
                assert!(most(a.scales.as_flattened(), b.scales.as_flattened()) <= 0.5 / 16.0 + 1e-5);
                assert!(most(a.dc.as_flattened(), b.dc.as_flattened()) <= 0.5 / 255.0 / 0.15 + 1e-5);
                // Rounded to 8 bits and then to buckets of 16.
                assert!(lost.limited > 0 || most(&splats.sh_rest, &read.sh_rest) <= 8.5 / 128.0 + 1e-5);
                let (again, _) = write(&read, &options(version)).unwrap();
                assert!(again == bytes, "degree {degree}, version {version}");
            }
        }
    }

    #[test]
    fn what_was_inflated_already_is_read() {
        let splats = scene(&SampleOptions::new(30, 2));
        for version in 2..=3 {
            let (bytes, _) = write(&splats, &options(version)).unwrap();
            let plain = Gunzip::new("a", &bytes).rest("all", 1 << 20).unwrap();
            assert_eq!(opened(&plain).unwrap(), opened(&bytes).unwrap());
            let described = read("a", &plain, &ReadOptions::default()).unwrap();
            assert_eq!(described.warnings.len(), 1, "{:?}", described.warnings);
            assert!(opened(&plain[..plain.len() - 1]).is_err() && opened(&plain[..12]).is_err());
        }
    }

    /// SH of 8 bits have a sixteenth of the error.
    #[test]
    fn more_bits_of_sh_are_closer() {
        let splats = scene(&SampleOptions::new(400, 2));
        let error = |sh_bits: [u8; 2]| {
            let (bytes, _) = write(&splats, &WriteOptions { sh_bits, ..options(3) }).unwrap();
            let read = opened(&bytes).unwrap();
            let pairs = splats.sh_rest.iter().zip(&read.sh_rest);
            pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt()
        };
        let [coarse, fine] = [error([4, 4]), error([8, 8])];
        assert!(fine < coarse / 8.0, "{fine} {coarse}");
    }

    #[test]
    fn every_truncation_and_flipped_bit_is_read_or_refused() {
        let splats = scene(&SampleOptions::new(30, 2));
        for version in 2..=4 {
            let (bytes, _) = write(&splats, &options(version)).unwrap();
            for end in 0..bytes.len() {
                assert!(opened(&bytes[..end]).is_err(), "{end}");
            }
            for bit in 0..8 * bytes.len() {
                let mut bad = bytes.clone();
                bad[bit / 8] ^= 1 << (bit % 8);
                let _ = opened(&bad);
            }
        }
    }

    #[test]
    fn counts_that_the_file_cannot_hold_are_refused() {
        let splats = scene(&SampleOptions::new(30, 2));
        let (mut bytes, _) = write(&splats, &options(4)).unwrap();
        bytes[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
        let error = opened(&bytes).unwrap_err();
        assert!(matches!(error, Error::Limit { .. }), "{error}");
        let (bytes, _) = write(&splats, &options(3)).unwrap();
        let limits = Limits::default().with_gaussians(29);
        let refused = read("a", &bytes, &ReadOptions::default().with_limits(limits)).unwrap_err();
        assert!(matches!(refused, Error::Limit { found: 30, limit: 29, .. }), "{refused}");
    }

    /// Files of other programs, written again in their version, read as the same values, and their positions, scales,
    /// opacities and colours have the same bytes.
    #[test]
    fn real_files_come_back() {
        for file in ["butterfly.spz", "fourth-st.spz", "hornedlizard.spz", "leica-scaniverse.spz"] {
            let Some(path) = real_data(file) else {
                missing(Need::Models, file);
                return;
            };
            let bytes = std::fs::read(path).unwrap();
            let described = read(file, &bytes, &ReadOptions::default()).unwrap();
            let version = described.facts[0].1.as_u64().unwrap();
            let splats = opened(&bytes).unwrap();
            assert_eq!(splats.len(), described.len);
            let version = u8::try_from(version.max(2)).unwrap();
            let (again, _) = write(&splats, &WriteOptions { sh_bits: [8, 8], ..options(version) }).unwrap();
            let read_again = opened(&again).unwrap();
            assert!(read_again.geometry.dc == splats.geometry.dc, "{file}");
            assert!(read_again.geometry.scales == splats.geometry.scales, "{file}");
            assert!(read_again.geometry.opacities == splats.geometry.opacities, "{file}");
            assert!(read_again.sh_rest == splats.sh_rest, "{file}");
        }
    }
}
