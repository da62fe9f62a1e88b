//! Projects Gaussians in the world to ellipses on screen.
//!
//! All steps work on a group of Gaussians, in short loops without branches that become vector instructions.

use std::ops::Range;

use lexisplat::Geometry;

use crate::camera::Camera;
use crate::conventions::{
    ALPHA_MIN, ANTIALIAS_FLOOR, DILATION, EIGEN_FLOOR, NEAR_Z, POWER_SLACK, QUATERNION_FLOOR, RADIUS_SIGMAS,
    TAN_LIMIT, W_EPSILON,
};

use super::blend::Tile;
use super::clusters::Sphere;
use super::grid::{ChosenTiles, Grid, TILE_F32};
use super::lanes::{LANES, Lanes, each};
use super::math::{exp, ln, sigmoid, whole};
use super::splat::{PixelRect, Root};

/// Bound on the relative rounding error of each term of a power, and of the distances in it. It is 16 units in the last
/// place; at most six roundings happen.
const TERM_ERROR: f32 = 1e-6;
/// Bound on the relative difference between the determinant of a stored conic and the determinant of the inverse
/// covariance, divided by the factor that the determinant loses to cancellation. It is 32 units in the last place; at
/// most 14 roundings happen.
const CONIC_ERROR: f32 = 2e-6;
/// Largest relative error of the determinant for which a bound is computed.
const MAX_CONIC_ERROR: f32 = 0.5;
/// Bound on the relative rounding error of the reach itself: 80 units in the last place.
const REACH_ERROR: f32 = 5e-6;
/// Bound on the rounding of positions in view space, as a share of the distance from the camera.
const VIEW_ERROR: f32 = 1e-5;
/// Factor on lengths in view space, because camera rotations need not be exactly orthonormal.
const VIEW_FACTOR: f32 = 1.02;
/// Pixels by which a Gaussian may reach beyond its centre independently of its size: INRIA's tiles, the dilation, the
/// floor of its eigenvalues, and rounding.
const PIXEL_MARGIN: f32 = TILE_F32 + 6.0;

/// The values by which all Gaussians of a picture are projected.
#[derive(Debug, Clone)]
pub(crate) struct Projection {
    pub(super) camera: Camera,
    pub(super) tan: [f32; 2],
    pub(super) focal: [f32; 2],
    size: [f32; 2],
    /// [`W_EPSILON`], scaled in proportion to the near plane.
    pub(super) w_epsilon: f32,
    pub(super) grid: Grid,
    /// The tiles to draw; `None` draws all.
    pub(super) chosen: Option<ChosenTiles>,
    pub(super) antialiased: bool,
    /// Whether to leave out pixels where a Gaussian cannot reach [`ALPHA_MIN`]. This does not change the picture; tests
    /// compare with pictures drawn without it.
    tighten: bool,
}

/// A cutoff that leaves nothing out. It is far below any cutoff that matters, and within the range of `exp`.
const NO_CUTOFF: f32 = -80.0;

/// Positions and shapes of a group of Gaussians in the world.
#[derive(Debug, Clone, Copy)]
pub(super) struct Body {
    pub(super) position: [Lanes; 3],
    /// Natural logarithms of the standard deviations.
    pub(super) scales: [Lanes; 3],
    /// Quaternion, real part first.
    pub(super) rotation: [Lanes; 4],
    /// Logit of the opacity.
    pub(super) opacity: Lanes,
}

/// A group of Gaussians on screen, without their colours.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placed {
    pub(super) centre: [Lanes; 2],
    pub(super) conic: [Lanes; 3],
    pub(super) opacity: Lanes,
    pub(super) cutoff: Lanes,
    pub(super) variance_y: Lanes,
    /// View-space z.
    pub(super) depth: Lanes,
    /// Unit vectors from the camera to the Gaussians.
    pub(super) direction: [Lanes; 3],
    /// The pixels that the Gaussians may touch: the first column and row, and the first column and row after the last.
    /// There are no pixels if the Gaussian cannot be visible; its other values then have no meaning.
    pub(super) pixels: [[Lanes; 2]; 2],
}

