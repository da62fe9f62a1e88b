//! Everything that can be asked of the viewer: by a key, a button, a dropped file or a script.

use std::path::PathBuf;

use lexisplat::ShDegree;
use lexisplat::packed::Preset;

/// One of the two models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Which {
    First,
    Second,
}

impl Which {
    /// Both, in order.
    pub(crate) const BOTH: [Self; 2] = [Self::First, Self::Second];

    /// Its place in arrays of two.
    pub(crate) fn index(self) -> usize {
        match self {
            Self::First => 0,
            Self::Second => 1,
        }
    }

    pub(crate) fn other(self) -> Self {
        match self {
            Self::First => Self::Second,
            Self::Second => Self::First,
        }
    }
}

/// How the models are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Mode {
    /// One of them.
    One(Which),
    /// Both, the first on the left.
    SideBySide,
    /// The first left of a line, the second right of it.
    Wipe,
    /// The absolute difference, amplified.
    Difference,
}

impl Mode {
    /// All of them, in the order of their keys.
    pub(crate) const ALL: [Self; 5] =
        [Self::One(Which::First), Self::One(Which::Second), Self::SideBySide, Self::Wipe, Self::Difference];

    /// Its name in scripts and file names.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::One(Which::First) => "first",
            Self::One(Which::Second) => "second",
            Self::SideBySide => "side",
            Self::Wipe => "wipe",
            Self::Difference => "difference",
        }
    }

    /// Its name on a button.
    pub(crate) fn label(self) -> &'static str {
        match self {
            Self::One(Which::First) => "First",
            Self::One(Which::Second) => "Second",
            Self::SideBySide => "Side",
            Self::Wipe => "Wipe",
            Self::Difference => "Diff",
        }
    }

    /// Which models it needs a picture of.
    pub(crate) fn needs(self) -> [bool; 2] {
        match self {
            Self::One(which) => [which == Which::First, which == Which::Second],
            _ => [true; 2],
        }
    }
}

/// What to compress to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Quality {
    /// A packed file.
    Preset(Preset),
    /// Geometry exact, SH within this L2 norm.
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

/// Something to do.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Command {
    /// Look through the camera of this index, from 0.
    Camera(usize),
    /// Look through the camera so many further on, around the end.
    StepCamera(isize),
    /// Go back to where it began.
    Reset,
    /// Orbit to the right and down, in degrees.
    Orbit([f64; 2]),
    /// Show the models so.
    Mode(Mode),
    /// Show the other one.
    Flip,
    /// Wipe here, 0 for the left edge to 1 for the right.
    Split(f32),
    /// Amplify differences so many times.
    Gain(f32),
    /// Amplify differences so many times more.
    ScaleGain(f32),
    /// Draw with SH up to this degree; `None` for all.
    Degree(Option<ShDegree>),
    /// The colour behind the scenes.
    Background([f32; 3]),
    /// Open a file as one of the models.
    Open(PathBuf, Which),
    /// Take files that were dropped; `first` as the first model.
    Drop { paths: Vec<PathBuf>, first: bool },
    /// Make the second model by compressing the first.
    Compress(Quality),
    /// Exchange the models.
    Swap,
    /// Save the picture, to this file or to one with a name of its own.
    Screenshot(Option<PathBuf>),
    /// Show or hide the panel.
    Panel,
    /// Print what is shown as a JSON object.
    Report,
    /// Close the window.
    Quit,
}
