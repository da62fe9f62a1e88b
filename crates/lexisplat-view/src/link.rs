//! Links to exactly the view shown: the state as a short text, for the fragment of an address.

use std::mem::discriminant;

use lexisplat::{Error, Result};

use crate::command::{Command, Mode};
use crate::script;
use crate::state::{GAINS, State};

/// Largest number of bytes of a link that is read. Links of [`State::link`] have at most a few hundred.
const MOST_BYTES: usize = 4096;

impl State {
    /// Returns the state of the view as words of a script, joined by `&`: `view=`, or `camera=` if one of the cameras is
    /// chosen; `mode=`; `split=` of a wipe or `gain=` of a difference; `degree=`; and `background=`. All characters are
    /// allowed in the fragment of an address.
    ///
    /// The camera is rounded as described at [`Pose`](lexisplat_render::Pose). The other numbers are exact. If the text is applied
    /// to a state with the same models and cameras, it gives the same view, and the link of this view is the same text.
    #[must_use]
    pub fn link(&self) -> String {
        let arrangement = self.arrangement();
        let options = self.options();
        let [r, g, b] = options.background;
        let mut words = Vec::new();
        match self.pose() {
            Some(pose) => words.push(format!("view={pose}")),
            None if self.index() < self.cameras().len() => words.push(format!("camera={}", self.index())),
            None => {}
        }
        words.push(format!("mode={}", arrangement.mode.name()));
        match arrangement.mode {
            Mode::Wipe => words.push(format!("split={}", arrangement.split)),
            Mode::Difference => words.push(format!("gain={}", arrangement.gain)),
            _ => {}
        }
        words.push(options.max_degree.map_or_else(|| "degree=all".to_owned(), |d| format!("degree={d}")));
        words.push(format!("background={r}:{g}:{b}"));
        words.join("&")
    }

    /// Applies a text of [`Self::link`]. Properties that the text does not mention do not change. If a mode needs a model
    /// that is not open, the nearest possible mode is chosen, so models and cameras should be set first.
    ///
    /// # Errors
    /// [`Error::Parameter`] with the word that is not valid, is not allowed in a link or comes twice. Nothing changes in
    /// this case.
    pub fn apply_link(&mut self, text: &str) -> Result<()> {
        if text.len() > MOST_BYTES {
            return Err(Error::parameter("link", text.len(), format!("at most {MOST_BYTES} bytes")));
        }
        let mut commands: Vec<Command> = Vec::new();
        for word in text.split('&').map(str::trim).filter(|word| !word.is_empty()) {
            let command = script::word("link", word)?;
            let wrong = |expected: &str| Error::parameter("link", word, expected);
            self.check(&command).map_err(|expected| wrong(&expected))?;
            if commands.iter().any(|other| concern_the_same(other, &command)) {
                return Err(wrong("each thing once"));
            }
            commands.push(command);
        }
        for command in &commands {
            self.apply(command);
        }
        Ok(())
    }

    /// Returns an error if `command` is not allowed in a link. The error lists the allowed commands.
    fn check(&self, command: &Command) -> std::result::Result<(), String> {
        let share = |v: &f32| (0.0..=1.0).contains(v);
        let (fits, expected) = match command {
            Command::View(_) | Command::Mode(_) | Command::Degree(_) => (true, String::new()),
            Command::Camera(index) => {
                let count = self.cameras().len();
                (*index < count, format!("one of {count} cameras, from 0"))
            }
            Command::Split(split) => (share(split), "a number from 0 to 1".to_owned()),
            Command::Gain(gain) => {
                (GAINS.contains(gain), format!("a number from {} to {}", GAINS.start(), GAINS.end()))
            }
            Command::Background(colour) => (colour.iter().all(share), "three numbers from 0 to 1".to_owned()),
            _ => (false, "view, camera, mode, split, gain, degree or background".to_owned()),
        };
        if fits { Ok(()) } else { Err(expected) }
    }
}