impl Body {
    /// Loads these Gaussians, at most [`LANES`]. The other lanes are zero.
    #[inline(always)]
    pub(super) fn load(geometry: &Geometry, gaussians: Range<usize>) -> Self {
        let mut out = Self {
            position: [[0.0; LANES]; 3],
            scales: [[0.0; LANES]; 3],
            rotation: [[0.0; LANES]; 4],
            opacity: [0.0; LANES],
        };
        columns(&mut out.position, &geometry.positions[gaussians.clone()]);
        columns(&mut out.scales, &geometry.scales[gaussians.clone()]);
        columns(&mut out.rotation, &geometry.rotations[gaussians.clone()]);
        for (to, from) in out.opacity.iter_mut().zip(&geometry.opacities[gaussians]) {
            *to = *from;
        }
        out
    }
}

/// Transposes rows into columns of lanes.
#[inline(always)]
fn columns<const N: usize>(columns: &mut [Lanes; N], rows: &[[f32; N]]) {
    for (lane, row) in rows.iter().enumerate().take(LANES) {
        for k in 0..N {
            columns[k][lane] = row[k];
        }
    }
}

impl Projection {
    pub(crate) fn new(camera: &Camera, antialiased: bool) -> Self {
        let grid = Grid::new(camera.width as usize, camera.height as usize);
        // Sides are at most 16384, so the conversion is exact.
        #[expect(clippy::cast_precision_loss, reason = "sides are far below 2^24")]
        let size = [camera.width as f32, camera.height as f32];
        let focal = [camera.fx, camera.fy];
        let tan = [size[0] / (2.0 * focal[0]), size[1] / (2.0 * focal[1])];
        let w_epsilon = W_EPSILON * (camera.near / NEAR_Z);
        let chosen = camera.tiles.as_ref().map(|set| ChosenTiles::new(grid, set));
        let camera = camera.clone();
        Self { camera, tan, focal, size, w_epsilon, grid, chosen, antialiased, tighten: true }
    }

    /// Returns the colour behind the scene in pictures that are drawn without options.
    pub(super) fn background(&self) -> [f32; 3] {
        self.camera.background.unwrap_or_default()
    }

