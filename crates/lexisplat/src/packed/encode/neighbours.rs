//! Averages of the last Gaussians, for the fit of predictors.

use crate::packed::bitstream::parameters::TARGETS;
use crate::support::maths::Vec3;

/// Number of Gaussians that are remembered. More gain little, since neighbours on the Morton curve are neighbours in space.
const WINDOW: usize = 16;

/// The last [`WINDOW`] Gaussians.
#[derive(Debug, Clone, Default)]
pub(in crate::packed) struct Neighbours {
    positions: [Vec3; WINDOW],
    values: [[f32; TARGETS]; WINDOW],
    /// Number of Gaussians pushed.
    seen: usize,
}

impl Neighbours {
    /// Returns the averages of the remembered values, weighted by `1 / (distance^2 + near^2)` from `centre`. `None` if no
    /// Gaussian was pushed.
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
        // All weights are 0 at distances that leave f32.
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
