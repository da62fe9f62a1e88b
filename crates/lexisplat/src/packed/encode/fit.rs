//! Steps and predictors, fitted to sums over a scene.

use serde::{Deserialize, Serialize};

use super::canonical::{Canonical, canonical};
use super::neighbours::Neighbours;
use super::octaves::Histogram;
use crate::packed::bitstream::parameters::{ColourAndShape, FEATURES, LAST_CLASS, Parameters, TARGETS};
use crate::packed::bitstream::rounded_axes;
use crate::packed::curve::{Grid, MortonKey};
use crate::scene::sensitivity::{AppearanceSensitivity, Sensitivity};
use crate::scene::sh::C0;
use crate::scene::splats::Geometry;
use crate::support::maths::{Vec3, at_share};

/// Floor of sensitivities, as a share of their 90th percentile. Other views may show Gaussians that the measured views
/// did not.
const SENSITIVITY_FLOOR: f64 = 1e-3;
const FLOOR_QUANTILE: f64 = 0.9;
/// Quantile of sensitivities from which class 0 is set. Larger sensitivities do not make its steps finer.
const TOP_QUANTILE: f64 = 0.9995;
/// Quantile of sensitivities below which Gaussians do not count when the dependence of steps on shape is fitted.
const FIT_QUANTILE: f64 = 0.05;
/// Added to the squared derivative by scale, rotation or position before its logarithm is taken, as a share of that by
/// opacity.
const DERIVATIVE_FLOOR: f64 = 1e-4;
/// Factors on the steps of colour, SH values, opacity, scale, rotation and position, found by trial. Derivatives hold for
/// small errors, and the errors of packing are not small (docs/METHOD.md).
const DC_FACTOR: f32 = 1.6;
const VALUE_FACTOR: f32 = 1.1;
const OPACITY_FACTOR: f32 = 1.8;
const SCALE_FACTOR: f64 = 1.1;
const ROTATION_FACTOR: f64 = 0.8;
const POSITION_FACTOR: f64 = 1.12;
/// Smallest and largest step of class 0. Values around 1 have no finer digits in f32. With the largest step a value is as
/// good as unknown.
const STEPS: [f64; 2] = [1.0 / 16_777_216.0, 1e6];
/// Ridge of the normal equations, relative to their diagonal. It keeps them solvable.
const RIDGE: f64 = 1e-6;
/// Factor on the ridge, applied while coefficients are too large.
const RIDGE_GROWTH: f64 = 4.0;
/// Largest slope of the logarithm of a step. Files hold slopes below 8.
const MOST_SLOPE: f64 = 7.9;

/// Sums over the Gaussians of a scene from which its steps follow.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(in crate::packed) struct StepSums {
    /// Histogram of the sensitivities to the colour.
    colour: Histogram,
    /// Histogram of the sensitivities to the logarithm of the opacity.
    opacity: Histogram,
    colours: ColourMoments,
    derivatives: Derivatives,
}

impl StepSums {
    /// Adds the Gaussians of `keys`. `dc` has the base colours of `geometry`, and `own` the rounded sensitivities in the order of
    /// `keys`.
    pub(in crate::packed) fn add(
        &mut self,
        geometry: &Geometry,
        dc: &[Vec3],
        sensitivity: &Sensitivity,
        keys: &[MortonKey],
        own: impl Iterator<Item = AppearanceSensitivity>,
    ) {
        for AppearanceSensitivity { colour, opacity } in own {
            self.colour.add(colour);
            self.opacity.add(opacity);
        }
        self.colours.add(keys.iter().map(|g| dc[g.index()]));
        self.derivatives.add(geometry, sensitivity, keys);
    }

    /// Adds the sums `other` of other Gaussians.
    pub(in crate::packed) fn merge(&mut self, other: &Self) {
        self.colour.merge(&other.colour);
        self.opacity.merge(&other.opacity);
        self.colours.merge(&other.colours);
        self.derivatives.merge(&other.derivatives);
    }
}

