//! Projects Gaussians in the world to ellipses on screen.

use lexisplat::Geometry;

use crate::camera::Camera;
use crate::conventions::{
    ALPHA_MIN, ANTIALIAS_FLOOR, DILATION, EIGEN_FLOOR, NEAR_Z, POWER_SLACK, QUATERNION_FLOOR, RADIUS_SIGMAS,
    TAN_LIMIT, W_EPSILON,
};
use crate::parallel::*;
use crate::radiance::Radiance;

use super::grid::{Grid, Rect};
use super::math::{exp, sigmoid};

/// Gaussians that one task projects.
const GAUSSIANS_PER_TASK: usize = 1024;

/// Bound on the relative rounding error of each term of a power, and of the distances in it. It is 16 units in
/// the last place; at most six roundings happen.
const TERM_ERROR: f64 = 1e-6;

/// A Gaussian on screen.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Splat {
    /// Centre in pixels; pixel centres are integers.
    pub(super) centre: [f32; 2],
    /// Inverse covariance in 1 / square pixels: xx, xy, yy.
    pub(super) conic: [f32; 3],
    /// Opacity at the centre, 0 to 1.
    pub(super) opacity: f32,
    /// Colour towards the camera, not below 0.
    pub(super) colour: [f32; 3],
    /// Powers below this give an opacity below [`ALPHA_MIN`] for sure.
    pub(super) cutoff: f32,
    /// The first column of pixels that it may touch, and the first right of all that it may touch; the same of rows.
    pub(super) pixels: [[u16; 2]; 2],
}

/// A splat with what sorting and tiling need.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Visible {
    pub(super) splat: Splat,
    /// Bits of the view-space z. It is positive, so the bits are in the order of the numbers.
    pub(super) depth: u32,
    /// Tiles that it may touch.
    pub(super) rect: Rect,
    /// Its index in the scene.
    pub(super) gaussian: u32,
}

/// The values that all Gaussians of a picture are projected with.
#[derive(Debug, Clone)]
pub(crate) struct Projection {
    pub(super) camera: Camera,
    tan: [f32; 2],
    focal: [f32; 2],
    size: [f32; 2],
    pub(super) grid: Grid,
    antialiased: bool,
    /// Whether to leave out what cannot reach [`ALPHA_MIN`]. It makes no difference to the picture; tests check
    /// that by drawing without it.
    tighten: bool,
}

/// A [`Splat::cutoff`] that leaves nothing out: far below any that could matter, and within the range of `exp`.
const NO_CUTOFF: f32 = -80.0;

impl Projection {
    pub(crate) fn new(camera: &Camera, antialiased: bool) -> Self {
        let grid = Grid::new(camera.width as usize, camera.height as usize);
        // Sides are at most 16384: exact.
        #[expect(clippy::cast_precision_loss, reason = "sides are far below 2^24")]
        let size = [camera.width as f32, camera.height as f32];
        let focal = [camera.fx, camera.fy];
        let tan = [size[0] / (2.0 * focal[0]), size[1] / (2.0 * focal[1])];
        Self { camera: camera.clone(), tan, focal, size, grid, antialiased, tighten: true }
    }

    /// This projection, without leaving anything out.
    #[cfg(test)]
    pub(super) fn untightened(self) -> Self {
        Self { tighten: false, ..self }
    }

