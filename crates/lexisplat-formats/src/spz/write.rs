//! Writes SPZ.

use lexisplat::sh::{CHANNELS, COLOUR_OFFSET};
use lexisplat::{Error, Result, Rounding, Splats};

use super::header::{FIRST_ZSTD, Header, STREAMS};
use super::inflate::{gzip, zstd};
use super::{COLOUR_SCALE, ENTRY, SCALE_LEAST, SCALE_STEPS, SH_ZERO, rotation};
use crate::axes::Flip;
use crate::lost::Lost;
use crate::opacity::{MOST, sigmoid, to_byte};
use crate::write_options::WriteOptions;

/// Number of bits of the fraction of positions, if the scene is small enough (`packGaussians`).
const FRACTION: u8 = 12;
/// Largest position in units of its last bit. A position has 24 bits in all.
const MOST_FIXED: f32 = 8_388_607.0;
/// Versions of SPZ that can be written.
const VERSIONS: std::ops::RangeInclusive<u8> = 2..=4;
/// Numbers of bits of an SH coefficient that can be chosen.
const SH_BITS: std::ops::RangeInclusive<u8> = 1..=8;
/// Number of SH coefficients of degree 1, of one channel.
const DEGREE_ONE: usize = 3;

/// Writes `splats` as an SPZ.
///
/// # Errors
/// [`Error::Parameter`] for options out of range, [`Error::Limit`] for more Gaussians than 32 bits can count.
pub(crate) fn write(splats: &Splats, options: &WriteOptions) -> Result<(Vec<u8>, Lost)> {
    if !VERSIONS.contains(&options.spz_version) {
        return Err(Error::parameter("spz_version", options.spz_version, "2, 3 or 4"));
    }
    if let Some(bits) = options.sh_bits.iter().find(|bits| !SH_BITS.contains(bits)) {
        return Err(Error::parameter("sh_bits", bits, "1 to 8 bits"));
    }
    let count = u32::try_from(splats.len()).map_err(|_| {
        let limit = u64::from(u32::MAX);
        Error::Limit { what: "Gaussians in an SPZ".to_owned(), found: splats.len() as u64, limit, name: None }
    })?;
    let mut lost = Lost::beside(splats, splats.degree, true);
    let mut header = Header {
        version: options.spz_version.into(),
        count,
        degree: splats.degree,
        fraction: fraction(splats),
        antialiased: splats.meta.antialiased,
        has_extensions: false,
        table: None,
    };
    lost.precision.push(format!("positions to 1/{}", 1_u64 << header.fraction));
    lost.coarse.extend(coarse(splats, header.fraction));
    lost.precision.push("logarithms of scales to 1/16".to_owned());
    lost.precision.push("colours and opacities to 8 bits".to_owned());
    lost.precision.push(format!("rotations to {} bits", 8 * header.widths()[4]));
    if splats.degree.rest() > 0 {
        let [first, others] = options.sh_bits;
        lost.precision.push(format!("SH to {first} bits at degree 1 and {others} above"));
    }
    let streams = streams(splats, header, options.sh_bits, &mut lost.limited);
    if header.version < FIRST_ZSTD {
        let head = header.to_bytes();
        let mut parts: Vec<&[u8]> = vec![&head];
        parts.extend(streams.iter().map(Vec::as_slice));
        return Ok((gzip(&parts)?, lost));
    }
    let mut frames = Vec::with_capacity(STREAMS);
    for stream in streams.iter().filter(|stream| !stream.is_empty()) {
        frames.push((zstd(stream)?, stream.len() as u64));
    }
    header.table = Some((frames.len(), 0));
    let mut bytes = header.to_bytes();
    for (frame, plain) in &frames {
        bytes.extend((frame.len() as u64).to_le_bytes());
        bytes.extend(plain.to_le_bytes());
    }
    debug_assert_eq!(bytes.len(), super::BYTES + frames.len() * ENTRY);
    frames.iter().for_each(|(frame, _)| bytes.extend(frame));
    Ok((bytes, lost))
}