/// The steps of a scene without predictors, relative to the overall step.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::packed) struct Steps {
    pub(in crate::packed) parameters: Parameters,
    classes: ColourAndShape<Classes>,
}

impl Steps {
    /// Returns the steps of a scene with these `sums`.
    pub(in crate::packed) fn new(grid: &Grid, sums: &StepSums) -> Self {
        let classes =
            ColourAndShape { colour: Classes::fit(&sums.colour), shape: Classes::fit(&sums.opacity) };
        let (dc_mean, dc_axes) = sums.colours.axes();
        let [scale_rows, rotation, position] = sums.derivatives.rows();
        let parameters = Parameters {
            origin: grid.origin,
            cell: grid.cell,
            factors: [
                DC_FACTOR / C0,
                VALUE_FACTOR / C0,
                OPACITY_FACTOR,
                // The steps of scales do not depend on scales, because no scale is decoded before them.
                single(libm::exp2(scale_rows[0][0])),
                single(libm::exp2(scale_rows[1][0])),
                single(libm::exp2(scale_rows[2][0])),
            ],
            rotation: rotation.map(|row| row.map(single)),
            position: position.map(|row| row.map(single)),
            dc_mean,
            dc_axes,
            ..Parameters::default()
        };
        Self { parameters, classes }
    }

    /// Returns the classes of Gaussians of these sensitivities, before rounding.
    pub(in crate::packed) fn classes_of(
        &self,
        sensitivities: &[AppearanceSensitivity],
    ) -> Vec<ColourAndShape<f32>> {
        let ColourAndShape { colour, shape } = self.classes;
        let of = |s: &AppearanceSensitivity| ColourAndShape {
            colour: colour.of(s.colour),
            shape: shape.of(s.opacity),
        };
        sensitivities.iter().map(of).collect()
    }

    /// Returns the parameters for the overall step `step`. It is about the square root of the mean squared error of
    /// pictures that one value of one Gaussian may cause.
    pub(in crate::packed) fn with_step(&self, step: f64) -> Parameters {
        let base = |unit: f64| single((unit * step).clamp(STEPS[0], STEPS[1]));
        Parameters { base: self.classes.map(|c| base(c.unit())), ..self.parameters.clone() }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "parameters are f32 by design")]
fn single(x: f64) -> f32 {
    x as f32
}

fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    at_share(&sorted, share)
}

/// The classes of steps of a scene. A class has the step `2^class / 2^top`, which is about `1 / sqrt(sensitivity)`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Classes {
    /// Added to every sensitivity before its logarithm is taken.
    floor: f64,
    /// Half the binary logarithm of the sensitivity of class 0, a whole number.
    top: f64,
}

impl Classes {
    /// Fits classes to a histogram of sensitivities.
    fn fit(sensitivities: &Histogram) -> Self {
        let quantile = |share| f64::from(sensitivities.quantile(share));
        let floor = (quantile(FLOOR_QUANTILE) * SENSITIVITY_FLOOR).max(1e-30);
        let top = 0.5 * libm::log2(quantile(TOP_QUANTILE) + floor);
        Self { floor, top: top.round() }
    }

    /// Returns the class of a sensitivity, before rounding.
    fn of(self, sensitivity: f32) -> f32 {
        single(self.top - 0.5 * libm::log2(f64::from(sensitivity) + self.floor))
    }

    /// Returns the step of class 0 at an overall step of 1.
    fn unit(self) -> f64 {
        libm::exp2(-self.top)
    }
}

/// Rounds a class to the nearest one that a file holds.
pub(in crate::packed) fn rounded(class: f32) -> u8 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    let class = class.round().clamp(0.0, f32::from(LAST_CLASS)) as u8;
    class
}

