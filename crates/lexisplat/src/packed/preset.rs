//! Presets of quality.

use crate::support::error::{Error, Result};

/// A quality of packed files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Preset {
    /// For phones: about 35 dB.
    Small,
    /// Looks like the original unless both are compared closely: about 40 dB.
    #[default]
    Balanced,
    /// Looks the same as the original: about 45 dB.
    High,
    /// Replaces the original: about 54 dB.
    Archive,
}

impl Preset {
    /// All of them, smallest files first.
    pub const ALL: [Self; 4] = [Self::Small, Self::Balanced, Self::High, Self::Archive];

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Small => "small",
            Self::Balanced => "balanced",
            Self::High => "high",
            Self::Archive => "archive",
        }
    }

    /// The expected average PSNR in dB, for [`Packer::step_for`](super::Packer::step_for).
    #[must_use]
    pub fn decibels(self) -> f64 {
        match self {
            Self::Small => 35.0,
            Self::Balanced => 40.0,
            Self::High => 45.0,
            Self::Archive => 54.0,
        }
    }
}

impl std::fmt::Display for Preset {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

impl std::str::FromStr for Preset {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let names = || Self::ALL.map(Self::name).join(", ");
        let found = Self::ALL.into_iter().find(|preset| preset.name() == text);
        found.ok_or_else(|| Error::parameter("preset", text, format!("one of {}", names())))
    }
}