    /// Projects Gaussian `i`; `None` if none of it is visible.
    fn project(&self, geometry: &Geometry, radiance: &Radiance<'_>, i: usize) -> Option<Visible> {
        let position = geometry.positions[i];
        let view = self.camera.to_view(position);
        let z = view[2];
        if z.is_nan() || z <= NEAR_Z {
            return None;
        }
        let centre: [f32; 2] = std::array::from_fn(|k| {
            let ndc = view[k] / self.tan[k] * (1.0 / (z + W_EPSILON));
            ((ndc + 1.0) * self.size[k] - 1.0) * 0.5
        });
        let axes = axes(geometry.scales[i], geometry.rotations[i]);
        let Ellipse { conic, radius, shrink, .. } = self.ellipse(&self.on_screen(view, &axes))?;
        let mut opacity = sigmoid(geometry.opacities[i]);
        if self.antialiased {
            opacity *= shrink;
        }
        let finite = centre.iter().chain(&conic).all(|v| v.is_finite()) && opacity.is_finite();
        if !finite || opacity < ALPHA_MIN {
            return None;
        }
        let cutoff = libm::logf(ALPHA_MIN / opacity) - POWER_SLACK;
        let rect = self.grid.rect(centre, radius)?;
        let (cutoff, extent) = match self.tighten {
            true => (cutoff, self.extent(centre, conic, cutoff)),
            false => (NO_CUTOFF, [f64::INFINITY; 2]),
        };
        let rect = rect.intersect(self.grid.touched(centre, extent))?;
        let pixels = self.grid.pixels(rect, centre, extent)?;
        let offset: [f32; 3] = std::array::from_fn(|k| position[k] - self.camera.position[k]);
        let length = offset.iter().map(|v| v * v).sum::<f32>().sqrt();
        let colour = radiance.colour(i, offset.map(|v| v / length));
        if !colour.iter().all(|v| v.is_finite()) {
            return None;
        }
        let splat = Splat { centre, conic, opacity, colour, cutoff, pixels };
        // Gaussians are counted in u32 since `order`.
        let gaussian = u32::try_from(i).unwrap_or(u32::MAX);
        Some(Visible { splat, depth: z.to_bits(), rect, gaussian })
    }

    /// Returns the root of the conic of Gaussian `i` on screen, if it has one.
    pub(super) fn root(&self, geometry: &Geometry, i: usize) -> Option<Root> {
        let view = self.camera.to_view(geometry.positions[i]);
        let on_screen = self.on_screen(view, &axes(geometry.scales[i], geometry.rotations[i]));
        self.ellipse(&on_screen).map(|ellipse| ellipse.root())
    }

    /// Returns the derivatives that carry changes of Gaussian `i` on screen over to the world; `None` if it has no
    /// ellipse on screen.
    pub(super) fn derivatives(&self, geometry: &Geometry, i: usize) -> Option<Derivatives> {
        let view = self.camera.to_view(geometry.positions[i]);
        let [x, y, z] = view;
        let r = &self.camera.rotation;
        let by_position: [[f32; 2]; 3] = std::array::from_fn(|k| {
            [
                self.focal[0] * (r[k][0] * z - r[k][2] * x) / (z * z),
                self.focal[1] * (r[k][1] * z - r[k][2] * y) / (z * z),
            ]
        });
        let on_screen = self.on_screen(view, &axes(geometry.scales[i], geometry.rotations[i]));
        let root = self.ellipse(&on_screen)?.root();
        Some(Derivatives {
            by_position: by_position.map(|v| root.of(v)),
            axes: on_screen.map(|v| root.of(v)),
        })
    }

    /// Returns the axis of each standard deviation on screen, by the linear approximation at `view`.
    #[inline]
    fn on_screen(&self, view: [f32; 3], axes: &[[f32; 3]; 3]) -> [[f32; 2]; 3] {
        let z = view[2];
        let [tx, ty]: [f32; 2] = std::array::from_fn(|k| {
            let limit = TAN_LIMIT * self.tan[k];
            (view[k] / z).clamp(-limit, limit) * z
        });
        let jacobian = [
            [self.focal[0] / z, 0.0, -(self.focal[0] * tx) / (z * z)],
            [0.0, self.focal[1] / z, -(self.focal[1] * ty) / (z * z)],
        ];
        let r = &self.camera.rotation;
        std::array::from_fn(|a| {
            let axis = axes[a];
            let seen: [f32; 3] =
                std::array::from_fn(|k| r[0][k] * axis[0] + r[1][k] * axis[1] + r[2][k] * axis[2]);
            [
                jacobian[0][0] * seen[0] + jacobian[0][2] * seen[2],
                jacobian[1][1] * seen[1] + jacobian[1][2] * seen[2],
            ]
        })
    }

