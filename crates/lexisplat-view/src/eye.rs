//! The free camera: orbits a pivot, pans, and flies.

use glam::{DMat3, DVec3};
use lexisplat_render::Camera;

/// Orbiting stops this short of looking straight up or down, in radians.
const POLE: f64 = 0.02;
/// Nearest pivot, as a share of the scene's radius; going nearer pushes it ahead.
const NEAREST: f64 = 0.02;
/// Nearest distance at which a pivot is put ahead of a camera, as a share of the scene's radius.
const SHORTEST: f64 = 0.2;

/// Where most of a scene is, and which way is up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Surroundings {
    pub(crate) centre: DVec3,
    /// World units, above 0.
    pub(crate) radius: f64,
    /// Unit vector.
    pub(crate) up: DVec3,
}

impl Surroundings {
    /// Up as the photographers of `cameras` held them, or world -y, as in scenes trained from COLMAP's
    /// cameras, if they disagree or there are none.
    pub(crate) fn up_of(cameras: &[Camera]) -> DVec3 {
        let sum: DVec3 = cameras.iter().map(|c| -column(c, 1)).sum();
        let count = u32::try_from(cameras.len()).unwrap_or(u32::MAX);
        let mean = sum / f64::from(count.max(1));
        if mean.length() > 0.5 { mean.normalize() } else { DVec3::NEG_Y }
    }
}

/// A camera that moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Eye {
    position: DVec3,
    /// Right, down and forward in the world.
    axes: DMat3,
    /// Distance of the pivot ahead, in world units.
    distance: f64,
    /// Focal length in units of the picture's shorter side.
    focal: f64,
    around: Surroundings,
}

impl Eye {
    /// Where `camera` stands, with the pivot ahead of it as far as the scene's centre is.
    pub(crate) fn at(camera: &Camera, around: Surroundings) -> Self {
        let position = DVec3::from_array(camera.position.map(f64::from));
        let axes = DMat3::from_cols(column(camera, 0), column(camera, 1), column(camera, 2));
        let ahead = (around.centre - position).dot(axes.z_axis);
        let short = f64::from(camera.width.min(camera.height).max(1));
        Self {
            position,
            axes,
            distance: ahead.max(SHORTEST * around.radius),
            focal: f64::from(camera.fy) / short,
            around,
        }
    }

    fn pivot(&self) -> DVec3 {
        self.position + self.axes.z_axis * self.distance
    }

    fn turn(&mut self, axis: DVec3, angle: f64) {
        let turned = DMat3::from_axis_angle(axis, angle) * self.axes;
        // Straighten what rounding has bent; a mirrored camera stays mirrored.
        let forward = turned.z_axis.normalize();
        let down = (turned.y_axis - forward * forward.dot(turned.y_axis)).normalize();
        let right = down.cross(forward);
        let right = if right.dot(turned.x_axis) < 0.0 { -right } else { right };
        self.axes = DMat3::from_cols(right, down, forward);
    }

    /// `pitch` as far as it goes without turning over the pole.
    fn short_of_the_pole(&self, pitch: f64) -> f64 {
        let most = std::f64::consts::FRAC_PI_2 - POLE;
        let elevation = (-self.axes.z_axis.dot(self.around.up)).clamp(-1.0, 1.0).asin();
        // A camera that is already beyond may come back but go no further.
        (elevation + pitch).clamp(elevation.min(-most), elevation.max(most)) - elevation
    }

    /// Turns the scene around the pivot as a mouse does that drags it: to the right and down, in radians.
    pub(crate) fn orbit(&mut self, right: f64, down: f64) {
        let pivot = self.pivot();
        self.look(right, down);
        self.position = pivot - self.axes.z_axis * self.distance;
    }

    /// Turns the head to the right and down, in radians.
    pub(crate) fn look(&mut self, right: f64, down: f64) {
        let down = self.short_of_the_pole(down);
        self.turn(self.around.up, -right);
        self.turn(self.axes.y_axis.cross(self.axes.z_axis), -down);
    }

