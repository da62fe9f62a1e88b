//! All commands of the viewer. They come from keys, buttons, dropped files, scripts and links.

use std::path::PathBuf;

use lexisplat::ShDegree;
use lexisplat::packed::Preset;
use lexisplat_render::Pose;

/// The slot of one of the two models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Slot {
    /// The original, if two models are open.
    First,
    /// The model that is compared with the original.
    Second,
}

impl Slot {
    /// Both slots, in order.
    pub const BOTH: [Self; 2] = [Self::First, Self::Second];

    /// Returns the index in arrays of two.
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }

    /// Returns the other slot.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::First => Self::Second,
            Self::Second => Self::First,
        }
    }
}

/// The arrangement of the models' pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// One of the models alone.
    One(Slot),
    /// Both models, the first on the left.
    SideBySide,
    /// The first model left of a line, and the second model right of it.
    Wipe,
    /// The amplified absolute difference of both pictures.
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

    /// Returns for each model whether the mode needs its picture.
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
    /// Moves by this number of cameras in their list. The first camera follows the last.
    StepCamera(isize),
    /// Moves the free camera to this pose.
    View(Pose),
    /// Returns to the initial view.
    Reset,
    /// Moves the free camera so that the whole scene is in the picture. The direction of the view does not change.
    Frame,
    /// Orbits to the right and down, in degrees.
    Orbit([f64; 2]),
    /// Sets the mode.
    Mode(Mode),
    /// Shows the other model alone.
    Flip,
    /// Moves the wipe's line: 0 is the left edge, 1 the right edge.
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
        /// The dropped files.
        paths: Vec<PathBuf>,
        /// Whether a single scene becomes the first model.
        first: bool,
    },
    /// Makes the second model by compressing the first.
    Compress(Quality),
    /// Exchanges the models.
    Swap,
    /// Saves the picture to this file, or to a file with a generated name.
    Screenshot(Option<PathBuf>),
    /// Shows or hides the panel.
    Panel,
    /// Prints the state of the view as a JSON object.
    Report,
    /// Closes the window.
    Quit,
}