    /// Returns the width and height of the picture, in pixels.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.camera.width as usize, self.camera.height as usize]
    }

    /// Returns the number of pixels of the whole picture, and the number of drawn pixels.
    #[expect(clippy::cast_precision_loss, reason = "counts of pixels, to single precision")]
    pub(super) fn pixel_counts(&self) -> [f32; 2] {
        let whole = self.size[0] * self.size[1];
        [whole, self.camera.tiles.as_ref().map_or(whole, |set| set.pixels() as f32)]
    }

    /// Returns the drawn tiles in the rows of `band`: their numbers within the band, and their places in the picture.
    pub(super) fn tiles(&self, band: &Range<usize>) -> Vec<(usize, Tile)> {
        let (grid, size) = (self.grid, self.size());
        let at = |tile: usize| Tile::new([tile % grid.columns, tile / grid.columns], size);
        let first = band.start * grid.columns;
        let within = first..band.end * grid.columns;
        match &self.camera.tiles {
            None => within.map(|tile| (tile - first, at(tile))).collect(),
            Some(set) => {
                let numbered = set.tiles().iter().map(|&tile| tile as usize).enumerate();
                let own = numbered.filter(|(_, tile)| within.contains(tile));
                own.map(|(number, tile)| (tile - first, at(tile).of_set(number))).collect()
            }
        }
    }

    /// Returns this projection with `tighten` off.
    #[cfg(test)]
    pub(super) fn untightened(self) -> Self {
        Self { tighten: false, ..self }
    }

    /// Returns whether a Gaussian with its centre in `sphere`, and a scale that is not larger than the sphere's, may
    /// touch a drawn pixel. `false` is certain.
    pub(super) fn may_see(&self, sphere: &Sphere) -> bool {
        let view = self.camera.to_view(sphere.centre);
        let length = (view[0] * view[0] + view[1] * view[1] + view[2] * view[2]).sqrt();
        let radius = VIEW_FACTOR * sphere.radius + VIEW_ERROR * length;
        let z = view[2];
        if z + radius <= self.camera.near {
            return false;
        }
        // INRIA's radius is [`RADIUS_SIGMAS`] standard deviations of an ellipse. The variances of that ellipse add up to
        // at most the square of `stretch * scale / depth`. The margin is added.
        let limits = self.tan.map(|tan| 1.0 + (TAN_LIMIT * tan).powi(2));
        let stretch = (self.focal[0].powi(2) * limits[0] + self.focal[1].powi(2) * limits[1]).sqrt();
        let reach = VIEW_FACTOR * RADIUS_SIGMAS * stretch * sphere.scale;
        // A centre at x in view space is `reach / z + PIXEL_MARGIN` pixels outside of the picture where
        // `x > tangent * z + beside`.
        let is_outside = |k: usize| {
            let tangent = self.tan[k] + PIXEL_MARGIN / self.focal[k];
            let beside = reach / self.focal[k];
            view[k].abs() - tangent * z > beside + radius * (1.0 + tangent * tangent).sqrt()
        };
        if is_outside(0) | is_outside(1) {
            return false;
        }
        let nearest = z - radius;
        let Some(chosen) = self.chosen.as_ref().filter(|_| nearest > self.camera.near) else { return true };
        // The pixels where centres may lie, extended by the reach of a Gaussian.
        let around = reach / nearest + PIXEL_MARGIN;
        let pixels = |k: usize| {
            let [low, high] = [view[k] - radius, view[k] + radius];
            let low = if low < 0.0 { low / nearest } else { low / (z + radius) };
            let high = if high > 0.0 { high / nearest } else { high / (z + radius) };
            let middle = 0.5 * self.size[k];
            [middle + self.focal[k] * low - around, middle + self.focal[k] * high + around]
        };
        let [columns, rows] = [pixels(0), pixels(1)];
        let corner = |places: [f32; 2]| -> [u16; 2] {
            std::array::from_fn(|k| whole(greater(lesser(places[k], self.size[k]), 0.0)))
        };
        let rect = PixelRect {
            min: corner([columns[0].floor(), rows[0].floor()]),
            max: corner([columns[1].ceil(), rows[1].ceil()]),
        };
        chosen.within(rect).is_some()
    }

    /// Projects a group of Gaussians.
    #[inline(always)]
    pub(super) fn place(&self, body: &Body) -> Placed {
        let view = self.view(body);
        let [x, y, z] = &view;
        let centre = each([x, y, z], |[x, y, z]| {
            let near = 1.0 / (z + self.w_epsilon);
            let pixel = |k: usize, v: f32| ((v / self.tan[k] * near + 1.0) * self.size[k] - 1.0) * 0.5;
            [pixel(0, x), pixel(1, y)]
        });
        let ellipse = Ellipse::of(&self.on_screen(&view, &axes(body)));
        let [opacity, cutoff] = each([&body.opacity, &ellipse.shrink], |[logit, shrink]| {
            let opacity = sigmoid(logit) * if self.antialiased { shrink } else { 1.0 };
            [opacity, ln(ALPHA_MIN / opacity) - POWER_SLACK]
        });
        let mut pixels = self.pixels(&centre, &ellipse, &cutoff);
        let [a, b, c] = &ellipse.conic;
        let [visible] = each([z, &centre[0], &centre[1], a, b, c, &ellipse.det, &opacity], |values| {
            let [z, x, y, a, b, c, det, opacity] = values;
            let finite = is_finite(x) & is_finite(y) & is_finite(a) & is_finite(b) & is_finite(c);
            let drawn = (z > self.camera.near) & is_ellipse(det) & finite & (opacity >= ALPHA_MIN);
            [if drawn & is_finite(opacity) { 1.0 } else { 0.0 }]
        });
        // A Gaussian that is not drawn has pixels that end where they begin.
        let [_, ends] = &mut pixels;
        for end in ends {
            [*end] = each([&*end, &visible], |[end, visible]| [if visible > 0.0 { end } else { 0.0 }]);
        }
        let [px, py, pz] = &body.position;
        let direction = each([px, py, pz], |position| {
            let offset = |k: usize| position[k] - self.camera.position[k];
            let (x, y, z) = (offset(0), offset(1), offset(2));
            let length = (x * x + y * y + z * z).sqrt();
            [x / length, y / length, z / length]
        });
        let Ellipse { conic, variance: [_, variance_y], .. } = ellipse;
        let cutoff = if self.tighten { cutoff } else { [NO_CUTOFF; LANES] };
        Placed { centre, conic, opacity, cutoff, variance_y, depth: *z, direction, pixels }
    }

    /// Returns the derivatives that carry changes of a group of Gaussians on screen over to the world. They are not
    /// finite if a Gaussian has no ellipse on screen.
    #[inline(always)]
    pub(super) fn derivatives(&self, body: &Body) -> Derivatives {
        let view = self.view(body);
        let on_screen = self.on_screen(&view, &axes(body));
        let ellipse = Ellipse::of(&on_screen);
        let root =
            each([&ellipse.conic[0], &ellipse.conic[1], &ellipse.variance[1], &ellipse.det], |values| {
                let [xx, xy, variance_y, det] = values;
                let Root(root) = Root::of_conic([xx, xy, 0.0], variance_y);
                root.map(|v| if is_ellipse(det) { v } else { f32::NAN })
            });
        let [x, y, z] = &self.camera.rotation;
        Derivatives {
            by_position: [
                rooted(&root, &self.moved(&view, x)),
                rooted(&root, &self.moved(&view, y)),
                rooted(&root, &self.moved(&view, z)),
            ],
            axes: [rooted(&root, &on_screen[0]), rooted(&root, &on_screen[1]), rooted(&root, &on_screen[2])],
        }
    }

    /// Returns how far Gaussians at `view` move on screen for each unit of a move along a world axis. The components of
    /// the axis in view space are given.
    #[inline(always)]
    fn moved(&self, view: &[Lanes; 3], [right, down, forward]: &[f32; 3]) -> [Lanes; 2] {
        let [x, y, z] = view;
        each([x, y, z], |[x, y, z]| {
            [
                self.focal[0] * (right * z - forward * x) / (z * z),
                self.focal[1] * (down * z - forward * y) / (z * z),
            ]
        })
    }

    /// Returns the positions in view space.
    #[inline(always)]
    fn view(&self, body: &Body) -> [Lanes; 3] {
        let [x, y, z] = &body.position;
        each([x, y, z], |position| self.camera.to_view(position))
    }

    /// Returns the axis of each standard deviation on screen, by the linear approximation at `view`.
    #[inline(always)]
    fn on_screen(&self, view: &[Lanes; 3], axes: &[[Lanes; 3]; 3]) -> [[Lanes; 2]; 3] {
        let limits = self.tan.map(|tan| TAN_LIMIT * tan);
        let [x, y, z] = view;
        // The entries of the Jacobian that are not zero: xx, xz, yy, yz.
        let jacobian = each([x, y, z], |[x, y, z]| {
            let t = |k: usize, v: f32| greater(lesser(v / z, limits[k]), -limits[k]) * z;
            let (tx, ty) = (t(0, x), t(1, y));
            [
                self.focal[0] / z,
                -(self.focal[0] * tx) / (z * z),
                self.focal[1] / z,
                -(self.focal[1] * ty) / (z * z),
            ]
        });
        [self.seen(&jacobian, &axes[0]), self.seen(&jacobian, &axes[1]), self.seen(&jacobian, &axes[2])]
    }

    /// Returns vectors of the world on screen. The first argument has the entries of the Jacobian.
    #[inline(always)]
    fn seen(&self, [xx, xz, yy, yz]: &[Lanes; 4], [x, y, z]: &[Lanes; 3]) -> [Lanes; 2] {
        let r = &self.camera.rotation;
        each([x, y, z, xx, xz, yy, yz], |[x, y, z, xx, xz, yy, yz]| {
            let along = |k: usize| r[0][k] * x + r[1][k] * y + r[2][k] * z;
            [xx * along(0) + xz * along(2), yy * along(1) + yz * along(2)]
        })
    }

    /// Returns the pixels that a Gaussian may touch: the first column and row, and the first column and row after the
    /// last.
    #[inline(always)]
    fn pixels(&self, centre: &[Lanes; 2], ellipse: &Ellipse, cutoff: &Lanes) -> [[Lanes; 2]; 2] {
        let level = self.level(centre, ellipse, cutoff);
        let [x_first, x_end] =
            self.pixels_along(0, &centre[0], &ellipse.variance[0], &level, &ellipse.radius);
        let [y_first, y_end] =
            self.pixels_along(1, &centre[1], &ellipse.variance[1], &level, &ellipse.radius);
        [[x_first, y_first], [x_end, y_end]]
    }

    /// Returns the first column (`axis` 0) or row (`axis` 1) that a Gaussian may touch, and the first after the last.
    #[inline(always)]
    fn pixels_along(
        &self,
        axis: usize,
        centre: &Lanes,
        variance: &Lanes,
        level: &Lanes,
        radius: &Lanes,
    ) -> [Lanes; 2] {
        each([centre, variance, level, radius], |[centre, variance, level, radius]| {
            let reach = (level * variance).sqrt();
            // Sums with the centre are rounded too, hence the larger reach.
            let reach = reach + REACH_ERROR * (reach + centre.abs() + 1.0);
            let reach = if self.tighten { reach } else { f32::INFINITY };
            // INRIA's tiles (`getRect`): the tiles that the square of `radius` overlaps, truncated as in C.
            let first = self.grid.tile(axis, (centre - radius) / TILE_F32);
            let end = self.grid.tile(axis, (centre + radius + (TILE_F32 - 1.0)) / TILE_F32);
            let least = (centre - reach).ceil();
            let most = (centre + reach).floor() + 1.0;
            [greater(least, first * TILE_F32), lesser(lesser(most, end * TILE_F32), self.size[axis])]
        })
    }

    /// Returns a level for each Gaussian. Its product with the variance in x or y bounds the squared distance from the
    /// centre in x or y of all pixels whose power, as computed by `blend`, reaches `cutoff`. The level is infinite if
    /// there is no such bound.
    ///
    /// Apart from rounding, these pixels satisfy `a dx^2 + 2 b dx dy + c dy^2 <= level` with the stored conic.
    #[inline(always)]
    fn level(&self, centre: &[Lanes; 2], ellipse: &Ellipse, cutoff: &Lanes) -> Lanes {
        let [a, b, c] = &ellipse.conic;
        let [x, y] = centre;
        let [terms] = each([a, b, c, x, y], |[a, b, c, x, y]| {
            // The largest distance of a pixel. Terms, and therefore rounding errors, are largest there.
            let far = |k: usize, v: f32| greater(v.abs(), (self.size[k] - 1.0 - v).abs());
            let (x, y) = (far(0, x), far(1, y));
            [0.5 * (a * x * x + c * y * y) + (b * x * y).abs()]
        });
        let [xx, yy] = &ellipse.variance;
        let [level] = each([&terms, cutoff, xx, yy, &ellipse.det], |[terms, cutoff, xx, yy, det]| {
            let level = 2.0 * greater(TERM_ERROR * terms - cutoff, 0.0);
            let error = CONIC_ERROR * (xx * yy / det);
            let bounded = (error < MAX_CONIC_ERROR) & is_finite(level);
            [if bounded { level / (1.0 - error) } else { f32::INFINITY }]
        });
        level
    }
}

