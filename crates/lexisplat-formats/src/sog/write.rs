//! Writes SOG, version 2.

use lexisplat::sh::CHANNELS;
use lexisplat::{Error, Progress, Result, ShDegree, Splats};
use serde_json::{Value, json};

use super::code::{LEVELS, to_log, to_position, to_rotation};
use super::codebook::{codebook, nearest};
use super::palette::palette;
use super::picture::{self, MOST_SIDE};
use super::vectors::{LANES, Rows};
use super::{ENTRIES_PER_ROW, META, MOST_ENTRIES, archive, meta::VERSION};
use crate::lost::Lost;
use crate::opacity::{sigmoid, to_byte};
use crate::write_options::WriteOptions;

/// Factor of the sides of pictures (`write-sog.ts`).
const SIDE_STEP: usize = 4;
/// Number of bits of a Gaussian's position along each axis.
const POSITION_BITS: u32 = 16;
/// Largest byte.
const OPAQUE: u8 = u8::MAX;

/// Writes `splats` as a SOG archive, with SH of degree 3 at most.
///
/// # Errors
/// [`Error::Parameter`] for options out of range, [`Error::Limit`] for more Gaussians than a WebP has pixels,
/// [`Error::Cancelled`] if `progress` cancels.
pub(crate) fn write(
    splats: &Splats,
    options: &WriteOptions,
    progress: &dyn Progress,
) -> Result<(Vec<u8>, Lost)> {
    let most = usize::try_from(options.sog_palette).unwrap_or(usize::MAX);
    if most > MOST_ENTRIES {
        let expected = format!("at most {MOST_ENTRIES} entries, or 0 for no SH");
        return Err(Error::parameter("sog_palette", most, expected));
    }
    let degree = if most == 0 { ShDegree::ZERO } else { splats.degree.min(ShDegree::THREE) };
    let mut lost = Lost::beside(splats, degree, true);
    for phrase in [
        "logarithms of positions to 16 bits",
        "scales and colours to 256 values",
        "opacities to 8 bits",
        "rotations to 3 x 8 bits",
    ] {
        lost.precision.push(phrase.to_owned());
    }
    let (n, geometry) = (splats.len(), &splats.geometry);
    let (width, height) = sides(n);
    if width > MOST_SIDE || height > MOST_SIDE {
        let (what, limit) = ("Gaussians in a SOG".to_owned(), (MOST_SIDE * MOST_SIDE) as u64);
        return Err(Error::Limit { what, found: n as u64, limit, name: None });
    }
    let ends = [0, 1, 2].map(|k| ends(geometry.positions.iter().map(|position| position[k])));
    let codes: Vec<[u16; 3]> =
        geometry.positions.iter().map(|p| [0, 1, 2].map(|k| to_position(p[k], ends[k]))).collect();
    let order = order(&codes);
    let mut members: Vec<(&str, Vec<u8>)> = Vec::new();
    let mut add = |name: &'static str, pixel: &dyn Fn(usize) -> [u8; 4]| -> Result<()> {
        progress.check()?;
        let mut pixels: Vec<[u8; 4]> = order.iter().map(|&i| pixel(i)).collect();
        let last = pixels.last().copied().unwrap_or([0, 0, 0, OPAQUE]);
        pixels.resize(width * height, last);
        members.push((name, picture::write(&pixels, width, height)?));
        Ok(())
    };
    for (name, byte) in [("means_l.webp", 0), ("means_u.webp", 1)] {
        add(name, &|i| {
            let [x, y, z] = codes[i].map(|code| code.to_le_bytes()[byte]);
            [x, y, z, OPAQUE]
        })?;
    }
    add("quats.webp", &|i| to_rotation(geometry.rotations[i]))?;
    let scales = codebook(geometry.scales.as_flattened());
    add("scales.webp", &|i| {
        let [x, y, z] = geometry.scales[i].map(|v| nearest(&scales, v));
        [x, y, z, OPAQUE]
    })?;
    let colours = codebook(geometry.dc.as_flattened());
    add("sh0.webp", &|i| {
        let [r, g, b] = geometry.dc[i].map(|v| nearest(&colours, v));
        [r, g, b, to_byte(sigmoid(geometry.opacities[i]))]
    })?;
    let mut meta = json!({
        "version": VERSION,
        "asset": { "generator": concat!("lexisplat ", env!("CARGO_PKG_VERSION")) },
        "count": n,
        "antialias": splats.meta.antialiased,
        "means": {
            "mins": ends.map(|[low, _]| low),
            "maxs": ends.map(|[_, high]| high),
            "files": ["means_l.webp", "means_u.webp"],
        },
        "scales": { "codebook": list(&scales), "files": ["scales.webp"] },
        "quats": { "files": ["quats.webp"] },
        "sh0": { "codebook": list(&colours), "files": ["sh0.webp"] },
    });
    if degree > ShDegree::ZERO && n > 0 {
        let sh = Sh::new(splats, degree, &order, most, progress)?;
        lost.precision.push(format!("SH to {} entries of a palette of 256 values", sh.entries));
        let mut labels: Vec<[u8; 4]> = sh
            .labels
            .iter()
            .map(|label| {
                let [low, high, ..] = label.to_le_bytes();
                [low, high, 0, OPAQUE]
            })
            .collect();
        labels.resize(width * height, labels.last().copied().unwrap_or_default());
        let rows = sh.entries.div_ceil(ENTRIES_PER_ROW);
        let per_row = ENTRIES_PER_ROW * degree.rest_per_channel();
        members.push(("shN_centroids.webp", picture::write(&sh.pixels, per_row, rows)?));
        members.push(("shN_labels.webp", picture::write(&labels, width, height)?));
        meta["shN"] = json!({
            "count": sh.entries,
            "bands": degree.get(),
            "codebook": list(&sh.values),
            "files": ["shN_centroids.webp", "shN_labels.webp"],
        });
    }
    let meta = serde_json::to_vec(&meta).map_err(|error| Error::Writer { source: error.into() })?;
    members.push((META, meta));
    Ok((archive::write(&members)?, lost))
}

