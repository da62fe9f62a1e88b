//! The effects of a mouse, a wheel, fingers and held keys on the free camera. They are the same in every viewer.
//!
//! Lengths on the picture are in units of its shorter side, so that a gesture has the same effect at every size.

use glam::DVec3;

use crate::state::State;

/// Angle of orbiting by a drag across the picture's shorter side, in radians.
const ORBIT: f64 = std::f64::consts::PI;
/// Angle of looking around by such a drag, in radians.
const LOOK: f64 = 1.0;
/// Factor on the distance of the pivot for one point of scrolling.
const WHEEL: f64 = 0.998;
/// Largest number of points of one scroll.
const MOST_POINTS: f64 = 1000.0;
/// Longest step of a flight, in seconds, however long the last frame took.
const LONGEST_STEP: f64 = 0.1;
/// Speed of a flight, in scene radii per second, and the factor for a fast flight.
const SPEED: f64 = 0.6;
const FAST: f64 = 4.0;

/// The effect of a drag.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drag {
    /// Turns the scene around the pivot: with the main button, or one finger.
    Orbit,
    /// Moves the scene along: with the second button or shift, or two fingers.
    Pan,
    /// Turns the view around the camera: with the main button and ctrl.
    Look,
}

impl State {
    /// Moves the free camera by a drag to the right and down, in units of the picture's shorter side.
    pub fn drag(&mut self, drag: Drag, right: f64, down: f64) {
        if let Some(controller) = self.free_camera().filter(|_| right.is_finite() && down.is_finite()) {
            match drag {
                Drag::Orbit => controller.orbit(right * ORBIT, down * ORBIT),
                Drag::Pan => controller.pan(right, down),
                Drag::Look => controller.look(right * -LOOK, down * -LOOK),
            }
        }
    }

    /// Moves the free camera nearer by `points` points of scrolling (CSS pixels in a browser), or away if `points` is
    /// below 0. A browser's `deltaY` has the opposite sign.
    pub fn scroll(&mut self, points: f64) {
        if let Some(controller) = self.free_camera().filter(|_| points.is_finite()) {
            controller.dolly(WHEEL.powf(points.clamp(-MOST_POINTS, MOST_POINTS)));
        }
    }

    /// Makes `point`, in world units, the pivot of the free camera and the middle of its picture. See
    /// [`CameraController::focus`](crate::CameraController::focus).
    pub fn focus(&mut self, point: DVec3) {
        if let Some(controller) = self.free_camera() {
            controller.focus(point);
        }
    }

    /// Flies for `seconds` in a direction of [`keys::flight`](crate::keys::flight). Steps longer than 0.1 seconds count
    /// as 0.1 seconds.
    pub fn fly(&mut self, direction: DVec3, seconds: f64, fast: bool) {
        let speed = SPEED * if fast { FAST } else { 1.0 };
        if direction != DVec3::ZERO
            && seconds > 0.0
            && let Some(controller) = self.free_camera().filter(|_| direction.is_finite())
        {
            controller.fly(direction * speed * seconds.min(LONGEST_STEP));
        }
    }
}

#[cfg(test)]
mod tests {
    use lexisplat_render::Camera;

    use super::*;
    use crate::camera_controller::SceneBounds;

    /// At z = -5, looking along z at the origin; y is down; a chosen camera.
    fn state() -> State {
        let camera = Camera {
            name: "given".into(),
            width: 300,
            height: 200,
            fx: 200.0,
            fy: 200.0,
            position: [0.0, 0.0, -5.0],
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            near: 0.2,
            split: None,
            tiles: None,
            background: None,
        };
        let mut state = State::new([0.0; 3]);
        state.set_cameras(vec![camera], true, SceneBounds::new(([0.0; 3], 2.0), 0.04, &[]));
        state
    }

    fn place(state: &State) -> DVec3 {
        DVec3::from_array(state.camera(300, 200).unwrap().position.map(f64::from))
    }

    #[test]
    fn gestures_move_the_free_camera() {
        let mut dragged = state();
        dragged.drag(Drag::Orbit, 0.5, 0.0);
        assert!(dragged.is_free() && (place(&dragged) - DVec3::new(-5.0, 0.0, 0.0)).length() < 1e-5);
        let mut dragged = state();
        dragged.drag(Drag::Pan, 0.2, 0.0);
        assert!(
            (place(&dragged) - DVec3::new(-1.0, 0.0, -5.0)).length() < 1e-5,
            "the scene follows the hand"
        );
        dragged.drag(Drag::Look, 0.2, 0.3);
        assert!((place(&dragged) - DVec3::new(-1.0, 0.0, -5.0)).length() < 1e-5);
        let mut zoomed = state();
        zoomed.scroll(100.0);
        assert!((place(&zoomed).z + 5.0 * WHEEL.powf(100.0)).abs() < 1e-5, "nearer");
        zoomed.scroll(-200.0);
        assert!(place(&zoomed).z < -5.0, "farther");
        let mut flown = state();
        flown.fly(DVec3::Z, 10.0, true);
        assert!((place(&flown).z - (LONGEST_STEP * SPEED * FAST * 2.0 - 5.0)).abs() < 1e-5);
        flown.focus(DVec3::X);
        assert!((place(&flown).x - 1.0).abs() < 1e-5);
    }

    #[test]
    fn nonsense_moves_nothing() {
        let mut state = state();
        for value in [f64::NAN, f64::INFINITY] {
            state.drag(Drag::Orbit, value, 0.0);
            state.scroll(value);
            state.fly(DVec3::splat(value), 0.1, false);
            state.fly(DVec3::X, f64::NAN, false);
            state.focus(DVec3::splat(value));
        }
        assert_eq!(place(&state), DVec3::new(0.0, 0.0, -5.0));
        State::new([0.0; 3]).drag(Drag::Pan, 1.0, 1.0);
    }
}
