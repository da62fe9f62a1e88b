//! Lists of 256 values that stand for many.

use super::LEVELS;

/// Groups of values that the search works on.
const BINS: usize = 4096;
/// How much the place of a group tells by value rather than by rank. Some of both: dense values get many groups, and those
/// far out their own (splat-transform blends them too, `quantize-1d-core.ts`).
const BY_VALUE: f64 = 0.5;
/// Most rounds of the search.
const ROUNDS: usize = 200;

/// 256 values, ascending, that are near to `values` on the whole. If there are no more than 256, they are the values
/// themselves. All values are finite.
///
/// The search is Lloyd's, over groups of neighbours that weigh the root of their size: so values far out, which are seen
/// best, count for more than their number.
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
    let bins = bins(&sorted);
    let last = bins.len().saturating_sub(1);
    let mut centres: [f64; LEVELS] = std::array::from_fn(|k| bins[k * last / (LEVELS - 1)][0]);
    for _ in 0..ROUNDS {
        let mut sums = [[0.0; 2]; LEVELS];
        let mut at = 0;
        for [value, weight] in &bins {
            while at + 1 < LEVELS && value - centres[at] > centres[at + 1] - value {
                at += 1;
            }
            sums[at][0] += value * weight;
            sums[at][1] += weight;
        }
        let before = centres;
        for (centre, [sum, weight]) in centres.iter_mut().zip(sums) {
            if weight > 0.0 {
                *centre = sum / weight;
            }
        }
        if centres == before {
            break;
        }
    }
    let mut book = centres.map(|v| v as f32);
    book.sort_unstable_by(f32::total_cmp);
    book
}

/// Groups of `sorted`: the mean of each, and what it weighs.
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
        let place = BY_VALUE * by_value + (1.0 - BY_VALUE) * by_rank;
        let sum = &mut sums[((place * bins as f64) as usize).min(bins - 1)];
        sum[0] += value;
        sum[1] += 1.0;
    }
    sums.retain(|[_, count]| *count > 0.0);
    sums.iter().map(|[sum, count]| [sum / count, count.sqrt()]).collect()
}

/// The number of the entry of `book`, which ascends, that is nearest to `value`.
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
}
