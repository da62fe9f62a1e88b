//! The free camera, which orbits a pivot, pans and flies.

use glam::{DMat3, DVec3};
use lexisplat_render::{Camera, Pose};

/// Smallest angle between the view direction and the vertical, in radians.
const POLE: f64 = 0.02;
/// Smallest distance of the pivot, in scene radii. If the camera moves nearer, the pivot is moved ahead.
const NEAREST: f64 = 0.02;
/// Smallest distance of the pivot of a new controller, in scene radii.
const SHORTEST: f64 = 0.2;

/// The ball that holds most of a scene, and its upward direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneBounds {
    /// Centre of the ball, in world units.
    pub centre: DVec3,
    /// Radius of the ball, in world units, above 0.
    pub radius: f64,
    /// Distance of the near plane of free views, in world units, above 0.
    pub near: f32,
    /// The scene's upward direction in the world, a unit vector.
    pub up: DVec3,
}

impl SceneBounds {
    /// Returns the bounds of a scene. The ball `(centre, radius)` is the scene's bulk, as returned by
    /// [`lexisplat_render::bulk`]. `near` is the distance of the near plane of free views
    /// ([`lexisplat_render::near_plane`]). Up is the upward direction of the `given` cameras. Generated cameras must not
    /// be passed, because they do not tell the scene's upward direction.
    #[must_use]
    pub fn new((centre, radius): ([f64; 3], f64), near: f32, given: &[Camera]) -> Self {
        Self { centre: DVec3::from_array(centre), radius, near, up: Self::up_of(given) }
    }

    /// Returns the mean upward direction of `cameras`. If there are none or their directions differ much, returns world
    /// -y, which is up in most scenes trained from COLMAP's cameras.
    #[must_use]
    pub fn up_of(cameras: &[Camera]) -> DVec3 {
        let sum: DVec3 = cameras.iter().map(|c| -column(c, 1)).sum();
        let count = u32::try_from(cameras.len()).unwrap_or(u32::MAX);
        let mean = sum / f64::from(count.max(1));
        if mean.length() > 0.5 { mean.normalize() } else { DVec3::NEG_Y }
    }

    /// Returns these bounds with an upward direction for which the view of `pose` is level. Among all such directions it
    /// is the nearest to the axis of the world that is nearest to the view's own upward direction.
    #[must_use]
    pub fn upright_in(self, pose: &Pose) -> Self {
        let [right, down, _] = pose.axes().map(DVec3::from_array);
        let nearest = (0..3).max_by(|&a, &b| down[a].abs().total_cmp(&down[b].abs())).unwrap_or(1);
        let axis = DVec3::AXES[nearest] * -down[nearest].signum();
        Self { up: (axis - right * right.dot(axis)).normalize_or(self.up), ..self }
    }
}

/// A camera that the user moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraController {
    position: DVec3,
    /// The directions right, down and forward in the world, as columns.
    axes: DMat3,
    /// Distance of the pivot, which is straight ahead, in world units.
    distance: f64,
    /// Focal length, in units of the picture's shorter side.
    focal: f64,
    /// Distance of the near plane, in world units.
    near: f32,
    bounds: SceneBounds,
}

impl CameraController {
    /// Returns a controller with the view of `camera`. The distance of its pivot is the distance of the scene's centre
    /// along the view.
    #[must_use]
    pub fn at(camera: &Camera, bounds: SceneBounds) -> Self {
        let position = DVec3::from_array(camera.position.map(f64::from));
        let axes = DMat3::from_cols(column(camera, 0), column(camera, 1), column(camera, 2));
        let ahead = (bounds.centre - position).dot(axes.z_axis);
        let short = f64::from(camera.width.min(camera.height).max(1));
        Self {
            position,
            axes,
            distance: ahead.max(SHORTEST * bounds.radius),
            focal: f64::from(camera.fy) / short,
            near: camera.near.min(bounds.near),
            bounds,
        }
    }

    /// Returns a controller that looks from `pose`, whose rotation need not be of length 1.
    #[must_use]
    pub fn from_pose(pose: &Pose, bounds: SceneBounds) -> Self {
        let axes = DMat3::from_cols_array_2d(&pose.axes());
        let position = DVec3::from_array(pose.position);
        Self { position, axes, distance: pose.distance, focal: pose.focal, near: bounds.near, bounds }
    }

