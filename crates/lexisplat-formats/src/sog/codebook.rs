//! Codebooks: lists of 256 values that represent many values.

use std::ops::Range;

use super::code::LEVELS;

/// Number of groups of values that the search works on.
const BINS: usize = 4096;
/// Weight of a value, relative to its rank, in the choice of its group. With a mixture of both, dense values get many
/// groups, and values far out get groups of their own (splat-transform mixes both too, `quantize-1d-core.ts`).
const BY_VALUE: f64 = 0.5;

/// Returns 256 values in ascending order that are near to `values` on the whole. If there are no more than 256 different
/// values, the result has them all. All values must be finite.
///
/// The result has the least weighted sum of squared differences. Values are grouped with their neighbours, and the weight
/// of a group is the square root of its size. Values far out, which are seen best, therefore count for more than their
/// number.
#[expect(clippy::cast_possible_truncation, reason = "values are in single precision")]
pub(super) fn codebook(values: &[f32]) -> [f32; LEVELS] {
    let mut sorted: Vec<f32> = values.to_vec();
    sorted.sort_unstable_by(f32::total_cmp);
    let mut distinct = sorted.clone();
    distinct.dedup();
    if distinct.len() <= LEVELS {
        let last = distinct.last().copied().unwrap_or_default();
        return std::array::from_fn(|k| distinct.get(k).copied().unwrap_or(last));
    }
    let mut book = runs(&bins(&sorted)).map(|v| v as f32);
    book.sort_unstable_by(f32::total_cmp);
    book
}

/// Returns the means of at most [`LEVELS`] runs of `bins`, chosen so that the sum of squares around the means is least.
/// The last mean is repeated to fill the array.
fn runs(bins: &[[f64; 2]]) -> [f64; LEVELS] {
    let sums = Sums::new(bins);
    let count = LEVELS.min(bins.len());
    // Least sums of squares of the first groups, for each number of groups: in one run, then in two runs, and so on.
    let mut least: Vec<f64> = (0..=bins.len()).map(|end| sums.squares(0, end)).collect();
    let mut starts = vec![vec![0; bins.len() + 1]];
    for _ in 1..count {
        let mut next = vec![0.0; bins.len() + 1];
        let mut start = vec![0; bins.len() + 1];
        sums.last_run(&least, 0..bins.len() + 1, [0, bins.len()], &mut next, &mut start);
        least = next;
        starts.push(start);
    }
    let mut means = [bins.last().map_or(0.0, |bin| bin[0]); LEVELS];
    let mut end = bins.len();
    for (mean, start) in means[..count].iter_mut().zip(&starts).rev() {
        *mean = sums.mean(start[end], end).unwrap_or(*mean);
        end = start[end];
    }
    means
}

/// Prefix sums over the groups: of weights, of values times weights, and of squared values times weights. Values are
/// relative to `middle`, so that squares do not lose digits.
struct Sums {
    middle: f64,
    sums: Vec<[f64; 3]>,
}

impl Sums {
    fn new(bins: &[[f64; 2]]) -> Self {
        let middle = bins.get(bins.len() / 2).map_or(0.0, |bin| bin[0]);
        let mut sums = vec![[0.0; 3]];
        let mut sum = [0.0; 3];
        for [value, weight] in bins {
            let value = value - middle;
            sum = [sum[0] + weight, sum[1] + weight * value, sum[2] + weight * value * value];
            sums.push(sum);
        }
        Self { middle, sums }
    }

    fn of(&self, start: usize, end: usize) -> [f64; 3] {
        [0, 1, 2].map(|k| self.sums[end][k] - self.sums[start][k])
    }

    /// Returns the mean of groups `start` to before `end`; `None` if there are none.
    fn mean(&self, start: usize, end: usize) -> Option<f64> {
        let [weight, sum, _] = self.of(start, end);
        (end > start).then(|| self.middle + sum / weight)
    }

    /// Returns the weighted sum of squares of these groups around their mean.
    fn squares(&self, start: usize, end: usize) -> f64 {
        let [weight, sum, square] = self.of(start, end);
        if end > start { (square - sum * sum / weight).max(0.0) } else { 0.0 }
    }

