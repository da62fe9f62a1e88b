//! Carries derivatives by the values of a Gaussian on screen back to its values in the world: the adjoint of `project`.
//!
//! Names are those of [`Projection::place`]: view-space positions, the Jacobian of the perspective, the axes on screen, the
//! covariance and its inverse, the conic.

use lexisplat::sh::{C0, CHANNELS, rest_basis_slopes};
use lexisplat::{Geometry, ShDegree};

use crate::camera::Camera;
use crate::conventions::{ANTIALIAS_FLOOR, DILATION, QUATERNION_FLOOR, TAN_LIMIT};

use super::gradient::{GaussianGradient, SUMS};
use super::math::{exp, sigmoid};
use super::project::Projection;
use super::splat::Splat;

type Vec3 = [f32; 3];

/// Derivatives by the values of a splat.
#[derive(Debug, Clone, Copy)]
pub(super) struct OnScreen {
    centre: [f32; 2],
    conic: [f32; 3],
    /// By the logarithm of the opacity.
    log_opacity: f32,
    colour: Vec3,
}

impl OnScreen {
    /// Returns the derivatives of a splat from the sums over its pixels.
    pub(super) fn of(splat: &Splat, sums: [f32; SUMS]) -> Self {
        let [red, green, blue, all, x, y, xx, xy, yy] = sums;
        let [a, b, c] = splat.conic;
        // Derivatives of the power, `-(a dx^2 + c dy^2) / 2 - b dx dy`.
        Self {
            centre: [-(a * x + b * y), -(b * x + c * y)],
            conic: [-0.5 * xx, -xy, -0.5 * yy],
            log_opacity: all,
            colour: [red, green, blue],
        }
    }
}

/// Carries derivatives of one picture back to the world.
#[derive(Debug)]
pub(super) struct ToWorld<'a> {
    projection: &'a Projection,
}

impl<'a> ToWorld<'a> {
    pub(super) fn new(projection: &'a Projection) -> Self {
        Self { projection }
    }

    fn camera(&self) -> &Camera {
        &self.projection.camera
    }

    /// Returns the derivatives by the values of Gaussian `i`, which is shown as `splat` and has these SH-rest coefficients.
    pub(super) fn carry(
        &self,
        geometry: &Geometry,
        degree: ShDegree,
        rest: &[f32],
        i: usize,
        splat: &Splat,
        on_screen: &OnScreen,
    ) -> GaussianGradient {
        let position = geometry.positions[i];
        let turned = Turned::of(geometry.rotations[i], geometry.scales[i]);
        let view = self.camera().to_view(position);
        let (by_view, by_axes) = self.of_ellipse(view, &turned, on_screen);
        // A channel at 0 is cut off.
        let colour: Vec3 =
            std::array::from_fn(|c| if splat.colour[c] > 0.0 { on_screen.colour[c] } else { 0.0 });
        let (direction, by_direction) = self.of_direction(position, degree, rest, colour);
        let r = &self.camera().rotation;
        GaussianGradient {
            position: std::array::from_fn(|j| dot(r[j], by_view) + by_direction[j]),
            scales: std::array::from_fn(|m| dot(by_axes[m], turned.axis(m))),
            rotation: turned.by_quaternion(&by_axes),
            opacity: on_screen.log_opacity * (1.0 - sigmoid(geometry.opacities[i])),
            dc: colour.map(|v| C0 * v),
            colour,
            direction,
        }
    }

