//! Separable filters over pictures, one output row at a time: first down the columns, then along the row. All sums are in
//! `f64` and in a fixed order, so any thread may compute a row.

use lexisplat_render::Image;
use rayon::prelude::*;

/// Returns the sum of the results of `row` over `rows`. Rows are computed in parallel, each with the scratch memory of
/// its thread. Their results are added in the order of the rows.
pub(super) fn sum_rows<S>(
    rows: std::ops::Range<usize>,
    scratch: impl Fn() -> S + Sync + Send,
    row: impl Fn(&mut S, usize) -> f64 + Sync + Send,
) -> f64 {
    let sums: Vec<f64> = rows.into_par_iter().map_init(scratch, row).collect();
    sums.iter().sum()
}

/// Returns the three planes of the converted pixels.
pub(super) fn planes<T: Copy + Default + Send + Sync>(
    image: &Image,
    convert: impl Fn([f32; 3]) -> [T; 3] + Sync,
) -> [Vec<T>; 3] {
    let [mut first, mut second, mut third] = [(); 3].map(|()| vec![T::default(); image.pixels.len()]);
    let width = image.width.max(1) as usize;
    (
        first.par_chunks_mut(width),
        second.par_chunks_mut(width),
        third.par_chunks_mut(width),
        image.pixels.par_chunks(width),
    )
        .into_par_iter()
        .for_each(|(first, second, third, pixels)| {
            for (((a, b), c), &pixel) in first.iter_mut().zip(second).zip(third).zip(pixels) {
                [*a, *b, *c] = convert(pixel);
            }
        });
    [first, second, third]
}

/// Number of sums that are kept in registers while all weights are added to them.
const BLOCK: usize = 16;

/// Adds the rows that `row` returns to `sums`. The row of each number is multiplied by the weight of this number. Rows
/// must be at least as long as `sums`.
#[inline(always)]
pub(super) fn add_rows<'a>(sums: &mut [f64], weights: &[f64], row: impl Fn(usize) -> &'a [f64]) {
    let len = sums.len();
    let (blocks, rest) = sums.as_chunks_mut::<BLOCK>();
    for (block, start) in blocks.iter_mut().zip((0..).step_by(BLOCK)) {
        let mut sums = *block;
        for (k, &weight) in weights.iter().enumerate() {
            let Some(values) = row(k)[start..].first_chunk::<BLOCK>() else { return };
            for i in 0..BLOCK {
                sums[i] += weight * values[i];
            }
        }
        *block = sums;
    }
    let start = len - rest.len();
    for (k, &weight) in weights.iter().enumerate() {
        for (sum, value) in rest.iter_mut().zip(&row(k)[start..]) {
            *sum += weight * value;
        }
    }
}

/// Adds the correlation of `padded` with `weights` to `sums`. The length of `padded` is `sums.len() + weights.len() - 1`.
#[inline(always)]
pub(super) fn add_across(sums: &mut [f64], weights: &[f64], padded: &[f64]) {
    add_rows(sums, weights, |k| &padded[k..]);
}
