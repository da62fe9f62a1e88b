//! `.ksplat`: the format of mkkellogg's `GaussianSplats3D` (`src/loaders/SplatBuffer.js`), compression levels 0 to 2.
//!
//! A file has a header, the headers of sections, and the data of the sections one after another: the sizes of buckets
//! that are not full, the centres of buckets, and rows. At levels 1 and 2 positions have 16 bits and are relative to the
//! centre of their bucket. The axes are those of a PLY. [`layout`] checks all values that control reading.

mod layout;
mod values;

use std::ops::Range;

use half::f16;
use lexisplat::ply::ReadOptions;
use lexisplat::sh::{C0, COLOUR_OFFSET};
use lexisplat::{Result, SceneMeta, ShDegree};
use serde_json::json;

use self::layout::{Layout, Level, Section};
use self::values::{f32_at, u16_at};
use crate::opacity::{MOST, logits};
use crate::rows::{Described, Rows, RowsMut};

/// Logarithm of a scale that stands for a scale of 0, whose logarithm is not finite: the natural logarithm of 2^-25, half
/// of the smallest f16 above 0.
const LEAST_SCALE: f32 = -17.328_68;
/// Number of SH coefficients of a colour channel in each degree, from degree 1 on.
const IN_DEGREE: [usize; 3] = [3, 5, 7];

/// Returns whether `bytes` are a .ksplat. The format has no mark, so the test is whether all headers are consistent.
pub(crate) fn is_likely(bytes: &[u8]) -> bool {
    Layout::of("", bytes).is_ok()
}

/// Reads the .ksplat in `bytes`, which messages call `name`.
///
/// # Errors
/// [`lexisplat::Error::Format`] for headers that contradict each other or the length of the file.
pub(crate) fn read<'a>(name: &str, bytes: &'a [u8], options: &ReadOptions) -> Result<Described<'a>> {
    let layout = Layout::of(name, bytes)?;
    options.limits.check_gaussians(name, layout.gaussians as u64)?;
    let degree = layout.degree;
    let facts = vec![
        ("compression_level", json!(layout.level.number())),
        ("sections", json!(layout.sections.len())),
        ("version", json!(layout.version)),
    ];
    Ok(Described {
        len: layout.gaussians,
        degree,
        rows: Box::new(KsplatRows(layout)),
        meta: SceneMeta::default(),
        warnings: Vec::new(),
        facts,
    })
}

#[derive(Debug)]
struct KsplatRows<'a>(Layout<'a>);

impl Rows for KsplatRows<'_> {
    fn fill(&self, range: Range<usize>, out: RowsMut<'_>) {
        let layout = &self.0;
        let logits = logits();
        let rest = layout.degree.rest();
        let mut next = layout.sections.partition_point(|section| section.end() <= range.start);
        for (i, gaussian) in range.enumerate() {
            while layout.sections.get(next).is_some_and(|section| section.end() <= gaussian) {
                next += 1;
            }
            let Some(section) = layout.sections.get(next) else { return };
            let row = section.row(gaussian - section.first);
            let reader = RowReader { level: layout.level, row };
            out.positions[i] = position(section, gaussian - section.first, reader);
            out.scales[i] = reader.numbers::<3>(layout.level.scales()).map(log_scale);
            out.rotations[i] = reader.numbers::<4>(layout.level.rotation());
            let at = layout.level.colour();
            out.dc[i] = [0, 1, 2].map(|k| (f32::from(row[at + k]) / MOST - COLOUR_OFFSET) / C0);
            out.opacities[i] = logits[usize::from(row[at + 3])];
            sh(layout, section.degree, reader, &mut out.sh_rest[i * rest..(i + 1) * rest]);
        }
    }

    fn is_finite(&self) -> bool {
        false
    }
}

fn log_scale(scale: f32) -> f32 {
    if scale == 0.0 { LEAST_SCALE } else { libm::logf(scale) }
}

/// Reads the values of a Gaussian from the bytes of its row.
#[derive(Clone, Copy)]
struct RowReader<'r> {
    level: Level,
    row: &'r [u8],
}

impl RowReader<'_> {
    /// Returns `N` values from byte `at` on, of 32 bits each at level 0 and of 16 bits at higher levels.
    fn numbers<const N: usize>(self, at: usize) -> [f32; N] {
        match self.level {
            Level::Whole => std::array::from_fn(|k| f32_at(self.row, at + k * size_of::<f32>())),
            Level::Half | Level::Bytes => {
                std::array::from_fn(|k| f16::from_bits(u16_at(self.row, at + k * size_of::<f16>())).to_f32())
            }
        }
    }

    /// Returns SH value `k` of the row. `range` has the values of the bytes 0 and 255.
    fn sh(self, k: usize, range: [f32; 2]) -> f32 {
        let at = self.level.harmonics();
        match self.level {
            Level::Whole | Level::Half => {
                let [value] = self.numbers(at + k * self.level.harmonic_bytes());
                value
            }
            Level::Bytes => {
                let [least, most] = range;
                least + f32::from(self.row[at + k]) / MOST * (most - least)
            }
        }
    }
}

/// Returns the position of Gaussian `i` of a section.
#[expect(clippy::cast_possible_truncation, reason = "f32 is what the file promises")]
fn position(section: &Section<'_>, i: usize, reader: RowReader<'_>) -> [f32; 3] {
    if reader.level == Level::Whole {
        return reader.numbers(0);
    }
    let centre = section.centre(i);
    let step = f64::from(section.block) / 2.0 / f64::from(section.range);
    std::array::from_fn(|k| {
        let offset = f64::from(u16_at(reader.row, k * size_of::<u16>())) - f64::from(section.range);
        (offset * step + f64::from(centre[k])) as f32
    })
}

/// Writes the SH of a row of `degree` to `out`, which has the degree of the scene. In a row each degree is channel-major
/// by itself.
fn sh(layout: &Layout<'_>, degree: ShDegree, reader: RowReader<'_>, out: &mut [f32]) {
    out.fill(0.0);
    let channel = out.len() / 3;
    let (mut value, mut first) = (0, 0);
    for n in IN_DEGREE.into_iter().take(degree.get().into()) {
        for c in 0..3 {
            for k in 0..n {
                out[c * channel + first + k] = reader.sh(value, layout.sh_bounds);
                value += 1;
            }
        }
        first += n;
    }
}

#[cfg(test)]
mod tests;