/// Returns whether one command would undo the other.
fn concern_the_same(a: &Command, b: &Command) -> bool {
    let moves = |command: &Command| matches!(command, Command::View(_) | Command::Camera(_));
    discriminant(a) == discriminant(b) || (moves(a) && moves(b))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use lexisplat::ShDegree;
    use lexisplat_render::Camera;
    use proptest::prelude::*;

    use super::*;
    use crate::camera_controller::SceneBounds;

    fn state() -> State {
        let camera = |x: f32| Camera {
            name: format!("{x}"),
            width: 300,
            height: 200,
            fx: 250.0,
            fy: 250.0,
            position: [x, 0.0, -5.0],
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            near: 0.2,
            split: None,
            tiles: None,
            background: None,
        };
        let mut state = State::new([0.0; 3]);
        state.set_open([true; 2]);
        let bounds = SceneBounds { centre: DVec3::ZERO, radius: 2.0, near: 0.04, up: DVec3::NEG_Y };
        state.set_cameras(vec![camera(0.0), camera(1.0)], true, bounds);
        state
    }

    #[test]
    fn a_link_is_short_and_readable() {
        let mut state = state();
        state.apply(&Command::Camera(1));
        assert_eq!(state.link(), "camera=1&mode=wipe&split=0.5&degree=all&background=0:0:0");
        state.apply(&Command::Frame);
        state.apply(&Command::Mode(Mode::Difference));
        state.apply(&Command::Degree(ShDegree::new(2).ok()));
        let expected =
            "view=0:0:-5.3851648:0:0:0:1:5.3851648:1.25&mode=difference&gain=10&degree=2&background=0:0:0";
        assert_eq!(state.link(), expected);
        assert!(expected.bytes().all(|b| b.is_ascii_alphanumeric() || b":=&.-".contains(&b)));
        assert_eq!(State::new([0.5; 3]).link(), "mode=first&degree=all&background=0.5:0.5:0.5");
    }

    #[test]
    fn what_is_left_out_stays() {
        let mut state = state();
        state.apply_link("split=0.25&&camera=1").unwrap();
        let before = state.link();
        state.apply_link("").unwrap();
        assert_eq!(state.link(), before);
        assert!(before.starts_with("camera=1&mode=wipe&split=0.25&"), "{before}");
        state.set_open([true, false]);
        state.apply_link("mode=difference").unwrap();
        assert_eq!(state.arrangement().mode.name(), "first", "there is no second model");
    }

    #[test]
    fn nonsense_is_refused_by_word_and_changes_nothing() {
        let mut state = state();
        let before = state.link();
        for bad in [
            "dance=1",
            "camera=2",
            "camera=-1",
            "view=1:2:3",
            "view=0:0:0:0:0:0:0:1:1",
            "mode=best",
            "split=1.5",
            "split=nan",
            "gain=0",
            "gain=inf",
            "degree=9",
            "background=0:0",
            "background=0:0:2",
            "quit",
            "screenshot=a.png",
            "open=a.lexi",
            "key=P",
            "%20",
            "degree=1",
        ] {
            // The last one is wrong because it comes twice.
            let message = state.apply_link(&format!("mode=first&degree=2&{bad}")).unwrap_err().to_string();
            assert!(message.contains(bad), "{message}");
            assert_eq!(state.link(), before);
        }
        assert!(state.apply_link("camera=0&view=0:0:0:0:0:0:1:1:1").is_err());
        assert!(state.apply_link(&"&".repeat(MOST_BYTES + 1)).is_err());
    }

    fn commands() -> impl Strategy<Value = Vec<Command>> {
        let one = prop_oneof![
            (0..2_usize).prop_map(Command::Camera),
            (-200.0..200.0, -90.0..90.0).prop_map(|(x, y)| Command::Orbit([x, y])),
            Just(Command::Frame),
            (0..Mode::ALL.len()).prop_map(|i| Command::Mode(Mode::ALL[i])),
            (0.0..1.0_f32).prop_map(Command::Split),
            (1.0..100.0_f32).prop_map(Command::Gain),
            (0..5_u8).prop_map(|degree| Command::Degree(ShDegree::new(degree).ok())),
            prop::array::uniform3(0.0..1.0_f32).prop_map(Command::Background),
        ];
        prop::collection::vec(one, 0..12)
    }

    proptest! {
        #[test]
        fn a_link_leads_to_the_same_view(commands in commands(), moves in prop::array::uniform5(-2.0..2.0_f64), is_free: bool) {
            let mut first = state();
            for command in &commands {
                first.apply(command);
            }
            if is_free && let Some(controller) = first.free_camera() {
                let [x, y, z, right, down] = moves;
                controller.fly(DVec3::new(x, y, z));
                controller.look(right, down);
                controller.dolly(1.5 + x / 2.0);
            }
            let link = first.link();
            let mut second = state();
            second.apply_link(&link).unwrap();
            prop_assert_eq!(second.link(), link);
            prop_assert_eq!(second.options(), first.options());
            prop_assert_eq!(second.arrangement().mode, first.arrangement().mode);
            let (a, b) = (first.camera(4000, 3000).unwrap(), second.camera(4000, 3000).unwrap());
            prop_assert!((a.fx / b.fx - 1.0).abs() < 1e-6);
            // A point at the pivot is at the same place of the picture, within what single precision leaves.
            #[expect(clippy::cast_possible_truncation, reason = "as precise as the cameras")]
            let pivot = first.free_camera().unwrap().pivot().to_array().map(|v| v as f32);
            let place = |camera: &Camera| {
                let [x, y, z] = camera.to_view(pivot);
                [camera.fx * x / z, camera.fy * y / z]
            };
            for (p, q) in place(&a).into_iter().zip(place(&b)) {
                prop_assert!((p - q).abs() < 0.05, "{p} {q}");
            }
        }
    }
}