    /// Returns the pose of the camera.
    #[must_use]
    pub fn pose(&self) -> Pose {
        Pose::of(self.position.to_array(), self.axes.to_cols_array_2d(), self.distance, self.focal)
    }

    /// Returns the point that the camera orbits, in world units.
    #[must_use]
    pub fn pivot(&self) -> DVec3 {
        self.position + self.axes.z_axis * self.distance
    }

    fn turn(&mut self, axis: DVec3, angle: f64) {
        let turned = DMat3::from_axis_angle(axis, angle) * self.axes;
        // The axes are orthonormalised against rounding. A mirrored camera stays mirrored.
        let forward = turned.z_axis.normalize();
        let down = (turned.y_axis - forward * forward.dot(turned.y_axis)).normalize();
        let right = down.cross(forward);
        let right = if right.dot(turned.x_axis) < 0.0 { -right } else { right };
        self.axes = DMat3::from_cols(right, down, forward);
    }

    /// Returns `pitch`, limited so that the view does not turn over the vertical.
    fn clamped_pitch(&self, pitch: f64) -> f64 {
        let most = std::f64::consts::FRAC_PI_2 - POLE;
        let elevation = (-self.axes.z_axis.dot(self.bounds.up)).clamp(-1.0, 1.0).asin();
        // A camera that is beyond the limit may move back, but not further beyond it.
        (elevation + pitch).clamp(elevation.min(-most), elevation.max(most)) - elevation
    }

    /// Turns the scene around the pivot, as if the scene were dragged to the right and down. Angles are in radians.
    pub fn orbit(&mut self, right: f64, down: f64) {
        let pivot = self.pivot();
        self.look(right, down);
        self.position = pivot - self.axes.z_axis * self.distance;
    }

    /// Turns the view to the right and down around the camera's position. Angles are in radians.
    pub fn look(&mut self, right: f64, down: f64) {
        let down = self.clamped_pitch(down);
        self.turn(self.bounds.up, -right);
        self.turn(self.axes.y_axis.cross(self.axes.z_axis), -down);
    }

    /// Moves the camera so that the pivot moves to the right and down on the picture. Lengths are in units of the
    /// picture's shorter side.
    pub fn pan(&mut self, right: f64, down: f64) {
        let scale = self.distance / self.focal;
        self.position -= (self.axes.x_axis * right + self.axes.y_axis * down) * scale;
    }

    /// Multiplies the distance of the pivot by `factor`: moves the camera towards the pivot or away from it.
    pub fn dolly(&mut self, factor: f64) {
        let step = self.distance * (1.0 - factor);
        self.position += self.axes.z_axis * step;
        self.distance = (self.distance - step).max(NEAREST * self.bounds.radius);
    }

    /// Moves the camera by `step` scene radii to the right, up and forward. Up is the scene's upward direction.
    pub fn fly(&mut self, step: DVec3) {
        let along = self.axes.x_axis * step.x + self.bounds.up * step.y + self.axes.z_axis * step.z;
        self.position += along * self.bounds.radius;
    }

    /// Moves the camera sideways so that `point`, in world units, becomes the pivot. The direction of the view and the
    /// distance from the point do not change. A point that is not finite changes nothing.
    pub fn focus(&mut self, point: DVec3) {
        if point.is_finite() {
            self.distance = point.distance(self.position).max(NEAREST * self.bounds.radius);
            self.position = point - self.axes.z_axis * self.distance;
        }
    }

    /// Moves the camera so that the ball of [`SceneBounds`] touches the sides of a square picture. The ball's centre
    /// becomes the pivot. The direction of the view does not change.
    pub fn frame(&mut self) {
        // The sine of half the angle of view is `0.5 / sqrt(0.25 + focal^2)`.
        self.distance = self.bounds.radius * (1.0 + 4.0 * self.focal * self.focal).sqrt();
        self.position = self.bounds.centre - self.axes.z_axis * self.distance;
    }

