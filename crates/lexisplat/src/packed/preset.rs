//! Presets of the quality of packed files.

use crate::sparse::model::named;

/// A quality of packed files, as an expected average PSNR.
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
    /// All presets, smallest files first.
    pub const ALL: [Self; 4] = [Self::Small, Self::Balanced, Self::High, Self::Archive];

    /// Returns the expected average PSNR in dB, for [`Packer::step_for`](crate::packed::Packer::step_for).
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

named!(Preset, "preset", Small => "small", Balanced => "balanced", High => "high", Archive => "archive");
