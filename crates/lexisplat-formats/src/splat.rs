//! `.splat`: rows of 32 bytes without a header, the format of antimatter15's viewer (`convert.py`, `main.js`).
//!
//! A row has the position (3 f32), the scales (3 f32, linear), the colour and opacity (4 u8), and the rotation w, x, y, z
//! (4 u8, 128 is 0). The axes are those of a PLY. There are no SH.

use std::ops::Range;

use lexisplat::ply::ReadOptions;
use lexisplat::sh::{C0, COLOUR_OFFSET};
use lexisplat::{Error, FormatError, Result, SceneMeta, ShDegree, Splats};

use crate::lost::Lost;
use crate::opacity::{MOST, logits, sigmoid, to_byte};
use crate::rows::{Described, Rows, RowsMut};

/// Number of bytes of a Gaussian.
const ROW: usize = 32;
/// Byte of a rotation that means 0; 128 more means 1 (`convert.py`: `rot * 128 + 128`).
const ROTATION_ZERO: f32 = 128.0;
/// Logarithm of a scale that stands for a scale of 0, whose logarithm is not finite. It is below the logarithm of 2^-150,
/// so its exponential rounds to 0.
const LEAST_SCALE: f32 = -104.0;
/// Number of rows that [`is_likely`] examines.
const LOOKED_AT: usize = 64;
/// Squared lengths of a rotation in bytes that [`is_likely`] accepts. The length of a unit rotation is 128.
const ROTATION_SLACK: Range<f32> = 0.8 * 128.0 * 128.0..1.2 * 128.0 * 128.0;

/// Returns whether `bytes` seem to be rows of a .splat. The format has no mark, so the first rows are examined.
pub(crate) fn is_likely(bytes: &[u8]) -> bool {
    let likely = |row: &[u8; ROW]| {
        let position = floats(row, 0);
        let scales = floats(row, 12);
        let rotation = [28, 29, 30, 31].map(|k| f32::from(row[k]) - ROTATION_ZERO);
        position.iter().all(|v| v.is_finite())
            && scales.iter().all(|v| v.is_finite() && *v >= 0.0)
            && ROTATION_SLACK.contains(&rotation.iter().map(|v| v * v).sum())
    };
    let (rows, rest) = bytes.as_chunks();
    !rows.is_empty() && rest.is_empty() && rows.iter().take(LOOKED_AT).all(likely)
}

fn floats(row: &[u8; ROW], from: usize) -> [f32; 3] {
    [0, 4, 8].map(|k| {
        let at = from + k;
        f32::from_le_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]])
    })
}

/// Reads the .splat in `bytes`, which messages call `name`.
///
/// # Errors
/// [`Error::Format`] if the last row is not whole.
pub(crate) fn read<'a>(name: &str, bytes: &'a [u8], _options: &ReadOptions) -> Result<Described<'a>> {
    let (rows, rest) = bytes.as_chunks();
    if !rest.is_empty() {
        let expected = bytes.len().next_multiple_of(ROW) as u64;
        let what = format!("the row of Gaussian {}", rows.len());
        return Err(Error::format(
            name,
            FormatError::Truncated { what, expected, found: bytes.len() as u64 },
        ));
    }
    Ok(Described {
        rows: Box::new(SplatRows(rows)),
        len: rows.len(),
        degree: ShDegree::ZERO,
        meta: SceneMeta::default(),
        warnings: Vec::new(),
        facts: Vec::new(),
    })
}

#[derive(Debug)]
struct SplatRows<'a>(&'a [[u8; ROW]]);

impl Rows for SplatRows<'_> {
    fn fill(&self, range: Range<usize>, out: RowsMut<'_>) {
        let logits = logits();
        for (i, row) in self.0[range].iter().enumerate() {
            out.positions[i] = floats(row, 0);
            out.scales[i] = floats(row, 12).map(|v| if v == 0.0 { LEAST_SCALE } else { libm::logf(v) });
            out.dc[i] = [24, 25, 26].map(|k| (f32::from(row[k]) / MOST - COLOUR_OFFSET) / C0);
            out.opacities[i] = logits[usize::from(row[27])];
            out.rotations[i] = [28, 29, 30, 31].map(|k| (f32::from(row[k]) - ROTATION_ZERO) / ROTATION_ZERO);
        }
    }

    fn is_finite(&self) -> bool {
        false
    }
}