/// Returns the number of bits of the fraction with which all positions fit into 24 bits, at most [`FRACTION`].
fn fraction(splats: &Splats) -> u8 {
    let most = splats.geometry.positions.as_flattened().iter().fold(0.0_f32, |most, v| most.max(v.abs()));
    (0..=FRACTION).rev().find(|bits| most * (1_u32 << bits) as f32 <= MOST_FIXED).unwrap_or(0)
}

/// Returns a sentence if positions are so far from the origin that their steps are coarse.
fn coarse(splats: &Splats, fraction: u8) -> Option<String> {
    if fraction == FRACTION {
        return None;
    }
    let step = 1.0 / f64::from(1_u32 << fraction);
    let rounding = Rounding { error: step / 2.0, size: splats.median_size() };
    let said = rounding
        .warning(&format!("positions are so far from the origin that the steps of SPZ, of {step},"))?;
    Some(format!("{said}; --translate brings the scene to the origin"))
}

/// Returns the bytes of all values. Adds the number of values that are out of range to `limited`.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited before")]
fn streams(splats: &Splats, header: Header, sh_bits: [u8; 2], limited: &mut u64) -> [Vec<u8>; STREAMS] {
    let geometry = &splats.geometry;
    let flip = Flip::HALF_TURN;
    let mut byte = |value: f32| {
        let rounded = value.round();
        *limited += u64::from(!(0.0..=MOST).contains(&rounded));
        rounded.clamp(0.0, MOST) as u8
    };
    let mut far = 0;
    let mut positions = Vec::with_capacity(9 * splats.len());
    let unit = (1_u32 << header.fraction) as f32;
    for position in &geometry.positions {
        for v in flip.position(*position) {
            let rounded = (v * unit).round();
            far += u64::from(rounded.abs() > MOST_FIXED);
            let fixed = rounded.clamp(-MOST_FIXED, MOST_FIXED) as i32;
            positions.extend(&fixed.to_le_bytes()[..3]);
        }
    }
    let alphas = geometry.opacities.iter().map(|v| to_byte(sigmoid(*v))).collect();
    let dc = geometry.dc.as_flattened().iter();
    let colours = dc.map(|v| byte((v * COLOUR_SCALE + COLOUR_OFFSET) * MOST)).collect();
    let scales = geometry.scales.as_flattened().iter();
    let scales = scales.map(|v| byte((v - SCALE_LEAST) * SCALE_STEPS)).collect();
    let mut rotations = Vec::with_capacity(header.widths()[4] * splats.len());
    for turn in geometry.rotations.iter().map(|q| flip.rotation(*q)) {
        if header.has_smallest_three() {
            rotations.extend(rotation::to_smallest_three(turn).to_le_bytes());
        } else {
            rotations.extend(rotation::to_first_three(turn));
        }
    }
    let per = splats.degree.rest_per_channel();
    let signs = flip.rest();
    let mut sh = Vec::with_capacity(splats.sh_rest.len());
    if per > 0 {
        for rest in splats.sh_rest.chunks_exact(CHANNELS * per) {
            for k in 0..per {
                let bits = sh_bits[usize::from(k >= DEGREE_ONE)];
                for c in 0..CHANNELS {
                    let value = rest[c * per + k] * signs[k] * SH_ZERO + SH_ZERO;
                    sh.push(to_bucket(byte(value), bits));
                }
            }
        }
    }
    *limited += far;
    [positions, alphas, colours, scales, rotations, sh]
}

/// Returns the middle of the bucket of `value`, if `bits` bits are kept. 128 is the middle of a bucket (`quantizeSH`).
fn to_bucket(value: u8, bits: u8) -> u8 {
    let size = 1_u16 << (8 - bits);
    ((u16::from(value) + size / 2) / size * size).min(255) as u8
}
