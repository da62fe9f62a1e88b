//! Estimates from the sizes of Gaussians the places from which photographs were taken.
//!
//! Training makes Gaussians as small as the photographs need, so the size of a Gaussian is about proportional to its
//! distance from the cameras. From the places of photographs Gaussians therefore look more alike in size than from other
//! places.

use lexisplat::Geometry;

/// Smallest opacity of a Gaussian that counts, 30 %, before the sigmoid.
const FAINT: f32 = -0.85;
/// Largest number of Gaussians that are looked at, evenly chosen.
const ASKED: usize = 4096;

/// The positions of some Gaussians, and the natural logarithms of their largest scales.
pub(crate) struct Sizes(Vec<([f64; 3], f64)>);

impl Sizes {
    pub(crate) fn of(geometry: &Geometry) -> Self {
        let seen: Vec<usize> = (0..geometry.len()).filter(|&i| geometry.opacities[i] > FAINT).collect();
        let step = seen.len().div_ceil(ASKED).max(1);
        let one = |&i: &usize| {
            let largest = geometry.scales[i].iter().copied().fold(f32::NEG_INFINITY, f32::max);
            (geometry.positions[i].map(f64::from), f64::from(largest))
        };
        let all = seen.iter().step_by(step).map(one);
        Self(all.filter(|(place, size)| size.is_finite() && place.iter().all(|v| v.is_finite())).collect())
    }

    /// Returns the sizes as seen from `position`.
    pub(crate) fn seen_from(&self, position: [f32; 3]) -> SizesSeen {
        let position = position.map(f64::from);
        let mut sizes: Vec<f64> = (self.0.iter())
            .map(|(place, size)| {
                let squares: f64 = (0..3).map(|k| (place[k] - position[k]).powi(2)).sum();
                size - 0.5 * libm::log(squares.max(f64::MIN_POSITIVE))
            })
            .collect();
        let mut at = |share: usize| {
            let rank = sizes.len() * share / 4;
            (rank < sizes.len()).then(|| *sizes.select_nth_unstable_by(rank, f64::total_cmp).1)
        };
        let [lower, median, upper] = [1, 2, 3].map(|share| at(share).unwrap_or(f64::NAN));
        let spread = upper - lower;
        SizesSeen { spread: if spread.is_nan() { f64::INFINITY } else { spread }, median }
    }
}

/// The natural logarithms of sizes over distances, as seen from one place.
pub(crate) struct SizesSeen {
    /// Difference of the upper and the lower quartile; infinite if there are no sizes.
    pub(crate) spread: f64,
    pub(crate) median: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gaussians on walls around a camera, each of a size in proportion to its distance.
    #[test]
    fn sizes_are_most_alike_from_where_they_were_seen() {
        let mut geometry = Geometry::default();
        let camera = [0.5, -0.25, 1.0];
        for i in 0..3000_u16 {
            let wave = |k: f32| (f32::from(i) * k).sin();
            let direction = [wave(1.3), wave(2.1), wave(0.7)];
            let far = 2.0 + 5.0 * wave(0.37).powi(2);
            geometry.positions.push([0, 1, 2].map(|k| camera[k] + far * direction[k]));
            let length = direction.iter().map(|v| v * v).sum::<f32>().sqrt() * far;
            geometry.scales.push([-9.0, (0.01 * length).ln() + 0.2 * wave(5.1), -9.0]);
            geometry.opacities.push(if i % 5 == 0 { -4.0 } else { 2.0 });
            geometry.rotations.push([1.0, 0.0, 0.0, 0.0]);
        }
        let sizes = Sizes::of(&geometry);
        let here = sizes.seen_from(camera).spread;
        for k in 0..3 {
            for step in [-1.5, 1.5] {
                let mut beside = camera;
                beside[k] += step;
                let there = sizes.seen_from(beside).spread;
                assert!(there > 1.2 * here, "{here} {there}");
            }
        }
        assert_eq!(Sizes::of(&Geometry::default()).seen_from(camera).spread, f64::INFINITY);
    }
}