    /// Returns the derivatives by the position in view space and by the three axes in the world.
    fn of_ellipse(&self, view: Vec3, turned: &Turned, on_screen: &OnScreen) -> (Vec3, [Vec3; 3]) {
        let [x, y, z] = view;
        let [fx, fy] = self.projection.focal;
        let limits = self.projection.tan.map(|tan| TAN_LIMIT * tan);
        // The slopes x/z and y/z, within the limits, and whether they are.
        let [(tx, free_x), (ty, free_y)] = [(x / z, limits[0]), (y / z, limits[1])]
            .map(|(t, limit)| (t.clamp(-limit, limit), t.abs() <= limit));
        let jacobian = [[fx / z, 0.0, -fx * tx / z], [0.0, fy / z, -fy * ty / z]];
        let r = &self.camera().rotation;
        // The two rows of the map from the world to the screen.
        let map = jacobian.map(|row| -> Vec3 { std::array::from_fn(|j| dot(r[j], row)) });
        let axes: [[f32; 2]; 3] =
            std::array::from_fn(|m| [dot(map[0], turned.axis(m)), dot(map[1], turned.axis(m))]);
        let entry = |k: usize, l: usize| axes.iter().map(|axis| axis[k] * axis[l]).sum::<f32>();
        let (a, b, c) = (entry(0, 0), entry(0, 1), entry(1, 1));
        let covariance = [a + DILATION, b, c + DILATION];
        let cross = |p: [f32; 2], q: [f32; 2]| (p[0] * q[1] - p[1] * q[0]).powi(2);
        let before = cross(axes[0], axes[1]) + cross(axes[1], axes[2]) + cross(axes[2], axes[0]);
        let det = before + DILATION * (a + c) + DILATION * DILATION;
        let mut by_covariance = of_inverse(covariance, det, on_screen.conic);
        if self.projection.antialiased && before / det > ANTIALIAS_FLOOR {
            // The opacity has the factor `sqrt(before / det)`.
            let half = 0.5 * on_screen.log_opacity;
            let slopes = [[c, -2.0 * b, a], [covariance[2], -2.0 * b, covariance[0]]];
            for (k, by) in by_covariance.iter_mut().enumerate() {
                *by += half * (slopes[0][k] / before - slopes[1][k] / det);
            }
        }
        let [by_a, by_b, by_c] = by_covariance;
        let by_axes = axes.map(|[p, q]| [2.0 * by_a * p + by_b * q, by_b * p + 2.0 * by_c * q]);
        let in_world: [Vec3; 3] =
            by_axes.map(|[p, q]| std::array::from_fn(|j| map[0][j] * p + map[1][j] * q));
        // Row `k` of the derivative by the Jacobian, entry `l`: the axes in view space times the derivatives by the axes on screen.
        let in_view: [Vec3; 3] = std::array::from_fn(|m| {
            let axis = turned.axis(m);
            std::array::from_fn(|l| (0..3).map(|j| r[j][l] * axis[j]).sum())
        });
        let by_jacobian =
            |k: usize, l: usize| in_view.iter().zip(&by_axes).map(|(axis, by)| axis[l] * by[k]).sum::<f32>();
        let near = 1.0 / (z + self.projection.w_epsilon);
        let mut by_view = [0.0; 3];
        for (k, (f, t, free, v)) in [(fx, tx, free_x, x), (fy, ty, free_y, y)].into_iter().enumerate() {
            let (diagonal, last) = (by_jacobian(k, k), by_jacobian(k, 2));
            by_view[k] += on_screen.centre[k] * f * near;
            by_view[2] -= on_screen.centre[k] * f * v * near * near;
            by_view[2] -= diagonal * f / (z * z);
            // The last entry is `-f t / z`, where t is `v / z` if it is free.
            if free {
                by_view[k] -= last * f / (z * z);
                by_view[2] += last * 2.0 * f * t / (z * z);
            } else {
                by_view[2] += last * f * t / (z * z);
            }
        }
        (by_view, in_world)
    }

    /// Returns the direction to a position, and the derivatives by the position of what the SH-rest adds to the colour.
    fn of_direction(&self, position: Vec3, degree: ShDegree, rest: &[f32], colour: Vec3) -> (Vec3, Vec3) {
        let offset: Vec3 = std::array::from_fn(|j| position[j] - self.camera().position[j]);
        let length = dot(offset, offset).sqrt();
        let direction = offset.map(|v| v / length);
        let per_channel = degree.rest_per_channel();
        let mut by_direction = [0.0; 3];
        if per_channel > 0 {
            let slopes = rest_basis_slopes(degree, direction);
            for (k, slope) in slopes.iter().take(per_channel).enumerate() {
                let by_basis: f32 = (0..CHANNELS).map(|c| colour[c] * rest[c * per_channel + k]).sum();
                by_direction.iter_mut().zip(slope).for_each(|(by, slope)| *by += by_basis * slope);
            }
        }
        // Along the direction nothing changes.
        let along = dot(by_direction, direction);
        (direction, std::array::from_fn(|j| (by_direction[j] - along * direction[j]) / length))
    }
}

/// Returns the derivatives by a symmetric matrix (xx, xy, yy) from those by its inverse. An entry xy stands for both off the
/// diagonal.
fn of_inverse([xx, xy, yy]: Vec3, det: f32, [by_xx, by_xy, by_yy]: Vec3) -> Vec3 {
    let (p, q, r) = (yy / det, -xy / det, xx / det);
    // `-Q G Q` with the inverse Q and the symmetric matrix G of derivatives.
    let g = [[by_xx, 0.5 * by_xy], [0.5 * by_xy, by_yy]];
    let inverse = [[p, q], [q, r]];
    let entry = |k: usize, l: usize| {
        let mut sum = 0.0;
        for (m, row) in g.iter().enumerate() {
            for (n, value) in row.iter().enumerate() {
                sum -= inverse[k][m] * value * inverse[n][l];
            }
        }
        sum
    };
    [entry(0, 0), 2.0 * entry(0, 1), entry(1, 1)]
}

/// The axes of a Gaussian in the world.
struct Turned {
    /// The unit quaternion, real part first, and the length that it was divided by.
    quaternion: [f32; 4],
    length: f32,
    /// Standard deviations.
    scales: Vec3,
    /// The columns of the rotation matrix.
    columns: [Vec3; 3],
}

