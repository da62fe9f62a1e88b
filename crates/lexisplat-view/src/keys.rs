//! The effects of keys.

use eframe::egui::{Key, Modifiers};
use glam::DVec3;

use crate::command::{Command, Mode};

/// Factor of one press on the amplification of differences.
const GAIN_STEP: f32 = 1.5;

/// Keys and their effects, for the panel.
pub(crate) const HELP: [(&str, &str); 12] = [
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
    ("R", "back to the start"),
    ("P, H", "screenshot, hide this panel"),
];

/// Returns the command of `key`, if it has one.
pub(crate) fn command(key: Key) -> Option<Command> {
    Some(match key {
        Key::OpenBracket => Command::StepCamera(-1),
        Key::CloseBracket => Command::StepCamera(1),
        Key::Num1 => Command::Mode(Mode::ALL[0]),
        Key::Num2 => Command::Mode(Mode::ALL[1]),
        Key::Num3 => Command::Mode(Mode::ALL[2]),
        Key::Num4 => Command::Mode(Mode::ALL[3]),
        Key::Num5 => Command::Mode(Mode::ALL[4]),
        Key::Space => Command::Flip,
        Key::Plus | Key::Equals => Command::ScaleGain(GAIN_STEP),
        Key::Minus => Command::ScaleGain(1.0 / GAIN_STEP),
        Key::R => Command::Reset,
        Key::P => Command::Screenshot(None),
        Key::H => Command::Panel,
        _ => return None,
    })
}

/// Returns the direction of a flight by the keys that are held: right, up and forward, each -1 to 1.
pub(crate) fn flight(held: impl Fn(Key) -> bool, modifiers: Modifiers) -> DVec3 {
    if modifiers.command || modifiers.alt {
        return DVec3::ZERO;
    }
    let axis = |plus, minus| f64::from(i8::from(held(plus)) - i8::from(held(minus)));
    DVec3::new(axis(Key::D, Key::A), axis(Key::E, Key::Q), axis(Key::W, Key::S))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opposite_keys_cancel_and_shortcuts_do_not_fly() {
        let held = |key| matches!(key, Key::W | Key::S | Key::D);
        assert_eq!(flight(held, Modifiers::NONE), DVec3::X);
        assert_eq!(flight(held, Modifiers::COMMAND), DVec3::ZERO);
    }

    #[test]
    fn fly_keys_have_no_other_command() {
        for key in [Key::W, Key::A, Key::S, Key::D, Key::Q, Key::E] {
            assert_eq!(command(key), None);
        }
        assert_eq!(command(Key::CloseBracket), Some(Command::StepCamera(1)));
    }
}