    /// Returns the camera for a picture of `width * height` pixels, named `free`.
    #[must_use]
    pub fn camera(&self, width: u32, height: u32) -> Camera {
        let focal = self.focal * f64::from(width.min(height));
        let rotation = self.axes.transpose().to_cols_array_2d();
        Camera::rounded("free".to_owned(), [width, height], [focal; 2], self.position.to_array(), rotation)
            .with_near(self.near)
    }
}

/// Returns column `k` of the camera's rotation: right, down or forward.
fn column(camera: &Camera, k: usize) -> DVec3 {
    DVec3::from_array(camera.rotation.map(|row| f64::from(row[k]))).normalize_or_zero()
}

/// Returns the largest size with `aspect` (width over height) within `width * height` pixels.
#[must_use]
pub fn fitted(aspect: f64, width: u32, height: u32) -> (u32, u32) {
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

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: SceneBounds =
        SceneBounds { centre: DVec3::ZERO, radius: 2.0, near: 0.04, up: DVec3::NEG_Y };

    /// At z = -5, looking along z at the origin; y is down.
    fn controller() -> CameraController {
        let camera = Camera {
            name: String::new(),
            width: 300,
            height: 200,
            fx: 250.0,
            fy: 250.0,
            position: [0.0, 0.0, -5.0],
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            near: 0.2,
            split: None,
            tiles: None,
            background: None,
        };
        CameraController::at(&camera, BOUNDS)
    }

    fn near(a: DVec3, b: [f64; 3]) -> bool {
        (a - DVec3::from_array(b)).length() < 1e-6
    }

    #[test]
    fn the_picture_is_the_cameras_own() {
        let camera = controller().camera(300, 200);
        camera.validate().unwrap();
        assert_eq!((camera.fx, camera.fy), (250.0, 250.0));
        assert_eq!((camera.position, camera.rotation[1]), ([0.0, 0.0, -5.0], [0.0, 1.0, 0.0]));
        // A narrow one shows as much in its width.
        assert!((controller().camera(100, 200).fx - 125.0).abs() < 1e-4);
    }

    #[test]
    fn the_first_view_is_level() {
        // A camera that looks down by 30 degrees, in worlds with other upward directions.
        let (sine, cosine) = 30_f64.to_radians().sin_cos();
        for turn in [DMat3::IDENTITY, DMat3::from_rotation_x(1.6), DMat3::from_rotation_z(-0.3)] {
            let axes = turn
                * DMat3::from_cols(DVec3::X, DVec3::new(0.0, cosine, -sine), DVec3::new(0.0, sine, cosine));
            let pose = Pose::of([0.0; 3], axes.to_cols_array_2d(), 1.0, 1.0);
            let up = BOUNDS.upright_in(&pose).up;
            assert!(up.is_normalized() && axes.x_axis.dot(up).abs() < 1e-9);
            assert!(near(up, (turn * DVec3::NEG_Y).to_array()) || up.dot(turn * DVec3::NEG_Y) > 0.99, "{up}");
        }
    }

    #[test]
    fn orbiting_keeps_the_pivot_and_follows_the_mouse() {
        let mut controller = controller();
        controller.orbit(std::f64::consts::FRAC_PI_2, 0.0);
        // The front of the scene goes right, so we go left.
        assert!(near(controller.position, [-5.0, 0.0, 0.0]), "{controller:?}");
        assert!(near(controller.axes.z_axis, [1.0, 0.0, 0.0]));
        controller.orbit(0.0, 0.5);
        assert!(controller.position.y < -1.0, "dragged down, we go up: {controller:?}");
        assert!(near(controller.pivot(), [0.0; 3]));
        for _ in 0..1000 {
            controller.orbit(0.3, 0.2);
            controller.camera(64, 64).validate().unwrap();
        }
        let forward = controller.axes.z_axis;
        assert!(forward.y > 0.99 && forward.y < 1.0, "stops short of the pole: {forward}");
        assert!(controller.axes.y_axis.dot(BOUNDS.up) < 0.0, "still upright");
        assert!(near(controller.pivot(), [0.0; 3]));
    }

    #[test]
    fn a_camera_beyond_the_pole_may_come_back() {
        let mut controller = controller();
        controller.turn(DVec3::X, -1.56);
        let before = controller.axes.z_axis.y;
        controller.orbit(0.0, 0.3);
        assert!((controller.axes.z_axis.y - before).abs() < 1e-3, "no further");
        controller.orbit(0.0, -0.3);
        assert!(controller.axes.z_axis.y < before - 0.02, "{}", controller.axes.z_axis.y);
    }

    #[test]
    fn panning_drags_what_is_at_the_pivot_along() {
        let mut controller = controller();
        controller.pan(0.1, -0.2);
        let [x, y, z] = controller.camera(300, 200).to_view([0.0; 3]).map(f64::from);
        let short = 200.0;
        assert!((250.0 * x / z - 0.1 * short).abs() < 1e-3 && (250.0 * y / z + 0.2 * short).abs() < 1e-3);
    }

    #[test]
    fn looking_stays_in_place() {
        let mut controller = controller();
        controller.look(0.2, 0.1);
        assert!(near(controller.position, [0.0, 0.0, -5.0]));
        assert!(controller.axes.z_axis.x > 0.1 && controller.axes.z_axis.y > 0.05, "{controller:?}");
    }

    #[test]
    fn dollying_never_passes_but_pushes_the_pivot() {
        let mut controller = controller();
        controller.dolly(0.5);
        assert!(near(controller.position, [0.0, 0.0, -2.5]) && near(controller.pivot(), [0.0; 3]));
        for _ in 0..60 {
            controller.dolly(0.5);
        }
        assert!(controller.distance > 0.01 && controller.position.z > 0.0);
        controller.dolly(2.0);
        assert!(controller.distance > 0.05);
    }

    #[test]
    fn a_point_in_focus_is_in_the_middle_and_as_far_as_before() {
        let mut controller = controller();
        let point = DVec3::new(1.0, 0.5, -2.0);
        let before = point.distance(controller.position);
        controller.focus(point);
        assert!(near(controller.pivot(), point.to_array()));
        assert!((point.distance(controller.position) - before).abs() < 1e-12);
        assert_eq!(controller.axes.z_axis, DVec3::Z);
        let kept = controller;
        controller.focus(DVec3::new(f64::NAN, 0.0, 0.0));
        assert_eq!(controller, kept);
        controller.focus(controller.position);
        assert!(controller.distance > 0.0);
    }

    #[test]
    fn the_whole_ball_is_framed() {
        let mut controller = controller();
        controller.orbit(0.7, 0.3);
        controller.pan(3.0, 1.0);
        let forward = controller.axes.z_axis;
        controller.frame();
        assert!(near(controller.pivot(), [0.0; 3]) && controller.axes.z_axis == forward);
        // A line from the camera to a corner in the middle of a side touches the ball.
        let side = controller.axes.x_axis * 0.5 + forward * controller.focal;
        let to_centre = BOUNDS.centre - controller.position;
        let apart = to_centre.cross(side.normalize()).length();
        assert!((apart - BOUNDS.radius).abs() < 1e-9, "{apart}");
    }

    #[test]
    fn flying_goes_by_scene_radii() {
        let mut controller = controller();
        controller.fly(DVec3::new(0.5, 1.0, 0.25));
        assert!(near(controller.position, [1.0, -2.0, -4.5]), "{controller:?}");
    }

    #[test]
    fn up_is_what_the_photographers_say() {
        let camera = controller().camera(10, 10);
        assert_eq!(SceneBounds::up_of(&[]), DVec3::NEG_Y);
        let tilted = Camera { rotation: [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]], ..camera };
        assert!(near(SceneBounds::up_of(std::slice::from_ref(&tilted)), [0.0, 0.0, 1.0]));
        let other =
            Camera { rotation: [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]], ..tilted.clone() };
        assert_eq!(SceneBounds::up_of(&[tilted, other]), DVec3::NEG_Y);
    }

    #[test]
    fn sizes_fit() {
        assert_eq!(fitted(1.5, 900, 900), (900, 600));
        assert_eq!(fitted(1.5, 900, 300), (450, 300));
        assert_eq!(fitted(1000.0, 100, 100), (100, 1));
        assert_eq!(fitted(1.5, 0, 0), (1, 1));
    }
}
