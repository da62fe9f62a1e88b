//! The effects of keys. Keys are named by their text, such as `]`, `1`, `Space` or `R`.

use glam::DVec3;

use crate::command::{Command, Mode};

/// Factor on the amplification of differences for one press of a key.
const GAIN_STEP: f32 = 1.5;
/// The keys that fly right, left, up, down, forward and back while they are held.
pub const FLIGHT_KEYS: [&str; 6] = ["D", "A", "E", "Q", "W", "S"];

/// Keys and gestures with their effects, for display as a table.
pub const HELP: [(&str, &str); 13] = [
    ("drag", "orbit"),
    ("right or shift drag", "pan"),
    ("ctrl drag", "look around"),
    ("wheel", "nearer, farther"),
    ("W A S D, Q E", "fly; shift: faster"),
    ("[  ]", "previous, next camera"),
    ("1 2", "first, second model"),
    ("3 4 5", "side by side, wipe, difference"),
    ("space", "the other model"),
    ("+  -", "difference gain"),
    ("F", "the whole scene"),
    ("R", "back to the start"),
    ("P, H", "screenshot, hide this panel"),
];

/// Returns the command of the key named `name`; `None` if the key has no command. Names are those of scripts and of a
/// browser's `KeyboardEvent.key`: the text of the key, with letters in either case, and `Space` or a space for the space
/// bar. `=` is the same key as `+`.
#[must_use]
pub fn command_of_key(name: &str) -> Option<Command> {
    let is = |letter: &str| name.eq_ignore_ascii_case(letter);
    Some(match name {
        "[" => Command::StepCamera(-1),
        "]" => Command::StepCamera(1),
        "1" => Command::Mode(Mode::ALL[0]),
        "2" => Command::Mode(Mode::ALL[1]),
        "3" => Command::Mode(Mode::ALL[2]),
        "4" => Command::Mode(Mode::ALL[3]),
        "5" => Command::Mode(Mode::ALL[4]),
        " " => Command::Flip,
        "+" | "=" => Command::ScaleGain(GAIN_STEP),
        "-" => Command::ScaleGain(1.0 / GAIN_STEP),
        _ if is("Space") => Command::Flip,
        _ if is("F") => Command::Frame,
        _ if is("R") => Command::Reset,
        _ if is("P") => Command::Screenshot(None),
        _ if is("H") => Command::Panel,
        _ => return None,
    })
}

/// Returns the direction of a flight: right, up and forward, each from -1 to 1. `held` tells whether one of
/// [`FLIGHT_KEYS`] is held.
#[must_use]
pub fn flight(held: impl Fn(&str) -> bool) -> DVec3 {
    let [right, left, up, down, forward, back] = FLIGHT_KEYS.map(|key| i8::from(held(key)));
    DVec3::new(f64::from(right - left), f64::from(up - down), f64::from(forward - back))
}

/// The same functions for keys of the window.
#[cfg(feature = "window")]
pub(crate) mod window {
    use eframe::egui::{Key, Modifiers};
    use glam::DVec3;

    use crate::command::Command;

    /// Returns the command of `key`, if it has one.
    pub(crate) fn command(key: Key) -> Option<Command> {
        super::command_of_key(match key {
            Key::OpenBracket => "[",
            Key::CloseBracket => "]",
            Key::Plus => "+",
            Key::Equals => "=",
            Key::Minus => "-",
            key => key.name(),
        })
    }

    /// Returns the direction of a flight by the keys that are held: right, up and forward, each -1 to 1.
    pub(crate) fn flight(held: impl Fn(Key) -> bool, modifiers: Modifiers) -> DVec3 {
        if modifiers.command || modifiers.alt {
            return DVec3::ZERO;
        }
        super::flight(|name| Key::from_name(name).is_some_and(&held))
    }

    #[cfg(test)]
    mod tests {
        use super::*;
        use crate::keys::{FLIGHT_KEYS, command_of_key};

        #[test]
        fn opposite_keys_cancel_and_shortcuts_do_not_fly() {
            let held = |key| matches!(key, Key::W | Key::S | Key::D);
            assert_eq!(flight(held, Modifiers::NONE), DVec3::X);
            assert_eq!(flight(held, Modifiers::COMMAND), DVec3::ZERO);
            assert!(FLIGHT_KEYS.into_iter().all(|name| Key::from_name(name).is_some()));
        }

        #[test]
        fn every_key_of_the_table_is_one_of_the_windows() {
            let mut windows: Vec<Command> = Key::ALL.iter().filter_map(|key| command(*key)).collect();
            for name in ["[", "]", "1", "2", "3", "4", "5", "Space", "+", "-", "F", "R", "P", "H"] {
                let wanted = command_of_key(name).unwrap();
                assert!(windows.contains(&wanted), "{name}");
                windows.retain(|command| *command != wanted);
            }
            assert_eq!(windows, []);
            for key in [Key::W, Key::A, Key::S, Key::D, Key::Q, Key::E] {
                assert_eq!(command(key), None);
            }
            assert_eq!(command(Key::CloseBracket), Some(Command::StepCamera(1)));
            assert_eq!(command(Key::Equals), command(Key::Plus));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::Slot;

    #[test]
    fn opposite_keys_cancel() {
        assert_eq!(flight(|key| "WSD".contains(key)), DVec3::X);
        assert_eq!(flight(|key| "SE".contains(key)), DVec3::new(0.0, 1.0, -1.0));
    }

    #[test]
    fn fly_keys_have_no_other_command() {
        for key in FLIGHT_KEYS {
            assert_eq!(command_of_key(key), None);
        }
    }

    #[test]
    fn names_are_those_of_a_browser() {
        assert_eq!(command_of_key("f"), Some(Command::Frame));
        assert_eq!(command_of_key("R"), Some(Command::Reset));
        assert_eq!(command_of_key(" "), Some(Command::Flip));
        assert_eq!(command_of_key("="), command_of_key("+"));
        assert_eq!(command_of_key("2"), Some(Command::Mode(Mode::One(Slot::Second))));
        for name in ["", "F1", "Shift", "Enter", "ArrowLeft", "é", "w", "]]"] {
            assert_eq!(command_of_key(name), None, "{name}");
        }
    }
}
