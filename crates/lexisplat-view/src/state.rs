//! The state of the view: the shown scenes and the camera. It is independent of windows.

use lexisplat_render::{Camera, Pose, RenderOptions};

use crate::camera_controller::{CameraController, SceneBounds, fitted};
use crate::command::{Command, Mode, Slot};

/// Initial amplification of differences, which is that of the montages of `lexisplat-eval`, and its range.
const GAIN: f32 = 10.0;
pub(crate) const GAINS: std::ops::RangeInclusive<f32> = 1.0..=100.0;

/// Arrangement of the models' pictures on screen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrangement {
    /// Mode: which models are shown, and how.
    pub mode: Mode,
    /// Position of the wipe's line: 0 is the left edge, 1 the right edge.
    pub split: f32,
    /// Factor on differences, 1 to 100.
    pub gain: f32,
}

impl Arrangement {
    /// Returns the number of pictures side by side.
    #[must_use]
    pub fn columns(&self) -> u32 {
        if self.mode == Mode::SideBySide { 2 } else { 1 }
    }
}

/// The state of the view: the shown scenes and the camera.
#[derive(Debug)]
pub struct State {
    /// Cameras to step through.
    cameras: Vec<Camera>,
    /// Whether the cameras come from a file. Otherwise they are a generated orbit, whose picture size is arbitrary.
    given: bool,
    bounds: SceneBounds,
    /// The view that the scene's file states. It is used if the cameras are not given.
    first_view: Option<Pose>,
    /// Index of the camera chosen last.
    index: usize,
    /// Whether one of the cameras was chosen since the last reset.
    visited: bool,
    /// The free camera, or `None` while one of the cameras is chosen.
    free_camera: Option<CameraController>,
    arrangement: Arrangement,
    options: RenderOptions,
    /// Whether each model is open.
    open: [bool; 2],
    /// Whether the panel is shown.
    panel: bool,
}

impl State {
    /// Returns a state without models and cameras. `background` is the colour behind the scenes, each channel from 0 to
    /// 1.
    #[must_use]
    pub fn new(background: [f32; 3]) -> Self {
        let bounds =
            SceneBounds { centre: glam::DVec3::ZERO, radius: 1.0, near: 0.02, up: glam::DVec3::NEG_Y };
        Self {
            cameras: Vec::new(),
            given: false,
            bounds,
            first_view: None,
            index: 0,
            visited: false,
            free_camera: None,
            arrangement: Arrangement { mode: Mode::One(Slot::First), split: 0.5, gain: GAIN },
            options: RenderOptions::default().with_background(clipped(background)),
            open: [false; 2],
            panel: true,
        }
    }

    /// Sets the view that the scene's file states. [`Self::set_cameras`] shows it.
    pub fn set_first_view(&mut self, view: Option<Pose>) {
        self.first_view = view;
    }

    /// Replaces the cameras and resets the view. With `given` cameras the view is that of the first camera. Otherwise it
    /// is the view that the scene's file states, or that of a free camera in the place of the first camera, whose picture
    /// fills the window.
    pub fn set_cameras(&mut self, cameras: Vec<Camera>, given: bool, bounds: SceneBounds) {
        self.cameras = cameras;
        self.given = given;
        self.bounds = match self.first_view.filter(|_| !given) {
            Some(pose) => bounds.upright_in(&pose),
            None => bounds,
        };
        self.reset();
    }

    /// Sets which models are open. When the second of the two is opened, the mode becomes a wipe.
    pub fn set_open(&mut self, open: [bool; 2]) {
        if open == [true; 2] && self.open != open {
            self.arrangement.mode = Mode::Wipe;
        }
        self.open = open;
        self.arrangement.mode = self.possible(self.arrangement.mode);
    }

    /// Returns `mode`, or a mode that is possible with the open models.
    fn possible(&self, mode: Mode) -> Mode {
        match (self.open, mode) {
            ([true, true], mode) => mode,
            ([false, true], _) => Mode::One(Slot::Second),
            _ => Mode::One(Slot::First),
        }
    }

    fn reset(&mut self) {
        self.index = 0;
        self.visited = self.given;
        self.free_camera = match (self.first_view, self.cameras.first()) {
            _ if self.given => None,
            (Some(pose), Some(_)) => Some(CameraController::from_pose(&pose, self.bounds)),
            (None, Some(camera)) => Some(CameraController::at(camera, self.bounds)),
            (_, None) => None,
        };
    }

    /// Returns the cameras to step through.
    #[must_use]
    pub fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    /// Returns the index of the camera chosen last.
    #[must_use]
    pub fn index(&self) -> usize {
        self.index
    }