/// Returns the larger of two numbers; `b` if `a` is NaN.
#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Returns the smaller of two numbers; `b` if `a` is NaN.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn is_finite(x: f32) -> bool {
    x.abs() < f32::INFINITY
}

/// Returns whether an ellipse with this determinant can be drawn.
#[inline(always)]
fn is_ellipse(det: f32) -> bool {
    (det != 0.0) & is_finite(det)
}

/// Derivatives of a group of Gaussians on screen by their values in the world, in the coordinates of their [`Root`]s.
pub(super) struct Derivatives {
    /// Derivatives of the centre by each world coordinate.
    pub(super) by_position: [[Lanes; 2]; 3],
    /// The three standard deviations as vectors on screen.
    pub(super) axes: [[Lanes; 2]; 3],
}

/// Returns `R v` of each lane. `root` has the entries of the roots `R`.
#[inline(always)]
fn rooted(root: &[Lanes; 3], v: &[Lanes; 2]) -> [Lanes; 2] {
    each([&root[0], &root[1], &root[2], &v[0], &v[1]], |[xx, xy, yy, x, y]| Root([xx, xy, yy]).of([x, y]))
}

/// The dilated ellipses of a group of Gaussians on screen.
struct Ellipse {
    conic: [Lanes; 3],
    /// The diagonal of the covariance, in square pixels.
    variance: [Lanes; 2],
    /// Determinant of the covariance.
    det: Lanes,
    /// Radius in pixels, a whole number.
    radius: Lanes,
    /// Factor of the opacity in anti-aliased scenes.
    shrink: Lanes,
}

