//! Separable filters over pictures, one output row at a time: first along columns, then along the row. All sums are in
//! `f64` and in a fixed order, so any thread may compute a row.

use lexisplat_render::Image;
use rayon::prelude::*;

/// Returns the sum of `row` over `rows`. Rows run in parallel, each with scratch memory of its thread, and are added
/// from the first on.
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

/// Adds `weight` times `row` to `sums`.
#[inline]
pub(super) fn add_scaled(sums: &mut [f64], weight: f64, row: &[f64]) {
    for (sum, value) in sums.iter_mut().zip(row) {
        *sum += weight * value;
    }
}

/// Adds the correlation of `padded` with `weights` to `sums`. `padded` is longer than `sums` by the number of weights
/// less one.
pub(super) fn add_across(sums: &mut [f64], weights: &[f64], padded: &[f64]) {
    for (&weight, shifted) in weights.iter().zip(padded.windows(sums.len())) {
        add_scaled(sums, weight, shifted);
    }
}
