//! Averages of the Gaussians just before one, on which predictors are fitted.

use crate::packed::bitstream::parameters::TARGETS;
use crate::support::maths::Vec3;

/// Gaussians remembered. More of them gain little, since neighbours on the Morton curve are neighbours in
/// space.
const WINDOW: usize = 16;

/// The last few Gaussians.
#[derive(Debug, Clone, Default)]
pub(in crate::packed) struct Neighbours {
    positions: [Vec3; WINDOW],
    values: [[f32; TARGETS]; WINDOW],
    /// Number seen so far.
    seen: usize,
}

impl Neighbours {
    /// Averages around `centre`, weighted by the inverse squared distance, which is taken to be at least
    /// `near`. `None` before the first Gaussian.
    pub(in crate::packed) fn average(&self, centre: Vec3, near: f32) -> Option<[f32; TARGETS]> {
        let known = self.seen.min(WINDOW);
        if known == 0 {
            return None;
        }
        let floor = near * near;
        let mut sums = [0.0_f32; TARGETS];
        let mut total = 0.0_f32;
        for (position, values) in self.positions.iter().zip(&self.values).take(known) {
            let d: Vec3 = std::array::from_fn(|k| position[k] - centre[k]);
            let weight = 1.0 / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + floor);
            total += weight;
            for (sum, value) in sums.iter_mut().zip(values) {
                *sum += weight * value;
            }
        }
        // At distances beyond f32 all weights are 0.
        let average = sums.map(|sum| sum / total);
        average.iter().all(|v| v.is_finite()).then_some(average)
    }

    pub(in crate::packed) fn push(&mut self, position: Vec3, values: [f32; TARGETS]) {
        let at = self.seen % WINDOW;
        self.positions[at] = position;
        self.values[at] = values;
        self.seen += 1;
    }
}