    /// Returns the dilated ellipse of a Gaussian with these axes on screen.
    fn ellipse(&self, on_screen: &[[f32; 2]; 3]) -> Option<Ellipse> {
        // The covariance is the sum of the squares of the axes on screen. INRIA projects the covariance of the
        // world instead. That is the same sum, but loses thin Gaussians to cancellation.
        let sum = |f: fn([f32; 2]) -> f32| f(on_screen[0]) + f(on_screen[1]) + f(on_screen[2]);
        let (a, b, c) = (sum(|v| v[0] * v[0]), sum(|v| v[0] * v[1]), sum(|v| v[1] * v[1]));
        // The determinant is a sum of squares (Cauchy-Binet), so it is never negative.
        let cross = |p: [f32; 2], q: [f32; 2]| {
            let w = p[0] * q[1] - p[1] * q[0];
            w * w
        };
        let before = cross(on_screen[0], on_screen[1])
            + cross(on_screen[1], on_screen[2])
            + cross(on_screen[2], on_screen[0]);
        let det = before + DILATION * (a + c) + DILATION * DILATION;
        if det == 0.0 || !det.is_finite() {
            return None;
        }
        let (a, c) = (a + DILATION, c + DILATION);
        let mid = 0.5 * (a + c);
        let half = 0.5 * (a - c);
        let spread = (half * half + b * b).max(EIGEN_FLOOR).sqrt();
        let radius = (RADIUS_SIGMAS * (mid + spread).sqrt()).ceil();
        let shrink = (before / det).max(ANTIALIAS_FLOOR).sqrt();
        Some(Ellipse { conic: [c / det, -b / det, a / det], variance_y: c, radius, shrink })
    }

    /// Returns the distances from the centre in x and y, in pixels, beyond which no power, as `blend` computes it,
    /// reaches `cutoff`. They are infinite where there is no such bound.
    fn extent(&self, centre: [f32; 2], conic: [f32; 3], cutoff: f32) -> [f64; 2] {
        let [a, b, c] = conic.map(f64::from);
        // The largest distance of a pixel, where terms, and with them rounding errors, are largest.
        let far: [f64; 2] = std::array::from_fn(|k| {
            let (centre, size) = (f64::from(centre[k]), f64::from(self.size[k]));
            centre.abs().max((size - 1.0 - centre).abs())
        });
        let terms = 0.5 * (a * far[0] * far[0] + c * far[1] * far[1]) + (b * far[0] * far[1]).abs();
        // Pixels that count satisfy a dx^2 + 2 b dx dy + c dy^2 <= level.
        let level = 2.0 * (-f64::from(cutoff) + TERM_ERROR * terms).max(0.0);
        let det = a * c - b * b;
        // A determinant that is lost to rounding gives no bound.
        if det.is_nan() || det <= TERM_ERROR * a * c || a <= 0.0 {
            return [f64::INFINITY; 2];
        }
        let reach = |diagonal: f64| (level * diagonal / det).sqrt() * (1.0 + TERM_ERROR) + TERM_ERROR;
        [reach(c), reach(a)]
    }
}

/// How a Gaussian on screen changes with its values in the world, in the coordinates of its [`Root`].
pub(super) struct Derivatives {
    /// The change of the centre with each world coordinate.
    pub(super) by_position: [[f32; 2]; 3],
    /// The three standard deviations as vectors.
    pub(super) axes: [[f32; 2]; 3],
}

/// The upper triangular root R of a conic, `R^T R`: xx, xy, yy. `R (centre - pixel)` is the offset in standard
/// deviations, so that products of it neither grow with a Gaussian's size nor cancel in thin ones.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Root(pub(super) [f32; 3]);

impl Root {
    /// `R v`.
    #[inline]
    pub(super) fn of(&self, v: [f32; 2]) -> [f32; 2] {
        let [xx, xy, yy] = self.0;
        [xx * v[0] + xy * v[1], yy * v[1]]
    }
}

struct Ellipse {
    conic: [f32; 3],
    /// The yy of the dilated covariance, in square pixels.
    variance_y: f32,
    /// In pixels, a whole number.
    radius: f32,
    /// Factor of the opacity in anti-aliased scenes.
    shrink: f32,
}

impl Ellipse {
    fn root(&self) -> Root {
        let [xx, xy, _] = self.conic;
        let root = xx.sqrt();
        // The last element squared is the determinant over xx. The variance gives it without cancellation.
        Root([root, xy / root, 1.0 / self.variance_y.sqrt()])
    }
}