/// Returns the width and height of pictures with a pixel for each of `n` Gaussians.
fn sides(n: usize) -> (usize, usize) {
    let root = n.isqrt() + usize::from(n.isqrt().pow(2) < n);
    let width = root.next_multiple_of(SIDE_STEP).max(SIDE_STEP);
    (width, n.div_ceil(width).next_multiple_of(SIDE_STEP).max(SIDE_STEP))
}

/// Returns the smallest and the largest of `values`, as logarithms.
fn ends(values: impl Iterator<Item = f32>) -> [f64; 2] {
    let ends = values.fold([f32::INFINITY, f32::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
    if ends[0] <= ends[1] { ends.map(|v| to_log(v.into())) } else { [0.0; 2] }
}

/// Returns values of single precision as JSON. Each is written with the fewest digits that give the same value when it is
/// read.
fn list(values: &[f32; LEVELS]) -> Value {
    values.iter().map(|v| json!(v)).collect()
}

/// Returns Gaussians in the order of the Morton codes of all bits of their positions. Gaussians of equal codes keep their
/// order.
fn order(codes: &[[u16; 3]]) -> Vec<usize> {
    let spread = |[x, y, z]: [u16; 3]| -> u64 {
        (0..POSITION_BITS).fold(0, |code, bit| {
            let bits = [x, y, z].map(|v| u64::from(v >> bit & 1));
            code | (bits[0] | bits[1] << 1 | bits[2] << 2) << (3 * bit)
        })
    };
    let keys: Vec<u64> = codes.iter().map(|code| spread(*code)).collect();
    let mut order: Vec<usize> = (0..codes.len()).collect();
    order.sort_by_key(|&i| keys[i]);
    order
}

/// SH as a palette.
struct Sh {
    entries: usize,
    /// Index of the entry of each Gaussian, in the order of the file.
    labels: Vec<u32>,
    /// Picture of the palette. Its last row is padded.
    pixels: Vec<[u8; 4]>,
    /// Values of its bytes.
    values: [f32; LEVELS],
}

impl Sh {
    /// Returns the SH of `splats` up to `degree`, in this order, as at most `most` entries.
    fn new(
        splats: &Splats,
        degree: ShDegree,
        order: &[usize],
        most: usize,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let (per, from) = (degree.rest_per_channel(), splats.degree.rest_per_channel());
        let used = CHANNELS * per;
        let width = used.next_multiple_of(LANES);
        let mut rows = Vec::with_capacity(width * order.len());
        for &i in order {
            for channel in splats.rest(i).chunks_exact(from) {
                rows.extend_from_slice(&channel[..per]);
            }
            rows.resize(rows.len().next_multiple_of(width), 0.0);
        }
        // The largest power of two that does not exceed the number of Gaussians (`write-sog.ts`).
        let most = most.min(1 << order.len().max(1).ilog2());
        let found = palette(Rows { values: &rows, width }, most, progress)?;
        let entries = found.entries.len() / width;
        let used_values: Vec<f32> =
            found.entries.chunks_exact(width).flat_map(|entry| &entry[..used]).copied().collect();
        let values = codebook(&used_values);
        let mut pixels = Vec::with_capacity(per * entries.next_multiple_of(ENTRIES_PER_ROW));
        for entry in used_values.chunks_exact(used) {
            pixels.extend((0..per).map(|k| {
                let [r, g, b] = [0, 1, 2].map(|c| nearest(&values, entry[c * per + k]));
                [r, g, b, OPAQUE]
            }));
        }
        pixels.resize(per * entries.next_multiple_of(ENTRIES_PER_ROW), [0, 0, 0, OPAQUE]);
        Ok(Self { entries, labels: found.labels, pixels, values })
    }
}
