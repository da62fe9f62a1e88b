//! The results of a sweep.

use std::fmt;
use std::str::FromStr;

use lexisplat::packed::Preset;
use serde::{Deserialize, Serialize};

use lexisplat_compress::{Error, Result};
use lexisplat_eval::{Comparison, FrameRate};

/// Who trained a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The 3DGS authors' trainer.
    #[serde(rename = "3dgs")]
    Gs3d,
    /// 3DGS-MCMC.
    Mcmc,
    /// Pixel-GS.
    #[serde(rename = "pixelgs")]
    PixelGs,
    /// EAGLES, decoded to a PLY: the paper's competitor, with scalar quantisation.
    Eagles,
    /// EAGLES trained without scalar quantisation.
    EaglesNoSq,
    /// Anything else.
    Other,
}

impl Method {
    /// All of them, in the paper's order.
    pub(crate) const ALL: [Self; 6] =
        [Self::Gs3d, Self::Mcmc, Self::PixelGs, Self::Eagles, Self::EaglesNoSq, Self::Other];

    /// The name in files and manifests, and the name for people, as the paper prints it.
    fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Gs3d => ("3dgs", "3DGS"),
            Self::Mcmc => ("mcmc", "MCMC"),
            Self::PixelGs => ("pixelgs", "PixelGS"),
            Self::Eagles => ("eagles", "EAGLES"),
            Self::EaglesNoSq => ("eagles-no-sq", "EAGLES, no SQ"),
            Self::Other => ("other", "other"),
        }
    }

    /// Name in files and manifests.
    pub(crate) fn name(self) -> &'static str {
        self.names().0
    }

    /// Name for people, as the paper prints it.
    pub(crate) fn title(self) -> &'static str {
        self.names().1
    }

    /// Whether the method compresses by itself, so that its models are only scored, not compressed.
    pub(crate) fn is_competitor(self) -> bool {
        matches!(self, Self::Eagles | Self::EaglesNoSq)
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Method {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|method| method.name() == text).ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|method| method.name()).collect();
            Error::parameter("method", text, format!("one of {}", names.join(", ")))
        })
    }
}

/// A way to compress models.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Setting {
    /// SH within this un-squared L2 norm, geometry exact. The paper has this kind.
    Tolerance(f64),
    /// At most this many nonzeros for each Gaussian, no tolerance, geometry exact.
    MaxNonzeros(u8),
    /// A packed file by preset: everything quantised.
    Preset(#[serde(with = "by_name")] Preset),
}

impl Setting {
    /// Short name, unique within a sweep: `tol 0.1`, `nnz 1`, `balanced`.
    #[must_use]
    pub fn label(self) -> String {
        match self {
            Self::Tolerance(tolerance) => format!("tol {tolerance}"),
            Self::MaxNonzeros(most) => format!("nnz {most}"),
            Self::Preset(preset) => preset.name().to_owned(),
        }
    }
}

/// Presets in files: by name.
mod by_name {
    use lexisplat::packed::Preset;
    use serde::de::{Deserialize, Deserializer, Error as _};
    use serde::ser::Serializer;

    pub(super) fn serialize<S: Serializer>(preset: &Preset, out: S) -> Result<S::Ok, S::Error> {
        out.serialize_str(preset.name())
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Preset, D::Error> {
        String::deserialize(from)?.parse().map_err(D::Error::custom)
    }
}

/// Frames a second, measured in turn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fps {
    /// Of the original, from dense SH.
    pub dense: FrameRate,
    /// Of the compressed model, straight from codes.
    pub sparse: FrameRate,
}

/// One model compressed in one way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// The way it was compressed.
    pub setting: Setting,
    /// Bytes of the whole file.
    pub file_bytes: u64,
    /// Bytes of view-dependent colour in the file: dictionary, counts, indices, values, escapes.
    pub sh_bytes: u64,
    /// Bytes of colour in memory while drawing from codes, base colour included.
    pub resident_sh_bytes: u64,
    /// Atoms of the dictionary.
    pub atoms: usize,
    /// Nonzeros a Gaussian on average, an escape counting as a full vector.
    pub mean_nonzeros: f64,
    /// The paper's ratio: SH-rest coefficients over mean nonzeros. `None` where nothing is coded.
    pub coefficient_ratio: Option<f64>,
    /// Largest SH error of a Gaussian; `None` for packed files, which promise none.
    pub max_residual: Option<f64>,
    /// Gaussians over the tolerance; 0 unless nonzeros are capped.
    pub over_tolerance: u64,
    /// Scores of the compressed model against the original's pictures.
    pub to_original: Comparison,
    /// Scores of the compressed model against photos.
    pub to_photos: Option<Comparison>,
    /// Frames a second, if measured.
    pub fps: Option<Fps>,
    /// Seconds of compression, learning included.
    pub seconds: f64,
}