impl Turned {
    fn of(rotation: [f32; 4], scales: Vec3) -> Self {
        let length = rotation.iter().map(|v| v * v).sum::<f32>().sqrt().max(QUATERNION_FLOOR);
        let [w, x, y, z] = rotation.map(|v| v / length);
        let columns = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
            [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
            [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
        ];
        Self { quaternion: [w, x, y, z], length, scales: scales.map(exp), columns }
    }

    /// Returns axis `m`: the column of the rotation matrix times the standard deviation.
    fn axis(&self, m: usize) -> Vec3 {
        self.columns[m].map(|v| v * self.scales[m])
    }

    /// Returns the derivatives by the stored quaternion from those by the axes.
    fn by_quaternion(&self, by_axes: &[Vec3; 3]) -> [f32; 4] {
        let [w, x, y, z] = self.quaternion;
        // By the entries of the rotation matrix, column by column.
        let [a, b, c]: [Vec3; 3] = std::array::from_fn(|m| by_axes[m].map(|v| v * self.scales[m]));
        let by_unit = [
            2.0 * (z * (a[1] - b[0]) + y * (c[0] - a[2]) + x * (b[2] - c[1])),
            2.0 * (y * (a[1] + b[0]) + z * (a[2] + c[0]) + w * (b[2] - c[1])) - 4.0 * x * (b[1] + c[2]),
            2.0 * (x * (a[1] + b[0]) + z * (b[2] + c[1]) + w * (c[0] - a[2])) - 4.0 * y * (a[0] + c[2]),
            2.0 * (x * (a[2] + c[0]) + y * (b[2] + c[1]) + w * (a[1] - b[0])) - 4.0 * z * (a[0] + b[1]),
        ];
        let along: f32 = by_unit.iter().zip(&self.quaternion).map(|(by, q)| by * q).sum();
        std::array::from_fn(|k| (by_unit[k] - along * self.quaternion[k]) / self.length)
    }
}

fn dot(a: Vec3, b: Vec3) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use lexisplat::Splats;
    use lexisplat_sample::{SampleOptions, scene};

    use super::super::project::Body;
    use super::*;
    use crate::orbit::orbit;

    /// Derivatives of a sum of all values on screen with these factors: centre, conic, logarithm of the opacity.
    const FACTORS: [f32; 6] = [0.3, -0.2, 40.0, 25.0, -30.0, 1.5];

    fn sum(geometry: &Geometry, projection: &Projection, i: usize) -> f32 {
        let placed = projection.place(&Body::load(geometry, i..i + 1));
        let [x, y] = placed.centre.map(|lanes| lanes[0]);
        let [a, b, c] = placed.conic.map(|lanes| lanes[0]);
        let values = [x, y, a, b, c, placed.opacity[0].ln()];
        values.iter().zip(FACTORS).map(|(value, factor)| value * factor).sum()
    }

    fn value(geometry: &mut Geometry, i: usize, k: usize) -> &mut f32 {
        match k {
            0..3 => &mut geometry.positions[i][k],
            3..6 => &mut geometry.scales[i][k - 3],
            6..10 => &mut geometry.rotations[i][k - 6],
            _ => &mut geometry.opacities[i],
        }
    }

    /// Derivatives agree with differences, for Gaussians within the picture, beside it, where the perspective is cut off, and with
    /// rotations of any length.
    #[test]
    fn derivatives_are_slopes() {
        let Splats { geometry, .. } = scene(&SampleOptions::new(300, 5));
        for antialiased in [false, true] {
            for mut camera in orbit(&geometry, 2, 90, 60) {
                camera.position = camera.position.map(|v| 0.7 * v);
                let projection = Projection::new(&camera, antialiased);
                let world = ToWorld::new(&projection);
                let mut compared = 0;
                for i in 0..geometry.positions.len() {
                    let mut geometry = geometry.clone();
                    geometry.scales[i] = geometry.scales[i].map(|scale| scale.max(-3.0));
                    geometry.rotations[i] = geometry.rotations[i].map(|v| 1.7 * v);
                    if camera.to_view(geometry.positions[i])[2] < 0.5 {
                        continue;
                    }
                    let [x, y, a, b, c, log_opacity] = FACTORS;
                    let on_screen =
                        OnScreen { centre: [x, y], conic: [a, b, c], log_opacity, colour: [0.0; 3] };
                    let found = world.carry(&geometry, ShDegree::ZERO, &[], i, &Splat::default(), &on_screen);
                    let found: Vec<f32> =
                        [&found.position[..], &found.scales, &found.rotation, &[found.opacity]].concat();
                    let size = found.iter().map(|v| v * v).sum::<f32>().sqrt();
                    for (k, &found) in found.iter().enumerate() {
                        const STEP: f32 = 1.0 / 512.0;
                        let [more, less] = [STEP, -STEP].map(|step| {
                            let mut moved = geometry.clone();
                            *value(&mut moved, i, k) += step;
                            sum(&moved, &projection, i)
                        });
                        let slope = (more - less) / (2.0 * STEP);
                        assert!(
                            (found - slope).abs() <= 0.02 * size + 0.02,
                            "{i} {k}: {found}, {slope} of {size}"
                        );
                    }
                    compared += 1;
                }
                assert!(compared > 100, "{compared}");
            }
        }
    }
}
