//! Chooses an order of Gaussians in which chunks are small.

use super::CHUNK;

/// Number of bits of a Morton code along each axis.
const BITS: u32 = 10;
/// Largest ratio of the size of chunks in the given order to their size in sorted order at which the given order is kept.
/// A file that is read and written again therefore keeps its order.
const KEPT: f64 = 1.1;

/// Returns the order in which to write Gaussians at `positions`: the given order if its chunks are about as small as
/// those in the order of Morton codes, otherwise the order of Morton codes.
pub(crate) fn order(positions: &[[f32; 3]]) -> Vec<usize> {
    let kept: Vec<usize> = (0..positions.len()).collect();
    let sorted = sorted(positions);
    if size(positions, &kept) <= KEPT * size(positions, &sorted) { kept } else { sorted }
}

/// Returns the sum of the extents of all chunks along all axes.
fn size(positions: &[[f32; 3]], order: &[usize]) -> f64 {
    let extent = |chunk: &[usize]| -> f64 {
        let axis = |k: usize| {
            let values = chunk.iter().map(|&i| f64::from(positions[i][k]));
            let ends = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
            ends[1] - ends[0]
        };
        (0..3).map(axis).sum()
    };
    order.chunks(CHUNK).map(extent).sum()
}

/// Returns Gaussians in the order of their Morton codes within the bounds of all positions. Gaussians of equal codes keep
/// their order.
pub(crate) fn sorted(positions: &[[f32; 3]]) -> Vec<usize> {
    let bounds = [0, 1, 2].map(|k| {
        let values = positions.iter().map(|p| f64::from(p[k]));
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)])
    });
    let cells = f64::from(1_u32 << BITS);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited")]
    let code = |position: &[f32; 3]| -> u32 {
        let cell = [0, 1, 2].map(|k| {
            let [low, high] = bounds[k];
            let share = if high > low { (f64::from(position[k]) - low) / (high - low) } else { 0.0 };
            (share * cells).clamp(0.0, cells - 1.0) as u32
        });
        (0..BITS).fold(0, |code, bit| {
            (0..3).fold(code, |code, k| code | (cell[k] >> bit & 1) << (3 * bit + k as u32))
        })
    };
    let codes: Vec<u32> = positions.iter().map(code).collect();
    let mut order: Vec<usize> = (0..positions.len()).collect();
    order.sort_by_key(|&i| codes[i]);
    order
}

#[cfg(test)]
mod tests {
    use lexisplat_testing::Random;

    use super::*;

    #[test]
    fn scattered_gaussians_are_sorted_and_sorted_ones_are_kept() {
        let mut random = Random::new(9);
        let positions: Vec<[f32; 3]> = (0..5000).map(|_| std::array::from_fn(|_| random.unit())).collect();
        let order_of = order(&positions);
        assert!(order_of != (0..5000).collect::<Vec<_>>());
        let placed: Vec<[f32; 3]> = order_of.iter().map(|&i| positions[i]).collect();
        assert!(order(&placed) == (0..5000).collect::<Vec<_>>());
        assert!(size(&positions, &order_of) < 0.7 * size(&positions, &(0..5000).collect::<Vec<_>>()));
        let mut all = order_of;
        all.sort_unstable();
        assert!(all == (0..5000).collect::<Vec<_>>());
    }
}
