//! All commands of the viewer. Keys, buttons, dropped files, scripts and links give them.

use std::path::PathBuf;

use lexisplat::ShDegree;
use lexisplat::packed::Preset;

use crate::pose::Pose;

/// The place of one of the two models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Slot {
    /// The original, if there are two.
    First,
    /// What is compared with it.
    Second,
}

impl Slot {
    /// Both, in order.
    pub const BOTH: [Self; 2] = [Self::First, Self::Second];

    /// Returns the index in arrays of two.
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }

    /// Returns the other one.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::First => Self::Second,
            Self::Second => Self::First,
        }
    }
}

/// How the models are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// One of the models.
    One(Slot),
    /// Both models, the first on the left.
    SideBySide,
    /// The first model left of a line, the second right of it.
    Wipe,
    /// The amplified absolute difference.
    Difference,
}

impl Mode {
    /// All modes, in the order of their keys.
    pub const ALL: [Self; 5] =
        [Self::One(Slot::First), Self::One(Slot::Second), Self::SideBySide, Self::Wipe, Self::Difference];

    /// Returns the name in scripts and file names.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::One(Slot::First) => "first",
            Self::One(Slot::Second) => "second",
            Self::SideBySide => "side",
            Self::Wipe => "wipe",
            Self::Difference => "difference",
        }
    }

    /// Returns the name on a button.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::One(Slot::First) => "First",
            Self::One(Slot::Second) => "Second",
            Self::SideBySide => "Side",
            Self::Wipe => "Wipe",
            Self::Difference => "Diff",
        }
    }

    /// Returns which models the mode needs a picture of.
    #[must_use]
    pub fn needs(self) -> [bool; 2] {
        match self {
            Self::One(slot) => [slot == Slot::First, slot == Slot::Second],
            _ => [true; 2],
        }
    }
}

/// The quality to compress to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Quality {
    /// The packed layout with a preset.
    Preset(Preset),
    /// Exact geometry, with each Gaussian's SH error at most this L2 norm.
    Tolerance(f64),
}

impl std::fmt::Display for Quality {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Preset(preset) => preset.fmt(f),
            Self::Tolerance(tolerance) => write!(f, "tolerance {tolerance}"),
        }
    }
}

/// A command.
#[derive(Debug, Clone, PartialEq)]
pub enum Command {
    /// Chooses the camera with this index, from 0.
    Camera(usize),
    /// Chooses the camera this many places after the current one; the first follows the last.
    StepCamera(isize),
    /// Moves the free camera here.
    View(Pose),
    /// Returns to the initial view.
    Reset,
    /// Moves the free camera so that the whole scene is in the picture, in the direction that it looks.
    Frame,
    /// Orbits to the right and down, in degrees.
    Orbit([f64; 2]),
    /// Sets the mode.
    Mode(Mode),
    /// Shows the other model alone.
    Flip,
    /// Moves the wipe's line: 0 is the left edge, 1 the right.
    Split(f32),
    /// Sets the factor on differences.
    Gain(f32),
    /// Multiplies the factor on differences.
    ScaleGain(f32),
    /// Draws with SH up to this degree; `None` means all degrees.
    Degree(Option<ShDegree>),
    /// Sets the colour behind the scenes.
    Background([f32; 3]),
    /// Opens a file as one of the models.
    Open(PathBuf, Slot),
    /// Opens dropped files.
    Drop {
        /// The files.
        paths: Vec<PathBuf>,
        /// Whether a single scene becomes the first model.
        first: bool,
    },
    /// Makes the second model by compressing the first.
    Compress(Quality),
    /// Exchanges the models.
    Swap,
    /// Saves the picture to this file, or to one with a generated name.
    Screenshot(Option<PathBuf>),
    /// Shows or hides the panel.
    Panel,
    /// Prints what is shown as a JSON object.
    Report,
    /// Closes the window.
    Quit,
}