/// Rounds axes to those that a file holds.
fn rounded_of(axes: &[Vec<f64>]) -> [Vec3; 3] {
    let mut out = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for (row, axis) in out.iter_mut().zip(axes) {
        *row = std::array::from_fn(|c| single(axis[c]));
    }
    rounded_axes(&out)
}

/// Sums of base colours and of products of their channels.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct ColourMoments {
    count: u64,
    sums: [f64; 3],
    products: [[f64; 3]; 3],
}

impl ColourMoments {
    fn add(&mut self, dc: impl Iterator<Item = Vec3>) {
        for dc in dc.map(|dc| dc.map(f64::from)) {
            self.count += 1;
            for i in 0..3 {
                self.sums[i] += dc[i];
                for j in 0..3 {
                    self.products[i][j] += dc[i] * dc[j];
                }
            }
        }
    }

    /// Adds the sums `other` of other Gaussians.
    fn merge(&mut self, other: &Self) {
        self.count += other.count;
        for i in 0..3 {
            self.sums[i] += other.sums[i];
            for j in 0..3 {
                self.products[i][j] += other.products[i][j];
            }
        }
    }

    /// Returns the mean base colour and the principal axes of base colours, strongest first.
    fn axes(&self) -> (Vec3, [Vec3; 3]) {
        let n = self.count.max(1) as f64;
        let mean = self.sums.map(|sum| sum / n);
        let about = |i: usize, j: usize| self.products[i][j] - self.sums[i] * mean[j];
        let moments = (0..3).map(|i| (0..3).map(|j| about(i, j)).collect()).collect();
        (mean.map(single), rounded_of(&crate::sparse::learn::axes_of_moments(moments)))
    }
}

/// Fits of the binary logarithm of steps, relative to the step of the opacity: for scaling, turning and moving, along each
/// axis. The logarithm is linear in 1 and the three scales. For scaling it is constant.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Derivatives([[Equations<4>; 3]; 3]);

impl Default for Derivatives {
    fn default() -> Self {
        Self([[Equations::NONE; 3]; 3])
    }
}

impl Derivatives {
    /// Adds the Gaussians of `keys`. Gaussians with the smallest sensitivities do not count.
    fn add(&mut self, geometry: &Geometry, sensitivity: &Sensitivity, keys: &[MortonKey]) {
        let by_opacities: Vec<f64> = sensitivity.opacity.iter().map(|&s| f64::from(s)).collect();
        let least = quantile(&by_opacities, FIT_QUANTILE).max(1e-30);
        for placed in keys.iter().filter(|g| by_opacities[g.index()] > least) {
            let by_opacity = by_opacities[placed.index()];
            let g = canonical(geometry, placed.index());
            let by_axis = by_axis(sensitivity, placed.index(), &g);
            let scales = g.scales.map(f64::from);
            for (kind, equations) in self.0.iter_mut().enumerate() {
                // For the floor, positions are measured in standard deviations along the longest axis.
                let unit = if kind == POSITION { libm::exp(-2.0 * scales[0]) } else { 1.0 };
                let features = match kind {
                    SCALE => [1.0, 0.0, 0.0, 0.0],
                    _ => [1.0, scales[0], scales[1], scales[2]],
                };
                for (by_axis, equations) in by_axis[kind].iter().zip(equations) {
                    let by_axis = f64::from(by_axis.max(0.0)) + DERIVATIVE_FLOOR * by_opacity * unit;
                    equations.add(features, -0.5 * libm::log2(by_axis / by_opacity));
                }
            }
        }
    }

    /// Adds the sums `other` of other Gaussians.
    fn merge(&mut self, other: &Self) {
        let own = self.0.as_flattened_mut().iter_mut();
        own.zip(other.0.as_flattened()).for_each(|(sum, more)| sum.merge(more));
    }

