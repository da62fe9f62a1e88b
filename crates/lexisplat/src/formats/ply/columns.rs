//! Copies columns out of packed rows. Type and byte order are looked up before the loop over rows.

use super::scalar::Scalar;
use crate::scene::extra::{ScalarType, with_scalar};

/// Number of rows that one task copies, one run of columns after another. At 248 bytes a row they fit in the second-level
/// cache of a core.
pub(super) const ROWS_PER_TASK: usize = 1024;

/// Packed rows of one size and byte order.
#[derive(Debug, Clone, Copy)]
pub(super) struct Packed<'a> {
    /// Whole rows, one after another.
    pub(super) bytes: &'a [u8],
    /// Bytes of one row, not 0.
    pub(super) row_bytes: usize,
    /// Whether the most significant byte comes first.
    pub(super) big: bool,
}

/// The bytes of a property in a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Field {
    /// Its first byte.
    pub(super) offset: usize,
    /// Its type in the file.
    pub(super) ty: ScalarType,
}

/// Properties that become one array of f32 with `width` values for each Gaussian.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Group {
    /// Number of values of a Gaussian.
    pub(super) width: usize,
    runs: Vec<Run>,
}

/// Fields of one type that are consecutive in the row of the file and in the row of the array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Run {
    first: Field,
    /// Index of the first field in the array's row.
    slot: usize,
    len: usize,
}

impl Group {
    /// Creates the group whose column `i` is `fields[i]`.
    pub(super) fn new(fields: &[Field]) -> Self {
        let mut runs: Vec<Run> = Vec::new();
        for (slot, &field) in fields.iter().enumerate() {
            match runs.last_mut() {
                Some(run)
                    if run.first.ty == field.ty
                        && run.first.offset + run.len * field.ty.bytes() == field.offset =>
                {
                    run.len += 1;
                }
                _ => runs.push(Run { first: field, slot, len: 1 }),
            }
        }
        Self { width: fields.len(), runs }
    }

    /// Returns whether any property has a type whose values f32 may not hold.
    pub(super) fn is_finer_than_f32(&self) -> bool {
        self.runs
            .iter()
            .any(|run| matches!(run.first.ty, ScalarType::F64 | ScalarType::I32 | ScalarType::U32))
    }

    /// Fills `out` with `width` values for each row of `rows`, without rounding.
    pub(super) fn read_exact(&self, rows: Packed<'_>, out: &mut [f64]) {
        for run in &self.runs {
            for k in 0..run.len {
                let (offset, slot) = (run.first.offset + k * run.first.ty.bytes(), run.slot + k);
                with_scalar!(run.first.ty, T => {
                    let load = if rows.big { T::load::<true> } else { T::load::<false> };
                    let values = rows.bytes.chunks_exact(rows.row_bytes).map(|row| &row[offset..offset + T::BYTES]);
                    for (row, value) in out.chunks_exact_mut(self.width).zip(values) {
                        row[slot] = load(value).to_f64();
                    }
                });
            }
        }
    }

    /// Fills `out` with `width` values for each row of `rows`.
    pub(super) fn read(&self, rows: Packed<'_>, out: &mut [f32]) {
        for &run in &self.runs {
            let read = with_scalar!(run.first.ty, T => if rows.big { read_run::<T, true> } else { read_run::<T, false> });
            read(rows, run, out, self.width);
        }
    }
}

fn read_run<T: Scalar, const BIG: bool>(rows: Packed<'_>, run: Run, out: &mut [f32], width: usize) {
    // The usual lengths are constants here, so that the compiler unrolls their loops.
    match run.len {
        1 => copy_run::<T, BIG>(rows, Run { len: 1, ..run }, out, width),
        3 => copy_run::<T, BIG>(rows, Run { len: 3, ..run }, out, width),
        4 => copy_run::<T, BIG>(rows, Run { len: 4, ..run }, out, width),
        45 => copy_run::<T, BIG>(rows, Run { len: 45, ..run }, out, width),
        _ => copy_run::<T, BIG>(rows, run, out, width),
    }
}

#[inline(always)]
fn copy_run<T: Scalar, const BIG: bool>(rows: Packed<'_>, run: Run, out: &mut [f32], width: usize) {
    let source = run.first.offset..run.first.offset + run.len * T::BYTES;
    let target = run.slot..run.slot + run.len;
    for (row, out) in rows.bytes.chunks_exact(rows.row_bytes).zip(out.chunks_exact_mut(width)) {
        let values = row[source.clone()].chunks_exact(T::BYTES).map(T::load::<BIG>);
        for (out, value) in out[target.clone()].iter_mut().zip(values) {
            *out = value.to_f32();
        }
    }
}

/// Fills `out` with the values at `offset` of each row, in their own type.
pub(super) fn read_column<T: Scalar>(rows: Packed<'_>, offset: usize, out: &mut [T]) {
    let span = offset..offset + T::BYTES;
    let values = rows.bytes.chunks_exact(rows.row_bytes).map(|row| &row[span.clone()]);
    if rows.big {
        out.iter_mut().zip(values).for_each(|(out, bytes)| *out = T::load::<true>(bytes));
    } else {
        out.iter_mut().zip(values).for_each(|(out, bytes)| *out = T::load::<false>(bytes));
    }
}

/// Returns whether any value is NaN or infinite.
pub(super) fn any_not_finite(values: &[f32]) -> bool {
    // An early exit would prevent vector code, and nearly all files have no such value.
    values.iter().fold(false, |any, v| any | !v.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_of_one_type_become_one_run() {
        let field = |offset, ty| Field { offset, ty };
        let f32s = ScalarType::F32;
        let group = Group::new(&[field(8, f32s), field(12, f32s), field(0, f32s), field(4, ScalarType::I32)]);
        let runs: Vec<_> = group.runs.iter().map(|r| (r.first.offset, r.slot, r.len)).collect();
        assert_eq!(runs, [(8, 0, 2), (0, 2, 1), (4, 3, 1)]);
    }

    #[test]
    fn values_land_in_their_slots() {
        let rows: Vec<u8> = (0..2_u8)
            .flat_map(|r| [f32::from(r) + 0.25, 7.0, -1.5].into_iter().flat_map(f32::to_be_bytes).chain([r]))
            .collect();
        let field = |offset, ty| Field { offset, ty };
        let group =
            Group::new(&[field(8, ScalarType::F32), field(0, ScalarType::F32), field(12, ScalarType::U8)]);
        let mut out = [0.0; 6];
        let rows = Packed { bytes: &rows, row_bytes: 13, big: true };
        group.read(rows, &mut out);
        assert_eq!(out, [-1.5, 0.25, 0.0, -1.5, 1.25, 1.0]);
        let mut bytes = [9_u8; 2];
        read_column(rows, 12, &mut bytes);
        assert_eq!(bytes, [0, 1]);
    }

    #[test]
    fn not_finite_is_found_anywhere() {
        let mut values = [1.0_f32; 37];
        assert!(!any_not_finite(&values));
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for i in 0..values.len() {
                values[i] = bad;
                assert!(any_not_finite(&values));
                values[i] = f32::MAX;
            }
        }
    }
}
