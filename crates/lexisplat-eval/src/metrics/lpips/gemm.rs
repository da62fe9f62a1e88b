//! Matrix products in `f32`. Only this file passes pointers to `matrixmultiply`.
#![expect(unsafe_code, reason = "matrixmultiply::sgemm takes pointers; bounds are asserted before the call")]

/// Sizes of a product: a `rows` x `depth` matrix times a `depth` x `columns` matrix.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sizes {
    pub(super) rows: usize,
    pub(super) depth: usize,
    pub(super) columns: usize,
}

/// Whether a product replaces the output or is added to the output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Store {
    Replace,
    Add,
}

/// Writes the product of `a` and `b` to `out`, or adds it. Rows of `a` begin `step` entries apart and may overlap. `b`
/// and `out` are dense, row by row. The order of each sum depends only on `sizes`.
///
/// # Panics
/// If a slice is too short for `sizes`.
pub(super) fn multiply(sizes: Sizes, a: &[f32], step: usize, b: &[f32], out: &mut [f32], store: Store) {
    let Sizes { rows, depth, columns } = sizes;
    if rows == 0 || columns == 0 {
        return;
    }
    let last = step.checked_mul(rows - 1).and_then(|start| start.checked_add(depth));
    assert!(last.is_some_and(|end| end <= a.len()), "the left matrix ends at {last:?} of {}", a.len());
    let entries = |rows: usize| rows.checked_mul(columns);
    assert!(entries(depth).is_some_and(|end| end <= b.len()), "the right matrix holds {} entries", b.len());
    assert!(entries(rows).is_some_and(|end| end <= out.len()), "the result holds {} entries", out.len());
    let beta = if store == Store::Add { 1.0 } else { 0.0 };
    // With a single row `step` is not used, and need not fit in an `isize`.
    let step = if rows == 1 { depth } else { step };
    let (step, across) = (step.cast_signed(), columns.cast_signed());
    // SAFETY: `a` is read at `i * step + p`, `b` at `p * columns + j` and `out` read and written at
    // `i * columns + j`, for i < rows, p < depth, j < columns. The three assertions say that the largest such
    // index lies within its slice, so all do, and strides are at most a slice's length, which fits an isize.
    // `out` is borrowed mutably, so it overlaps neither input; entries of `out` are distinct, as
    // `columns` is its row stride.
    unsafe {
        matrixmultiply::sgemm(
            rows,
            depth,
            columns,
            1.0,
            a.as_ptr(),
            step,
            1,
            b.as_ptr(),
            across,
            1,
            beta,
            out.as_mut_ptr(),
            across,
            1,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(count: usize, factor: usize) -> Vec<f32> {
        (0..count).map(|i| f32::from(u8::try_from(i * factor % 31).unwrap()) / 8.0 - 1.5).collect()
    }

    fn naive(sizes: Sizes, a: &[f32], step: usize, b: &[f32], out: &mut [f32], store: Store) {
        for i in 0..sizes.rows {
            for j in 0..sizes.columns {
                let products = (0..sizes.depth).map(|p| a[i * step + p] * b[p * sizes.columns + j]);
                let before = if store == Store::Add { out[i * sizes.columns + j] } else { 0.0 };
                out[i * sizes.columns + j] = before + products.sum::<f32>();
            }
        }
    }

    /// Most rows of a product under Miri.
    const MIRI_ROWS: usize = 8;

    #[test]
    fn agrees_with_the_definition_also_where_rows_overlap() {
        for (rows, depth, columns, step) in [
            (1, 1, 1, 1),
            (1, 3, 2, usize::MAX),
            (7, 9, 5, 3),
            (40, 27, 64, 3),
            (33, 70, 17, 70),
            (5, 0, 3, 2),
        ] {
            // Under Miri the larger products take minutes each.
            if cfg!(miri) && rows > MIRI_ROWS {
                continue;
            }
            let sizes = Sizes { rows, depth, columns };
            let a = numbers(step.checked_mul(rows - 1).unwrap_or(0) + depth, 7);
            let b = numbers(depth * columns, 11);
            for store in [Store::Replace, Store::Add] {
                let (mut fast, mut slow) = (numbers(rows * columns, 5), numbers(rows * columns, 5));
                multiply(sizes, &a, step, &b, &mut fast, store);
                naive(sizes, &a, step, &b, &mut slow, store);
                for (fast, slow) in fast.iter().zip(&slow) {
                    assert!((fast - slow).abs() < 1e-3, "{sizes:?} {store:?}: {fast} {slow}");
                }
            }
        }
    }

    #[test]
    fn nothing_is_touched_past_the_end() {
        let sizes = Sizes { rows: 4, depth: 6, columns: 3 };
        let (a, b, mut out) = (numbers(3 * 2 + 6, 7), numbers(18, 11), vec![7.0; 20]);
        multiply(sizes, &a, 2, &b, &mut out, Store::Replace);
        assert!(out[..12].iter().all(|&v| v.to_bits() != 7.0_f32.to_bits()));
        assert!(out[12..].iter().all(|&v| v.to_bits() == 7.0_f32.to_bits()));
        multiply(Sizes { rows: 0, ..sizes }, &[], 2, &b, &mut [], Store::Replace);
    }

    #[test]
    #[should_panic(expected = "the left matrix")]
    fn a_short_left_matrix_is_refused() {
        let sizes = Sizes { rows: 4, depth: 6, columns: 3 };
        multiply(sizes, &[0.0; 11], 2, &[0.0; 18], &mut [0.0; 12], Store::Replace);
    }

    #[test]
    #[should_panic(expected = "the right matrix")]
    fn a_short_right_matrix_is_refused() {
        let sizes = Sizes { rows: 4, depth: 6, columns: 3 };
        multiply(sizes, &[0.0; 12], 2, &[0.0; 17], &mut [0.0; 12], Store::Replace);
    }

    #[test]
    #[should_panic(expected = "the result")]
    fn a_short_result_is_refused() {
        let sizes = Sizes { rows: 4, depth: 6, columns: 3 };
        multiply(sizes, &[0.0; 12], 2, &[0.0; 18], &mut [0.0; 11], Store::Replace);
    }
}