    fn rows(&self) -> [[[f64; 4]; 3]; 3] {
        let rows = |kind: usize, factor: f64| {
            std::array::from_fn(|axis| {
                let mut row = self.0[kind][axis].solve_within(MOST_SLOPE);
                row[0] += libm::log2(factor);
                row
            })
        };
        [rows(SCALE, SCALE_FACTOR), rows(ROTATION, ROTATION_FACTOR), rows(POSITION, POSITION_FACTOR)]
    }
}

/// Indices into [`Derivatives`].
const SCALE: usize = 0;
const ROTATION: usize = 1;
const POSITION: usize = 2;

/// Returns the sensitivities of Gaussian `i` to scaling, turning and moving along each of its axes, in canonical order.
fn by_axis(sensitivity: &Sensitivity, i: usize, g: &Canonical) -> [Vec3; 3] {
    let p = sensitivity.position[i];
    let along = |a: Vec3| {
        p[0] * a[0] * a[0]
            + p[3] * a[1] * a[1]
            + p[5] * a[2] * a[2]
            + 2.0 * (p[1] * a[0] * a[1] + p[2] * a[0] * a[2] + p[4] * a[1] * a[2])
    };
    [g.order.map(|k| sensitivity.scale[i][k]), g.order.map(|k| sensitivity.rotation[i][k]), g.axes.map(along)]
}

/// Sums from which the predictions of values are fitted. The values are not rounded.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::packed) struct Predictors {
    count: u64,
    sums: [f64; TARGETS],
    equations: [Equations<FEATURES>; TARGETS],
}

impl Default for Predictors {
    fn default() -> Self {
        Self { count: 0, sums: [0.0; TARGETS], equations: [Equations::NONE; TARGETS] }
    }
}

impl Predictors {
    /// Adds the Gaussians of `keys`, with their classes before rounding. A Gaussian is predicted from those before it in
    /// `keys`.
    pub(in crate::packed) fn add(
        &mut self,
        geometry: &Geometry,
        dc: &[Vec3],
        keys: &[MortonKey],
        classes: &[ColourAndShape<f32>],
        parameters: &Parameters,
    ) {
        self.count += keys.len() as u64;
        let mut neighbours = Neighbours::default();
        for (placed, class) in keys.iter().zip(classes) {
            let mut g = canonical(geometry, placed.index());
            g.dc = dc[placed.index()];
            let coordinates = parameters.dc_coordinates(g.dc);
            let values: [f32; TARGETS] = [
                g.scales[0],
                g.scales[1],
                g.scales[2],
                g.log_opacity,
                coordinates[0],
                coordinates[1],
                coordinates[2],
            ];
            for (sum, value) in self.sums.iter_mut().zip(values) {
                *sum += f64::from(value);
            }
            if let Some(around) = neighbours.average(g.position, 0.5 * parameters.cell) {
                for (t, equations) in self.equations.iter_mut().enumerate() {
                    let ColourAndShape { colour, shape } = class.map(|class| f32::from(rounded(class)));
                    let known = |k: usize| if t > k { values[k] } else { 0.0 };
                    let features = [1.0, around[t], colour, shape, known(0), known(1), known(2)];
                    equations.add(features.map(f64::from), f64::from(values[t]));
                }
            }
            neighbours.push(g.position, values);
        }
    }

    /// Adds the sums `other` of other Gaussians.
    pub(in crate::packed) fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.sums.iter_mut().zip(other.sums).for_each(|(sum, more)| *sum += more);
        self.equations.iter_mut().zip(&other.equations).for_each(|(sum, more)| sum.merge(more));
    }

    /// Solves for the predictions and stores them in `parameters`.
    pub(in crate::packed) fn solve(&self, parameters: &mut Parameters) {
        let n = self.count.max(1) as f64;
        parameters.means = self.sums.map(|sum| single(sum / n));
        for (row, equations) in parameters.predictors.iter_mut().zip(&self.equations) {
            *row = equations.solve().map(single);
        }
    }
}