/// One model, with all its points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneResult {
    /// Data set, such as `Mip-NeRF 360`; empty if unknown.
    pub dataset: String,
    /// Scene, such as `bonsai`.
    pub name: String,
    /// Who trained it.
    pub method: Method,
    /// The model's file, by a name without folders of this machine.
    pub model: String,
    /// Number of Gaussians.
    pub gaussians: u64,
    /// SH degree.
    pub sh_degree: u8,
    /// Bytes of the file.
    pub ply_bytes: u64,
    /// Bytes of the file that a competitor ships instead, if the manifest names it.
    pub shipped_bytes: Option<u64>,
    /// Source of the views: a file's name, or `orbit` or `room`.
    pub views_from: String,
    /// Number of views.
    pub views: usize,
    /// Width and height of the first view's picture.
    pub size: [u32; 2],
    /// The device that drew pictures: `cpu`, or the GPU's name. FPS are of this device.
    pub device: String,
    /// Whether the device is a GPU.
    pub on_gpu: bool,
    /// Scores of the model as trained against photos.
    pub to_photos: Option<Comparison>,
    /// Frames a second of the model as trained, if measured.
    pub fps: Option<f64>,
    /// One for each setting.
    pub points: Vec<Point>,
}

impl SceneResult {
    /// The point at a setting.
    pub(crate) fn point(&self, setting: Setting) -> Option<&Point> {
        self.points.iter().find(|point| point.setting == setting)
    }
}

/// A model that could not be evaluated.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Skipped {
    /// Data set.
    pub dataset: String,
    /// Scene.
    pub name: String,
    /// Who trained it.
    pub method: Method,
    /// The reason.
    pub reason: String,
}

/// All results of a sweep.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Results {
    /// Version of the program.
    pub version: String,
    /// The command line.
    pub command: String,
    /// `omp` or `ols`.
    pub pursuit: String,
    /// Layout of files with exact geometry: `f16`, `f32` or `paper`.
    pub layout: String,
    /// Whether pictures were rounded to 8 bits before scoring.
    pub eight_bit: bool,
    /// Models that were evaluated, in the manifest's order.
    pub scenes: Vec<SceneResult>,
    /// Models that were not.
    pub skipped: Vec<Skipped>,
}

impl Results {
    /// The pursuit and the layout of files with exact geometry, for captions. Empty if they are not known.
    pub(crate) fn how(&self) -> String {
        let pursuit = match self.pursuit.as_str() {
            "" => return String::new(),
            "omp" => "OMP, the paper\u{2019}s (ours is OLS)".to_owned(),
            "ols" => "OLS, ours (the paper\u{2019}s is OMP)".to_owned(),
            other => other.to_owned(),
        };
        format!("Pursuit: {pursuit}. Layout: {}.", self.layout)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_and_methods_survive_a_file() {
        for setting in [Setting::Tolerance(0.03), Setting::MaxNonzeros(1), Setting::Preset(Preset::Balanced)]
        {
            let text = serde_json::to_string(&setting).unwrap();
            assert_eq!(serde_json::from_str::<Setting>(&text).unwrap(), setting, "{text}");
        }
        for method in Method::ALL {
            assert_eq!(method.name().parse::<Method>().unwrap(), method);
            assert_eq!(serde_json::to_string(&method).unwrap(), format!("\"{method}\""));
        }
        assert!("3DGS".parse::<Method>().is_err());
        assert_eq!(Setting::Tolerance(0.1).label(), "tol 0.1");
    }

    #[test]
    fn comparisons_survive_a_file() {
        use lexisplat_eval::ViewScore;
        use lexisplat_eval::metrics::Metric;
        let view = |psnr, flip| ViewScore::new("a", [3, 2], psnr, 0.5, [(Metric::Flip, flip)].into());
        let comparison = Comparison::of(vec![view(Some(31.5), 0.25), view(None, 0.5)]);
        assert_eq!(comparison.get(Metric::Flip).unwrap().mean, Some(0.375));
        assert_eq!(comparison.get(Metric::LpipsVgg), None);
        assert_eq!(comparison.metrics().collect::<Vec<_>>(), [Metric::Psnr, Metric::Ssim, Metric::Flip]);
        let text = serde_json::to_string(&comparison).unwrap();
        assert_eq!(serde_json::from_str::<Comparison>(&text).unwrap(), comparison, "{text}");
    }
}
