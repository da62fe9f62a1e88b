//! Writes a compressed PLY.

use std::fmt::Write as _;

use lexisplat::{Geometry, ShDegree, Splats, ply};

use super::code::{Bounds, to_code, to_rotation, to_three};
use super::order::order;
use super::{CHUNK, CHUNK_PROPERTIES, ChunkBounds, ROW, SH_LEVELS, SH_RANGE, VERTEX_PROPERTIES, colour, dc};
use crate::lost::Lost;
use crate::opacity::{sigmoid, to_byte};

/// Largest absolute logarithm of a scale (`compressed-chunk.ts`).
const MOST_LOG_SCALE: f32 = 20.0;

/// Writes `splats` as a compressed PLY, with SH of degree 3 at most.
pub(crate) fn write(splats: &Splats) -> (Vec<u8>, Lost) {
    let degree = splats.degree.min(ShDegree::THREE);
    let mut lost = Lost::beside(splats, degree, true);
    for phrase in [
        "positions and scales to 10 or 11 bits within chunks of 256",
        "rotations to 32 bits",
        "colours and opacities to 8 bits",
    ] {
        lost.precision.push(phrase.to_owned());
    }
    if degree.rest() > 0 {
        lost.precision.push("SH to 8 bits from -4 to 4".to_owned());
    }
    let order = order(&splats.geometry.positions);
    let mut bytes = header(splats, degree, order.len()).into_bytes();
    let bounds: Vec<ChunkBounds> =
        order.chunks(CHUNK).map(|chunk| bounds_of(&splats.geometry, chunk)).collect();
    bounds.iter().flat_map(ChunkBounds::values).for_each(|v| bytes.extend(v.to_le_bytes()));
    bytes.reserve(order.len() * (ROW + degree.rest()));
    for (chunk, bounds) in order.chunks(CHUNK).zip(&bounds) {
        for &i in chunk {
            push_row(&mut bytes, &splats.geometry, i, bounds, &mut lost.limited);
        }
    }
    let (per, from) = (degree.rest_per_channel(), splats.degree.rest_per_channel());
    for &i in order.iter().filter(|_| per > 0) {
        for channel in splats.rest(i).chunks_exact(from) {
            bytes.extend(channel[..per].iter().map(|v| to_coefficient(*v, &mut lost.limited)));
        }
    }
    (bytes, lost)
}

fn header(splats: &Splats, degree: ShDegree, count: usize) -> String {
    let mut text = String::from("ply\nformat binary_little_endian 1.0\n");
    let mut line = |words: std::fmt::Arguments<'_>| {
        // Writing to a `String` cannot fail.
        let _ = text.write_fmt(words);
        text.truncate(text.trim_end().len());
        text.push('\n');
    };
    for comment in ply::comments(&splats.meta) {
        line(format_args!("comment {comment}"));
    }
    line(format_args!("element chunk {}", count.div_ceil(CHUNK)));
    CHUNK_PROPERTIES.iter().for_each(|name| line(format_args!("property float {name}")));
    line(format_args!("element vertex {count}"));
    VERTEX_PROPERTIES.iter().for_each(|name| line(format_args!("property uint {name}")));
    if degree.rest() > 0 {
        line(format_args!("element sh {count}"));
        (0..degree.rest()).for_each(|k| line(format_args!("property uchar f_rest_{k}")));
    }
    line(format_args!("end_header"));
    text
}

/// Returns the bounds of the Gaussians of a chunk.
fn bounds_of(geometry: &Geometry, chunk: &[usize]) -> ChunkBounds {
    let bounds = |value: &dyn Fn(usize) -> [f32; 3]| -> Bounds {
        chunk.iter().fold([[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]], |[low, high], &i| {
            let v = value(i);
            [[0, 1, 2].map(|k| low[k].min(v[k])), [0, 1, 2].map(|k| high[k].max(v[k]))]
        })
    };
    // A bound is replaced by the colour that follows from a reader's SH coefficient, so that the bound is the same when
    // the file is written again.
    let same = |mut bound: f32| {
        for _ in 0..4 {
            bound = colour(dc(bound));
        }
        bound
    };
    ChunkBounds {
        positions: bounds(&|i| geometry.positions[i]),
        scales: bounds(&|i| geometry.scales[i].map(|v| v.clamp(-MOST_LOG_SCALE, MOST_LOG_SCALE))),
        colours: bounds(&|i| geometry.dc[i].map(colour)).map(|bound| bound.map(same)),
    }
}

/// Appends the row of Gaussian `i`. Adds the number of values that are out of range to `limited`.
fn push_row(bytes: &mut Vec<u8>, geometry: &Geometry, i: usize, bounds: &ChunkBounds, limited: &mut u64) {
    let scales = geometry.scales[i];
    *limited += scales.iter().filter(|v| v.abs() > MOST_LOG_SCALE).count() as u64;
    bytes.extend(to_three(geometry.positions[i], &bounds.positions).to_le_bytes());
    bytes.extend(to_rotation(geometry.rotations[i]).to_le_bytes());
    bytes.extend(to_three(scales, &bounds.scales).to_le_bytes());
    let [low, high] = &bounds.colours;
    let [r, g, b] =
        [0, 1, 2].map(|k| to_code(colour(geometry.dc[i][k]), low[k], high[k], 8).to_le_bytes()[0]);
    let opacity = to_byte(sigmoid(geometry.opacities[i]));
    bytes.extend([opacity, b, g, r]);
}

/// Returns the byte of an SH coefficient.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited to 8 bits")]
fn to_coefficient(value: f32, limited: &mut u64) -> u8 {
    *limited += u64::from(value.abs() > SH_RANGE / 2.0);
    ((value / SH_RANGE + 0.5) * SH_LEVELS).clamp(0.0, SH_LEVELS - 1.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compressed_ply::coefficient;

    #[test]
    fn coefficients_come_back() {
        for byte in 0..=255 {
            assert_eq!(to_coefficient(coefficient(byte), &mut 0), byte);
        }
        let mut limited = 0;
        assert_eq!([to_coefficient(-9.0, &mut limited), to_coefficient(4.5, &mut limited)], [0, 255]);
        assert_eq!(limited, 2);
    }
}