    /// Drags the scene at the pivot to the right and down, in shorter sides of the picture.
    pub(crate) fn pan(&mut self, right: f64, down: f64) {
        let scale = self.distance / self.focal;
        self.position -= (self.axes.x_axis * right + self.axes.y_axis * down) * scale;
    }

    /// Goes nearer to the pivot until `factor` of the distance is left, or away from it.
    pub(crate) fn dolly(&mut self, factor: f64) {
        let step = self.distance * (1.0 - factor);
        self.position += self.axes.z_axis * step;
        self.distance = (self.distance - step).max(NEAREST * self.around.radius);
    }

    /// Flies `step` scene radii right, up and forward; up is the world's.
    pub(crate) fn fly(&mut self, step: DVec3) {
        let along = self.axes.x_axis * step.x + self.around.up * step.y + self.axes.z_axis * step.z;
        self.position += along * self.around.radius;
    }

    /// What it sees in a picture of `width * height` pixels.
    pub(crate) fn camera(&self, width: u32, height: u32) -> Camera {
        let focal = single(self.focal * f64::from(width.min(height)));
        let rows = self.axes.transpose().to_cols_array_2d();
        Camera {
            name: "free".to_owned(),
            width,
            height,
            fx: focal,
            fy: focal,
            position: self.position.to_array().map(single),
            rotation: std::array::from_fn(|row| std::array::from_fn(|k| single(rows[row][k]))),
            split: None,
        }
    }
}

/// Column `k` of the camera's rotation: right, down or forward.
fn column(camera: &Camera, k: usize) -> DVec3 {
    DVec3::from_array(camera.rotation.map(|row| f64::from(row[k]))).normalize_or_zero()
}

/// `camera` with a picture of exactly this size, which has about its aspect.
pub(crate) fn resized(camera: &Camera, width: u32, height: u32) -> Camera {
    let ratio = |new: u32, old: u32| f64::from(new) / f64::from(old.max(1));
    Camera {
        width,
        height,
        fx: single(f64::from(camera.fx) * ratio(width, camera.width)),
        fy: single(f64::from(camera.fy) * ratio(height, camera.height)),
        ..camera.clone()
    }
}

/// The largest size of `aspect` (width over height) within `width * height` pixels.
pub(crate) fn fitted(aspect: f64, width: u32, height: u32) -> (u32, u32) {
    let whole = |v: f64, most: u32| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within 1 and most")]
        let v = v.round().clamp(1.0, f64::from(most.max(1))) as u32;
        v
    };
    let by_height = f64::from(height) * aspect;
    if by_height <= f64::from(width) {
        (whole(by_height, width), height.max(1))
    } else {
        (width.max(1), whole(f64::from(width) / aspect, height))
    }
}