impl Ellipse {
    /// Returns the ellipses of Gaussians with these axes on screen.
    #[inline(always)]
    fn of(on_screen: &[[Lanes; 2]; 3]) -> Self {
        // The covariance is the sum of the squares of the axes on screen. INRIA projects the covariance in the world
        // instead. This gives the same sum, but loses thin Gaussians to cancellation.
        let [p, q, r] = on_screen;
        let [a, b, c, before] =
            each([&p[0], &p[1], &q[0], &q[1], &r[0], &r[1]], |[px, py, qx, qy, rx, ry]| {
                // The determinant is a sum of squares (Cauchy-Binet), so it is never negative.
                let (pq, qr, rp) = (px * qy - py * qx, qx * ry - qy * rx, rx * py - ry * px);
                [
                    px * px + qx * qx + rx * rx,
                    px * py + qx * qy + rx * ry,
                    py * py + qy * qy + ry * ry,
                    pq * pq + qr * qr + rp * rp,
                ]
            });
        let [conic_a, conic_b, conic_c, det, shrink] = each([&a, &b, &c, &before], |[a, b, c, before]| {
            let det = before + DILATION * (a + c) + DILATION * DILATION;
            let shrink = greater(before / det, ANTIALIAS_FLOOR).sqrt();
            [(c + DILATION) / det, -b / det, (a + DILATION) / det, det, shrink]
        });
        let [a, c, radius] = each([&a, &b, &c], |[a, b, c]| {
            let (a, c) = (a + DILATION, c + DILATION);
            let (mid, half) = (0.5 * (a + c), 0.5 * (a - c));
            let spread = greater(half * half + b * b, EIGEN_FLOOR).sqrt();
            [a, c, (RADIUS_SIGMAS * (mid + spread).sqrt()).ceil()]
        });
        Self { conic: [conic_a, conic_b, conic_c], variance: [a, c], det, radius, shrink }
    }
}