    /// Returns the arrangement of the pictures.
    #[must_use]
    pub fn arrangement(&self) -> Arrangement {
        self.arrangement
    }

    /// Returns the options of drawing.
    #[must_use]
    pub fn options(&self) -> RenderOptions {
        self.options
    }

    /// Returns whether the panel is shown.
    #[must_use]
    pub fn panel(&self) -> bool {
        self.panel
    }

    /// Returns the pose of the free camera, if it is in use.
    #[must_use]
    pub fn pose(&self) -> Option<Pose> {
        self.free_camera.as_ref().map(CameraController::pose)
    }

    /// Returns whether the free camera is in use.
    #[must_use]
    pub fn is_free(&self) -> bool {
        self.free_camera.is_some()
    }

    /// Returns the free camera. If it was not in use, it starts at the present view. Returns `None` if there is no camera
    /// yet.
    pub fn free_camera(&mut self) -> Option<&mut CameraController> {
        if self.free_camera.is_none() {
            self.free_camera = Some(CameraController::at(self.cameras.get(self.index)?, self.bounds));
        }
        self.free_camera.as_mut()
    }

    /// Carries out `command`. Commands that have no effect on the state are ignored.
    pub fn apply(&mut self, command: &Command) {
        let count = self.cameras.len();
        match *command {
            Command::Camera(index) if index < count => {
                self.index = index;
                self.visited = true;
                self.free_camera = None;
            }
            Command::StepCamera(by) if count > 0 => {
                // The first step forward after a reset to the free camera chooses the first camera.
                if self.visited || by < 0 {
                    self.index = wrapped(self.index, by, count);
                }
                self.visited = true;
                self.free_camera = None;
            }
            Command::View(pose) => {
                self.free_camera = Some(CameraController::from_pose(&pose, self.bounds));
            }
            Command::Reset => self.reset(),
            Command::Frame => {
                if let Some(controller) = self.free_camera() {
                    controller.frame();
                }
            }
            Command::Orbit([right, down]) => {
                if let Some(controller) = self.free_camera() {
                    controller.orbit(right.to_radians(), down.to_radians());
                }
            }
            Command::Mode(mode) => self.arrangement.mode = self.possible(mode),
            Command::Flip => {
                let slot = match self.arrangement.mode {
                    Mode::One(slot) => slot.other(),
                    _ => Slot::First,
                };
                self.arrangement.mode = self.possible(Mode::One(slot));
            }
            Command::Split(split) if split.is_finite() => self.arrangement.split = split.clamp(0.0, 1.0),
            Command::Gain(gain) if gain.is_finite() => {
                self.arrangement.gain = gain.clamp(*GAINS.start(), *GAINS.end());
            }
            Command::ScaleGain(factor) => self.apply(&Command::Gain(self.arrangement.gain * factor)),
            Command::Degree(degree) => self.options.max_degree = degree,
            Command::Background(colour) => {
                self.options.background = clipped(colour);
            }
            Command::Panel => self.panel = !self.panel,
            _ => {}
        }
    }

    /// Returns the camera for an area of `width * height` pixels in the present arrangement. The free camera fills the
    /// area, and other cameras keep their aspect within it. Returns `None` if there is no camera yet.
    #[must_use]
    pub fn camera(&self, width: u32, height: u32) -> Option<Camera> {
        let width = (width / self.arrangement.columns()).clamp(1, lexisplat_render::MAX_SIDE);
        let height = height.clamp(1, lexisplat_render::MAX_SIDE);
        if let Some(controller) = &self.free_camera {
            return Some(controller.camera(width, height));
        }
        let camera = self.cameras.get(self.index)?;
        let aspect = f64::from(camera.width) / f64::from(camera.height.max(1));
        let (width, height) = fitted(aspect, width, height);
        Some(camera.resized(width, height))
    }

    /// Returns the camera of a screenshot, at most `max_width` pixels wide: the chosen camera at its own size, or the
    /// free camera at its size on screen. Returns `None` if there is no camera yet.
    #[must_use]
    pub fn screenshot_camera(&self, width: u32, height: u32, max_width: u32) -> Option<Camera> {
        if self.free_camera.is_none() {
            return Some(self.cameras.get(self.index)?.with_max_width(max_width));
        }
        Some(self.camera(width, height)?.with_max_width(max_width))
    }
}

/// Returns `colour` clamped to 0 to 1. Values that are not finite become 0.
fn clipped(colour: [f32; 3]) -> [f32; 3] {
    colour.map(|v| if v.is_finite() { v.clamp(0.0, 1.0) } else { 0.0 })
}