#[expect(clippy::cast_possible_truncation, reason = "cameras are f32 by design")]
fn single(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    const AROUND: Surroundings = Surroundings { centre: DVec3::ZERO, radius: 2.0, up: DVec3::NEG_Y };

    /// At z = -5, looking along z at the origin; y is down.
    fn eye() -> Eye {
        let camera = Camera {
            name: String::new(),
            width: 300,
            height: 200,
            fx: 250.0,
            fy: 250.0,
            position: [0.0, 0.0, -5.0],
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            split: None,
        };
        Eye::at(&camera, AROUND)
    }

    fn near(a: DVec3, b: [f64; 3]) -> bool {
        (a - DVec3::from_array(b)).length() < 1e-6
    }

    #[test]
    fn the_picture_is_the_cameras_own() {
        let camera = eye().camera(300, 200);
        camera.validate().unwrap();
        assert_eq!((camera.fx, camera.fy), (250.0, 250.0));
        assert_eq!((camera.position, camera.rotation[1]), ([0.0, 0.0, -5.0], [0.0, 1.0, 0.0]));
        // A narrow one shows as much in its width.
        assert!((eye().camera(100, 200).fx - 125.0).abs() < 1e-4);
    }

    #[test]
    fn orbiting_keeps_the_pivot_and_follows_the_mouse() {
        let mut eye = eye();
        eye.orbit(std::f64::consts::FRAC_PI_2, 0.0);
        // The front of the scene goes right, so we go left.
        assert!(near(eye.position, [-5.0, 0.0, 0.0]), "{eye:?}");
        assert!(near(eye.axes.z_axis, [1.0, 0.0, 0.0]));
        eye.orbit(0.0, 0.5);
        assert!(eye.position.y < -1.0, "dragged down, we go up: {eye:?}");
        assert!(near(eye.pivot(), [0.0; 3]));
        for _ in 0..1000 {
            eye.orbit(0.3, 0.2);
            eye.camera(64, 64).validate().unwrap();
        }
        let forward = eye.axes.z_axis;
        assert!(forward.y > 0.99 && forward.y < 1.0, "stops short of the pole: {forward}");
        assert!(eye.axes.y_axis.dot(AROUND.up) < 0.0, "still upright");
        assert!(near(eye.pivot(), [0.0; 3]));
    }

    #[test]
    fn a_camera_beyond_the_pole_may_come_back() {
        let mut eye = eye();
        eye.turn(DVec3::X, -1.56);
        let before = eye.axes.z_axis.y;
        eye.orbit(0.0, 0.3);
        assert!((eye.axes.z_axis.y - before).abs() < 1e-3, "no further");
        eye.orbit(0.0, -0.3);
        assert!(eye.axes.z_axis.y < before - 0.02, "{}", eye.axes.z_axis.y);
    }

    #[test]
    fn panning_drags_what_is_at_the_pivot_along() {
        let mut eye = eye();
        eye.pan(0.1, -0.2);
        let [x, y, z] = eye.camera(300, 200).to_view([0.0; 3]).map(f64::from);
        let short = 200.0;
        assert!((250.0 * x / z - 0.1 * short).abs() < 1e-3 && (250.0 * y / z + 0.2 * short).abs() < 1e-3);
    }

    #[test]
    fn looking_stays_in_place() {
        let mut eye = eye();
        eye.look(0.2, 0.1);
        assert!(near(eye.position, [0.0, 0.0, -5.0]));
        assert!(eye.axes.z_axis.x > 0.1 && eye.axes.z_axis.y > 0.05, "{eye:?}");
    }

    #[test]
    fn dollying_never_passes_but_pushes_the_pivot() {
        let mut eye = eye();
        eye.dolly(0.5);
        assert!(near(eye.position, [0.0, 0.0, -2.5]) && near(eye.pivot(), [0.0; 3]));
        for _ in 0..60 {
            eye.dolly(0.5);
        }
        assert!(eye.distance > 0.01 && eye.position.z > 0.0);
        eye.dolly(2.0);
        assert!(eye.distance > 0.05);
    }

    #[test]
    fn flying_goes_by_scene_radii() {
        let mut eye = eye();
        eye.fly(DVec3::new(0.5, 1.0, 0.25));
        assert!(near(eye.position, [1.0, -2.0, -4.5]), "{eye:?}");
    }

    #[test]
    fn up_is_what_the_photographers_say() {
        let camera = eye().camera(10, 10);
        assert_eq!(Surroundings::up_of(&[]), DVec3::NEG_Y);
        let tilted = Camera { rotation: [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]], ..camera };
        assert!(near(Surroundings::up_of(std::slice::from_ref(&tilted)), [0.0, 0.0, 1.0]));
        let other =
            Camera { rotation: [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]], ..tilted.clone() };
        assert_eq!(Surroundings::up_of(&[tilted, other]), DVec3::NEG_Y);
    }

    #[test]
    fn sizes_fit() {
        assert_eq!(fitted(1.5, 900, 900), (900, 600));
        assert_eq!(fitted(1.5, 900, 300), (450, 300));
        assert_eq!(fitted(1000.0, 100, 100), (100, 1));
        assert_eq!(fitted(1.5, 0, 0), (1, 1));
    }
}
