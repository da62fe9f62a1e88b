//! The metrics by name.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A metric of two pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Metric {
    /// [`super::psnr`], in dB.
    Psnr,
    /// [`super::ssim`].
    Ssim,
    /// NVIDIA's FLIP: 0 for pictures that look the same, at most 1.
    Flip,
    /// LPIPS with VGG16 as in the `lpips` package: pictures are scaled to -1..1.
    LpipsVgg,
    /// LPIPS with VGG16 as in `metrics.py` of the 3DGS repository: pictures stay in 0..1. This is not the standard value,
    /// but tables of 3DGS papers have it.
    LpipsVggInria,
    /// LPIPS with `AlexNet` as in the `lpips` package: pictures are scaled to -1..1.
    LpipsAlex,
    /// LPIPS with `AlexNet` of pictures that stay in 0..1.
    LpipsAlexInria,
}

impl Metric {
    /// All metrics, in the order of tables.
    pub const ALL: [Self; 7] = [
        Self::Psnr,
        Self::Ssim,
        Self::Flip,
        Self::LpipsVgg,
        Self::LpipsVggInria,
        Self::LpipsAlex,
        Self::LpipsAlexInria,
    ];

    /// Returns the name in files, and the name for people.
    fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Psnr => ("psnr", "PSNR"),
            Self::Ssim => ("ssim", "SSIM"),
            Self::Flip => ("flip", "FLIP"),
            Self::LpipsVgg => ("lpips_vgg", "LPIPS (VGG)"),
            Self::LpipsVggInria => ("lpips_vgg_inria", "LPIPS (VGG, as 3DGS)"),
            Self::LpipsAlex => ("lpips_alex", "LPIPS (Alex)"),
            Self::LpipsAlexInria => ("lpips_alex_inria", "LPIPS (Alex, 0..1)"),
        }
    }

    /// Returns the name in files, such as `lpips_vgg_inria`.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.names().0
    }

    /// Returns the name for people.
    #[must_use]
    pub fn title(self) -> &'static str {
        self.names().1
    }

    /// Returns the number of digits after the point in tables.
    #[must_use]
    pub fn digits(self) -> usize {
        if self == Self::Psnr { 2 } else { 4 }
    }
}

impl fmt::Display for Metric {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.title())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_spell_metrics_by_their_names() {
        for metric in Metric::ALL {
            assert_eq!(serde_json::to_string(&metric).unwrap(), format!("\"{}\"", metric.name()));
        }
    }
}