/// Returns `index + by` modulo `count`, which must not be 0.
fn wrapped(index: usize, by: isize, count: usize) -> usize {
    let turn = by.unsigned_abs() % count;
    (index + if by < 0 { count - turn } else { turn }) % count
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    const BOUNDS: SceneBounds =
        SceneBounds { centre: DVec3::ZERO, radius: 1.0, near: 0.02, up: DVec3::NEG_Y };

    fn cameras() -> Vec<Camera> {
        let at = |x: f32| Camera {
            name: format!("{x}"),
            width: 3000,
            height: 2000,
            fx: 2500.0,
            fy: 2500.0,
            position: [x, 0.0, -5.0],
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            near: 0.2,
            split: None,
            tiles: None,
            background: None,
        };
        vec![at(0.0), at(1.0), at(2.0)]
    }

    fn state(given: bool) -> State {
        let mut state = State::new([0.0; 3]);
        state.set_open([true, false]);
        state.set_cameras(cameras(), given, BOUNDS);
        state
    }

    fn name(state: &State) -> String {
        state.camera(600, 600).unwrap().name
    }

    #[test]
    fn given_cameras_are_stepped_through_around_the_end() {
        let mut state = state(true);
        let mut names = vec![name(&state)];
        for by in [1, 1, 1, -1, -1] {
            state.apply(&Command::StepCamera(by));
            names.push(name(&state));
        }
        assert_eq!(names, ["0", "1", "2", "0", "2", "1"]);
        state.apply(&Command::Camera(7));
        assert_eq!(name(&state), "1", "there is no such camera");
        assert_eq!(wrapped(1, -8, 3), 2);
    }

    #[test]
    fn an_orbit_is_where_the_free_camera_starts() {
        let mut state = state(false);
        assert_eq!(name(&state), "free");
        state.apply(&Command::StepCamera(1));
        assert_eq!(name(&state), "0", "the first step leads to the first camera");
        state.apply(&Command::StepCamera(1));
        assert_eq!(name(&state), "1");
        state.apply(&Command::Orbit([10.0, 0.0]));
        assert_eq!(name(&state), "free");
        state.apply(&Command::StepCamera(1));
        assert_eq!(name(&state), "2");
        state.apply(&Command::Reset);
        assert_eq!(name(&state), "free");
    }

    #[test]
    fn a_camera_keeps_its_aspect_and_the_free_one_fills() {
        let mut state = state(true);
        let camera = state.camera(900, 900).unwrap();
        assert_eq!((camera.width, camera.height, camera.fx), (900, 600, 750.0));
        let shot = state.screenshot_camera(900, 900, 1500).unwrap();
        assert_eq!((shot.width, shot.height), (1500, 1000));
        state.apply(&Command::Orbit([0.0, 0.0]));
        let camera = state.camera(900, 700).unwrap();
        assert_eq!((camera.width, camera.height), (900, 700));
        state.set_open([true, true]);
        state.apply(&Command::Mode(Mode::SideBySide));
        assert_eq!(state.camera(900, 700).unwrap().width, 450);
        assert_eq!(state.screenshot_camera(900, 700, 300).unwrap().width, 300);
        assert!(State::new([0.0; 3]).camera(10, 10).is_none());
    }

    #[test]
    fn modes_show_what_is_open() {
        let mut state = state(true);
        for mode in Mode::ALL {
            state.apply(&Command::Mode(mode));
            assert_eq!(state.arrangement.mode, Mode::One(Slot::First));
        }
        state.set_open([true, true]);
        assert_eq!(state.arrangement.mode, Mode::Wipe, "the second appears");
        state.apply(&Command::Flip);
        assert_eq!(state.arrangement.mode, Mode::One(Slot::First));
        state.apply(&Command::Flip);
        assert_eq!(state.arrangement.mode, Mode::One(Slot::Second));
        state.apply(&Command::Mode(Mode::Difference));
        state.set_open([false, true]);
        assert_eq!(state.arrangement.mode, Mode::One(Slot::Second));
    }

    #[test]
    #[cfg(feature = "window")]
    fn differences_start_as_those_of_a_montage() {
        assert_eq!(GAIN, lexisplat_eval::montage::AMPLIFICATION);
    }

    #[test]
    fn numbers_stay_in_their_ranges() {
        let mut state = state(true);
        state.apply(&Command::Split(2.0));
        state.apply(&Command::Split(f32::NAN));
        state.apply(&Command::Gain(1e9));
        state.apply(&Command::Background([-1.0, f32::NAN, 0.5]));
        assert_eq!((state.arrangement.split, state.arrangement.gain), (1.0, 100.0));
        assert_eq!(state.options.background, [0.0, 0.0, 0.5]);
        state.apply(&Command::ScaleGain(0.1));
        assert_eq!(state.arrangement.gain, 10.0);
    }
}