    /// Finds for each of `ends` the start of the last run, which is within `bounds`, and the least sum of squares of all
    /// runs. `least` has the sums for one run less. The start never falls as the end rises, so each end that is solved
    /// narrows the bounds of the others.
    fn last_run(
        &self,
        least: &[f64],
        ends: Range<usize>,
        bounds: [usize; 2],
        next: &mut [f64],
        starts: &mut [usize],
    ) {
        if ends.is_empty() {
            return;
        }
        let middle = ends.start.midpoint(ends.end - 1);
        let (mut found, mut best) = (f64::INFINITY, bounds[0]);
        let last = bounds[1].min(middle);
        for (start, before) in (bounds[0]..).zip(&least[bounds[0]..=last]) {
            let squares = before + self.squares(start, middle);
            if squares < found {
                (found, best) = (squares, start);
            }
        }
        (next[middle], starts[middle]) = (found, best);
        self.last_run(least, ends.start..middle, [bounds[0], best], next, starts);
        self.last_run(least, middle + 1..ends.end, [best, bounds[1]], next, starts);
    }
}

/// Returns the groups of `sorted`: the mean of each, and its weight.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a share of the number of groups"
)]
fn bins(sorted: &[f32]) -> Vec<[f64; 2]> {
    let [low, high] = [sorted.first(), sorted.last()].map(|v| v.map_or(0.0, |v| f64::from(*v)));
    let bins = BINS.min(sorted.len());
    let mut sums = vec![[0.0; 2]; bins];
    for (i, value) in sorted.iter().map(|v| f64::from(*v)).enumerate() {
        let by_rank = i as f64 / sorted.len() as f64;
        let by_value = (value - low) / (high - low);
        let share = BY_VALUE * by_value + (1.0 - BY_VALUE) * by_rank;
        let sum = &mut sums[((share * bins as f64) as usize).min(bins - 1)];
        sum[0] += value;
        sum[1] += 1.0;
    }
    sums.retain(|[_, count]| *count > 0.0);
    sums.iter().map(|[sum, count]| [sum / count, count.sqrt()]).collect()
}

/// Returns the number of the entry of `book`, which is in ascending order, that is nearest to `value`.
pub(super) fn nearest(book: &[f32; LEVELS], value: f32) -> u8 {
    let above = book.partition_point(|v| *v < value).min(LEVELS - 1);
    let below = above.saturating_sub(1);
    let best = if value - book[below] < book[above] - value { below } else { above };
    best.to_le_bytes()[0]
}

#[cfg(test)]
mod tests {
    use lexisplat_testing::Random;

    use super::*;

    #[test]
    fn few_values_are_kept_and_many_are_near() {
        let few: Vec<f32> = (0..900_u16).map(|k| f32::from(k % 256) * 0.1 - 3.0).collect();
        let book = codebook(&few);
        assert!(few.iter().all(|v| book[usize::from(nearest(&book, *v))] == *v));
        assert_eq!(codebook(&[]), [0.0; LEVELS]);
        let mut random = Random::new(4);
        let mut many: Vec<f32> = (0..20_000).map(|_| random.unit().powi(3)).collect();
        many.push(40.0);
        let book = codebook(&many);
        assert!(book.is_sorted());
        let error = |value: f32| (book[usize::from(nearest(&book, value))] - value).abs();
        // Steps of a uniform list would be 40 / 255.
        let mean = many.iter().map(|v| error(*v)).sum::<f32>() / 20_001.0;
        assert!(mean < 2e-3 && error(40.0) < 0.01, "{mean} {}", error(40.0));
        for value in many {
            let plain = book.iter().map(|v| (v - value).abs()).fold(f32::INFINITY, f32::min);
            assert!(error(value) == plain, "{value}");
        }
    }
    /// Pairs of neighbours, at distances of four orders of magnitude, are the runs; a search that goes downhill misses some.
    #[test]
    fn the_least_squares_are_found() {
        let mut random = Random::new(8);
        let mut at = 0.0;
        let pairs: Vec<[f64; 2]> = (0..LEVELS)
            .map(|_| {
                at += 10.0_f64.powf(4.0 * f64::from(random.unit())) / 1e4 + 1e-5;
                [at, at + 1e-6]
            })
            .collect();
        let bins: Vec<[f64; 2]> = pairs.as_flattened().iter().map(|value| [*value, 1.0]).collect();
        for (mean, [a, b]) in runs(&bins).iter().zip(&pairs) {
            assert!((mean - (a + b) / 2.0).abs() < 1e-9, "{mean} {a} {b}");
        }
        // Fewer groups than runs stand alone.
        assert_eq!(runs(&[[1.0, 2.0], [3.0, 1.0]])[..3], [1.0, 3.0, 3.0]);
    }
}