/// Writes `splats` as a .splat.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited to 8 bits")]
pub(crate) fn write(splats: &Splats) -> (Vec<u8>, Lost) {
    let geometry = &splats.geometry;
    let mut lost = Lost::beside(splats, ShDegree::ZERO, false);
    lost.precision.push("colours, opacities and rotations to 8 bits".to_owned());
    let mut bytes = Vec::with_capacity(ROW * splats.len());
    for i in 0..splats.len() {
        geometry.positions[i].iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        for scale in geometry.scales[i].map(libm::expf) {
            lost.limited += u64::from(scale.is_infinite());
            bytes.extend(scale.min(f32::MAX).to_le_bytes());
        }
        for dc in geometry.dc[i] {
            let share = COLOUR_OFFSET + C0 * dc;
            lost.limited += u64::from(!(0.0..=1.0).contains(&share));
            bytes.push(to_byte(share));
        }
        bytes.push(to_byte(sigmoid(geometry.opacities[i])));
        let q = geometry.rotations[i];
        let length = q.iter().map(|v| v * v).sum::<f32>().sqrt();
        let unit = if length > 0.0 { q.map(|v| v / length) } else { [1.0, 0.0, 0.0, 0.0] };
        bytes.extend(unit.map(|v| (v * ROTATION_ZERO + ROTATION_ZERO).round().clamp(0.0, MOST) as u8));
    }
    (bytes, lost)
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;
    use crate::kind::Kind;
    use crate::open::open;
    use crate::siblings::Siblings;

    #[test]
    fn rows_that_begin_like_other_files_are_rows() {
        let mut splats = scene(&SampleOptions::new(3, 1));
        let begins: [&[u8]; 3] = [
            // The mark of UTF-8.
            b"\xef\xbb\xbf\x3f",
            // Another file has a length here, and JSON after it.
            b"\x01\x02\x03\x3f\x01\x02\x03\x3f{\"\x03\x3f",
            // White space and JSON.
            b"  {\x3f",
        ];
        for begin in begins {
            let mut row = [0; ROW];
            row[..begin.len()].copy_from_slice(begin);
            splats.geometry.positions[0] = floats(&row, 0);
            let (bytes, _) = write(&splats);
            let opened = open("a", &bytes, Siblings::NONE, &ReadOptions::default(), true, &Silent).unwrap();
            assert_eq!((opened.kind(), opened.source().len()), (Kind::Splat, 3), "{begin:?}");
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let splats = scene(&SampleOptions::new(300, 1));
        let (bytes, lost) = write(&splats);
        assert!(is_likely(&bytes));
        assert_eq!(lost.sh_degree, Some([3, 0]));
        let opened = open("a", &bytes, Siblings::NONE, &ReadOptions::default(), true, &Silent).unwrap();
        assert_eq!(opened.kind(), Kind::Splat);
        let read = opened.source().whole().unwrap().into_owned();
        assert_eq!(read.geometry.positions, splats.geometry.positions);
        for i in 0..splats.len() {
            for k in 0..3 {
                assert!((read.geometry.scales[i][k] - splats.geometry.scales[i][k]).abs() < 1e-5);
            }
        }
        let (again, _) = write(&read);
        for (a, b) in again.as_chunks::<ROW>().0.iter().zip(bytes.as_chunks::<ROW>().0) {
            assert_eq!((&a[..12], &a[24..28]), (&b[..12], &b[24..28]));
            assert!((28..ROW).all(|k| a[k].abs_diff(b[k]) <= 1));
        }
        assert_eq!(opened.source().len(), 300);
    }

    /// Scales of 0 come back; those that are larger than numbers go to the largest.
    #[test]
    fn scales_at_the_ends_are_numbers() {
        let mut splats = scene(&SampleOptions::new(1, 1));
        splats.geometry.scales[0] = [LEAST_SCALE, 89.0, -1.0];
        let (bytes, lost) = write(&splats);
        assert_eq!(floats(bytes.first_chunk().unwrap(), 12)[..2], [0.0, f32::MAX]);
        assert_eq!(lost.limited, 1);
        let opened = open("a", &bytes, Siblings::NONE, &ReadOptions::default(), true, &Silent).unwrap();
        let read = opened.source().whole().unwrap().into_owned();
        assert_eq!(read.geometry.scales[0][0], LEAST_SCALE);
        let (again, lost) = write(&read);
        assert!(again == bytes && lost.limited == 1);
    }

    /// A row whose first byte that is not white space is the brace that JSON begins with.
    #[test]
    fn a_row_that_begins_as_json_is_a_row() {
        let mut splats = scene(&SampleOptions::new(1, 1));
        splats.geometry.positions[0] = [f32::from_le_bytes(*b"\n\n{\n"); 3];
        let (bytes, _) = write(&splats);
        assert!(bytes.starts_with(b"\n\n{\n"));
        let opened = open("a", &bytes, Siblings::NONE, &ReadOptions::default(), true, &Silent).unwrap();
        assert_eq!(opened.kind(), Kind::Splat);
    }

    #[test]
    fn rows_that_are_not_whole_are_refused() {
        let (bytes, _) = write(&scene(&SampleOptions::new(3, 1)));
        let error = read("a.splat", &bytes[..95], &ReadOptions::default()).unwrap_err();
        assert!(error.to_string().contains("the row of Gaussian 2 needs 96 bytes"), "{error}");
    }
}