/// Returns the three standard deviations as vectors in the world: the columns of rotation * scale.
#[inline(always)]
fn axes(body: &Body) -> [[Lanes; 3]; 3] {
    let [w, x, y, z] = &body.rotation;
    let [w, x, y, z] = &each([w, x, y, z], |rotation| {
        let [w, x, y, z] = rotation;
        let length = greater((w * w + x * x + y * y + z * z).sqrt(), QUATERNION_FLOOR);
        rotation.map(|v| v / length)
    });
    let [a, b, c] = &body.scales;
    [
        each([w, x, y, z, a], |[w, x, y, z, s]| {
            let s = exp(s);
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)].map(|v| v * s)
        }),
        each([w, x, y, z, b], |[w, x, y, z, s]| {
            let s = exp(s);
            [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)].map(|v| v * s)
        }),
        each([w, x, y, z, c], |[w, x, y, z, s]| {
            let s = exp(s);
            [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)].map(|v| v * s)
        }),
    ]
}

#[cfg(test)]
mod tests {
    use lexisplat::simd::Simd;
    use lexisplat::{SceneMeta, ShDegree, Splats};

    use super::super::splat::Splat;
    use super::super::visible::{Piece, Visible};
    use super::*;
    use crate::camera::straight_ahead;
    use crate::radiance::Radiance;
    use crate::scene::Scene;