/// A least-squares fit by normal equations.
#[derive(Debug, Clone, Copy)]
struct Equations<const N: usize> {
    matrix: [[f64; N]; N],
    right: [f64; N],
}

impl<const N: usize> Serialize for Equations<N> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (self.matrix.as_flattened(), self.right.as_slice()).serialize(serializer)
    }
}

impl<'de, const N: usize> Deserialize<'de> for Equations<N> {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (matrix, right) = <(Vec<f64>, Vec<f64>)>::deserialize(deserializer)?;
        let (rows, rest) = matrix.as_chunks::<N>();
        match (rows.try_into(), right.try_into(), rest) {
            (Ok(matrix), Ok(right), []) => Ok(Self { matrix, right }),
            _ => Err(serde::de::Error::custom("equations of another number of unknowns")),
        }
    }
}

impl<const N: usize> Equations<N> {
    const NONE: Self = Self { matrix: [[0.0; N]; N], right: [0.0; N] };

    fn add(&mut self, features: [f64; N], value: f64) {
        for i in 0..N {
            for j in 0..N {
                self.matrix[i][j] += features[i] * features[j];
            }
            self.right[i] += features[i] * value;
        }
    }

    /// Adds the sums `other` of other equations.
    fn merge(&mut self, other: &Self) {
        let own = self.matrix.as_flattened_mut().iter_mut().chain(&mut self.right);
        own.zip(other.matrix.as_flattened().iter().chain(&other.right)).for_each(|(sum, more)| *sum += more);
    }

    /// Returns the coefficients. All but the first are at most `most` in size, if a ridge below 1 is enough for that.
    /// Features that hardly vary, or vary together, have large coefficients of opposite signs, which a file cannot hold. If
    /// they were cut off, they would not cancel.
    fn solve_within(&self, most: f64) -> [f64; N] {
        let mut ridge = RIDGE;
        loop {
            let found = self.solve_with(ridge);
            if found.iter().skip(1).all(|x| x.abs() <= most) || ridge >= 1.0 {
                return found;
            }
            ridge *= RIDGE_GROWTH;
        }
    }

    /// Returns the coefficients. A feature that is always 0 has the coefficient 0.
    fn solve(&self) -> [f64; N] {
        self.solve_with(RIDGE)
    }

    fn solve_with(&self, ridge: f64) -> [f64; N] {
        let (mut m, mut r) = (self.matrix, self.right);
        let scale = (0..N).map(|i| m[i][i]).fold(1e-30, f64::max);
        for (i, row) in m.iter_mut().enumerate() {
            row[i] += ridge * (row[i] + 1e-6 * scale);
        }
        for c in 0..N {
            let pivot = m[c];
            if pivot[c] <= 0.0 {
                continue;
            }
            let right = r[c];
            for i in c + 1..N {
                let factor = m[i][c] / pivot[c];
                for (value, p) in m[i].iter_mut().zip(&pivot) {
                    *value -= factor * p;
                }
                r[i] -= factor * right;
            }
        }
        let mut x = [0.0; N];
        for c in (0..N).rev() {
            let known: f64 = (c + 1..N).map(|j| m[c][j] * x[j]).sum();
            x[c] = if m[c][c] > 0.0 { (r[c] - known) / m[c][c] } else { 0.0 };
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Features that take few values and vary together but for a little noise.
    #[test]
    fn coefficients_of_features_that_vary_together_are_small() {
        let mut equations = Equations::<4>::NONE;
        for i in 0..60 {
            let (x, noise) = (f64::from(i % 3), 1e-2 * f64::from(i * 7 % 5));
            equations.add([1.0, x, x + noise, 2.0 * x - noise], x + 50.0 * noise);
        }
        assert!(equations.solve().iter().any(|x| x.abs() > MOST_SLOPE));
        let found = equations.solve_within(MOST_SLOPE);
        assert!(found.iter().skip(1).all(|x| x.abs() <= MOST_SLOPE), "{found:?}");
    }
}