/// Returns the three standard deviations as vectors in the world: the columns of rotation * scale.
fn axes(scales: [f32; 3], rotation: [f32; 4]) -> [[f32; 3]; 3] {
    let length = rotation.iter().map(|v| v * v).sum::<f32>().sqrt().max(QUATERNION_FLOOR);
    let [w, x, y, z] = rotation.map(|v| v / length);
    let s = scales.map(exp);
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)].map(|v| v * s[0]),
        [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)].map(|v| v * s[1]),
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)].map(|v| v * s[2]),
    ]
}

/// The Gaussians that may be visible, in order: the first `counts[k]` of each [`GAUSSIANS_PER_TASK`] slots.
pub(super) struct Projected {
    /// One allocation for all. Many small ones from many threads would not be returned to the system.
    slots: Vec<Visible>,
    counts: Vec<usize>,
}

impl Projected {
    /// Returns the splats alone, in order.
    pub(super) fn into_splats(self) -> Vec<Visible> {
        let Self { mut slots, counts } = self;
        let mut len = 0;
        for (piece, count) in counts.into_iter().enumerate() {
            let first = piece * GAUSSIANS_PER_TASK;
            slots.copy_within(first..first + count, len);
            len += count;
        }
        slots.truncate(len);
        slots
    }
}

/// Projects all Gaussians.
pub(super) fn project(geometry: &Geometry, radiance: &Radiance<'_>, projection: &Projection) -> Projected {
    let mut slots = vec![Visible::default(); geometry.len()];
    let counts = slots
        .par_chunks_mut(GAUSSIANS_PER_TASK)
        .enumerate()
        .map(|(chunk, slots)| {
            let first = chunk * GAUSSIANS_PER_TASK;
            let range = first..first + slots.len();
            let seen = range.filter_map(|i| projection.project(geometry, radiance, i));
            // There are as many slots as Gaussians, so the slots never run out first.
            slots.iter_mut().zip(seen).map(|(slot, splat)| *slot = splat).count()
        })
        .collect();
    Projected { slots, counts }
}

#[cfg(test)]
mod tests {
    use lexisplat::{SceneMeta, ShDegree, Splats};

    use super::*;
    use crate::camera::straight_ahead;
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

    fn draw(splats: &Splats, antialiased: bool) -> Option<Visible> {
        let camera = straight_ahead(100, 80, 100.0);
        let projection = Projection::new(&camera, antialiased);
        projection.project(&splats.geometry, &Radiance::new(&Scene::from(splats)), 0)
    }

    fn near(a: f32, b: f32) -> bool {
        (a - b).abs() < 1e-4 * b.abs().max(1.0)
    }

    #[test]
    fn a_point_lands_where_ndc2pix_puts_it() {
        let visible = draw(&one([0.5, -0.25, 2.0], -20.0), false).unwrap();
        let splat = visible.splat;
        assert!(near(splat.centre[0], 49.5 + 25.0) && near(splat.centre[1], 39.5 - 12.5), "{splat:?}");
        // A point is the dilation alone.
        assert!(splat.conic.iter().zip([1.0 / 0.3, 0.0, 1.0 / 0.3]).all(|(a, b)| near(*a, b)), "{splat:?}");
        assert!(near(splat.opacity, 0.5));
        assert!(near(splat.colour[0], 0.782_094_8) && near(splat.colour[1], 0.5) && splat.colour[2] == 0.0);
        assert_eq!(visible.depth, 2.0_f32.to_bits());
    }

    #[test]
    fn a_sphere_on_the_axis_has_the_variance_of_similar_triangles() {
        // Deviation e^-1 at distance 4 with focal length 100.
        let splat = draw(&one([0.0, 0.0, 4.0], -1.0), false).unwrap().splat;
        let variance = (100.0 * (-1.0_f32).exp() / 4.0).powi(2) + DILATION;
        assert!(near(splat.conic[0] * variance, 1.0) && splat.conic[1] == 0.0, "{splat:?}");
    }

    #[test]
    fn antialiasing_keeps_the_light_of_a_point() {
        let far = draw(&one([0.0, 0.0, 4.0], -20.0), true);
        // The factor's floor is 0.005, and 0.5 * 0.005 is below 1/255.
        assert!(far.is_none());
        let splat = draw(&one([0.0, 0.0, 4.0], -4.0), true).unwrap().splat;
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