    fn one(position: [f32; 3], scale: f32) -> Splats {
        let geometry = Geometry {
            positions: vec![position],
            dc: vec![[1.0, 0.0, -3.0]],
            opacities: vec![0.0],
            scales: vec![[scale; 3]],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]],
            ..Geometry::default()
        };
        Splats { geometry, degree: ShDegree::ZERO, sh_rest: Vec::new(), meta: SceneMeta::default() }
    }

    fn draw(splats: &Splats, antialiased: bool) -> Option<(Splat, u32)> {
        let camera = straight_ahead(100, 80, 100.0);
        let projection = Projection::new(&camera, antialiased);
        let (mut visible, mut keys) = (Visible::default(), Vec::new());
        let radiance = Radiance::new(&Scene::from(splats));
        let piece = Piece { geometry: &splats.geometry, clusters: None, radiance: &radiance };
        visible.project(&mut keys, Simd::current(), &[piece], &projection);
        keys.first().map(|&(depth, slot)| (visible.slots[slot as usize], depth))
    }

    fn near(a: f32, b: f32) -> bool {
        (a - b).abs() < 1e-4 * b.abs().max(1.0)
    }

    #[test]
    fn a_point_lands_where_ndc2pix_puts_it() {
        let (splat, depth) = draw(&one([0.5, -0.25, 2.0], -20.0), false).unwrap();
        assert!(near(splat.centre[0], 49.5 + 25.0) && near(splat.centre[1], 39.5 - 12.5), "{splat:?}");
        // A point is the dilation alone.
        assert!(splat.conic.iter().zip([1.0 / 0.3, 0.0, 1.0 / 0.3]).all(|(a, b)| near(*a, b)), "{splat:?}");
        assert!(near(splat.opacity, 0.5));
        assert!(near(splat.colour[0], 0.782_094_8) && near(splat.colour[1], 0.5) && splat.colour[2] == 0.0);
        assert_eq!(depth, 2.0_f32.to_bits());
    }

    #[test]
    fn a_sphere_on_the_axis_has_the_variance_of_similar_triangles() {
        // Deviation e^-1 at distance 4 with focal length 100.
        let (splat, _) = draw(&one([0.0, 0.0, 4.0], -1.0), false).unwrap();
        let variance = (100.0 * (-1.0_f32).exp() / 4.0).powi(2) + DILATION;
        assert!(near(splat.conic[0] * variance, 1.0) && splat.conic[1] == 0.0, "{splat:?}");
    }

    #[test]
    fn antialiasing_keeps_the_light_of_a_point() {
        let far = draw(&one([0.0, 0.0, 4.0], -20.0), true);
        // The factor's floor is 0.005, and 0.5 * 0.005 is below 1/255.
        assert!(far.is_none());
        let (splat, _) = draw(&one([0.0, 0.0, 4.0], -4.0), true).unwrap();
        let variance = (100.0 * (-4.0_f32).exp() / 4.0).powi(2);
        assert!(near(splat.opacity, 0.5 * variance / (variance + DILATION)), "{splat:?}");
    }

    #[test]
    fn what_cannot_be_seen_is_left_out() {
        assert!(draw(&one([0.0, 0.0, 0.2], -3.0), false).is_none(), "at the near limit");
        assert!(draw(&one([0.0, 0.0, 0.201], -3.0), false).is_some());
        assert!(draw(&one([0.0, 0.0, -5.0], 3.0), false).is_none(), "behind");
        assert!(draw(&one([50.0, 0.0, 5.0], -3.0), false).is_none(), "beside");
        assert!(draw(&one([0.0, 0.0, 5.0], 60.0), false).is_none(), "overflows");
        assert!(draw(&one([f32::NAN, 0.0, 5.0], 0.0), false).is_none());
        let mut faint = one([0.0, 0.0, 5.0], 0.0);
        faint.geometry.opacities = vec![-5.6];
        assert!(draw(&faint, false).is_none(), "below 1/255 everywhere");
    }

    #[test]
    fn quaternions_are_normalised_and_zero_is_the_identity() {
        let axes = |scales: [f32; 3], rotation: [f32; 4]| {
            let body = Body {
                position: [[0.0; LANES]; 3],
                scales: scales.map(|v| [v; LANES]),
                rotation: rotation.map(|v| [v; LANES]),
                opacity: [0.0; LANES],
            };
            axes(&body).map(|axis| axis.map(|v| v[LANES - 1]))
        };
        let scales = [0.0, -1.0, -2.0];
        let identity = axes(scales, [1.0, 0.0, 0.0, 0.0]);
        assert_eq!(axes(scales, [0.0; 4]), identity);
        assert_eq!(axes(scales, [7.0, 0.0, 0.0, 0.0]), identity);
        // A quarter turn about z takes x to y and y to -x.
        let turned = axes(scales, [2.0, 0.0, 0.0, 2.0]);
        let expected = [[0.0, 1.0, 0.0], [-(-1.0_f32).exp(), 0.0, 0.0], [0.0, 0.0, (-2.0_f32).exp()]];
        for (axis, expected) in turned.iter().zip(expected) {
            assert!(axis.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{turned:?}");
        }
    }
}
