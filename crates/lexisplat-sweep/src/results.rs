//! The results of a sweep.

use std::fmt;
use std::str::FromStr;

use lexisplat::packed::Preset;
use serde::{Deserialize, Serialize};

use lexisplat_compress::{Error, Result};
use lexisplat_eval::{Comparison, FrameRate};

/// The method that trained a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Trainer of the 3DGS authors.
    #[serde(rename = "3dgs")]
    Gs3d,
    /// 3DGS-MCMC.
    Mcmc,
    /// Pixel-GS.
    #[serde(rename = "pixelgs")]
    PixelGs,
    /// EAGLES, decoded to a PLY. It is the paper's competitor, with scalar quantisation.
    Eagles,
    /// EAGLES trained without scalar quantisation.
    EaglesNoSq,
    /// Any other method.
    Other,
}

impl Method {
    /// All methods, in the order of the paper.
    pub(crate) const ALL: [Self; 6] =
        [Self::Gs3d, Self::Mcmc, Self::PixelGs, Self::Eagles, Self::EaglesNoSq, Self::Other];

    /// Returns the name in files and manifests, and the name for people, as in the paper.
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

    /// Returns the name in files and manifests.
    pub(crate) fn name(self) -> &'static str {
        self.names().0
    }

    /// Returns the name for people, as in the paper.
    pub(crate) fn title(self) -> &'static str {
        self.names().1
    }

    /// Returns whether the method compresses by itself. Its models are only scored, not compressed.
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

/// A way of compressing models.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Setting {
    /// Exact geometry, and SH within this un-squared L2 norm. The paper has settings of this kind.
    Tolerance(f64),
    /// Exact geometry, and at most this many nonzeros for each Gaussian, without a tolerance.
    MaxNonzeros(u8),
    /// A packed file with this preset. Everything is quantised.
    Preset(#[serde(with = "by_name")] Preset),
}

impl Setting {
    /// Returns a short name, unique within a sweep: `tol 0.1`, `nnz 1`, `balanced`.
    #[must_use]
    pub fn label(self) -> String {
        match self {
            Self::Tolerance(tolerance) => format!("tol {tolerance}"),
            Self::MaxNonzeros(most) => format!("nnz {most}"),
            Self::Preset(preset) => preset.name().to_owned(),
        }
    }
}

/// Serialises presets by name.
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

/// Frame rates, measured in turn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fps {
    /// Frame rate of the original, drawn from dense SH.
    pub dense: FrameRate,
    /// Frame rate of the compressed model, drawn directly from codes.
    pub sparse: FrameRate,
}

/// One model compressed in one way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// The way of compressing.
    pub setting: Setting,
    /// Bytes of the whole file.
    pub file_bytes: u64,
    /// Bytes of view-dependent colour in the file: dictionary, counts, indices, values, escapes.
    pub sh_bytes: u64,
    /// Bytes of colour in memory while drawing from codes, base colour included.
    pub resident_sh_bytes: u64,
    /// Number of atoms of the dictionary.
    pub atoms: usize,
    /// Mean number of nonzeros of a Gaussian. An escape counts as a vector without zeros.
    pub mean_nonzeros: f64,
    /// The paper's ratio: number of SH-rest coefficients over the mean number of nonzeros. `None` if nothing is coded.
    pub coefficient_ratio: Option<f64>,
    /// Largest SH error of a Gaussian; `None` for packed files, which have no bound.
    pub max_residual: Option<f64>,
    /// Number of Gaussians over the tolerance; 0 unless nonzeros are capped.
    pub over_tolerance: u64,
    /// Scores of the compressed model against the original's pictures.
    pub to_original: Comparison,
    /// Scores of the compressed model against photos.
    pub to_photos: Option<Comparison>,
    /// Frame rates, if measured.
    pub fps: Option<Fps>,
    /// Seconds of compression, learning included.
    pub seconds: f64,
}

/// One model, with all its points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneResult {
    /// Name of the data set, such as `Mip-NeRF 360`; empty if unknown.
    pub dataset: String,
    /// Name of the scene, such as `bonsai`.
    pub name: String,
    /// Method that trained the model.
    pub method: Method,
    /// Name of the model's file, without folders of this machine.
    pub model: String,
    /// Number of Gaussians.
    pub gaussians: u64,
    /// SH degree.
    pub sh_degree: u8,
    /// Bytes of the file.
    pub ply_bytes: u64,
    /// Bytes of the file that a competitor ships instead, if the manifest names it.
    pub shipped_bytes: Option<u64>,
    /// Source of the views: the name of a file, or `orbit` or `room`.
    pub views_from: String,
    /// Number of views.
    pub views: usize,
    /// Width and height of the first view's picture.
    pub size: [u32; 2],
    /// Device that drew the pictures: `cpu`, or the name of a GPU. Frame rates are of this device.
    pub device: String,
    /// Whether the device is a GPU.
    pub on_gpu: bool,
    /// Scores of the model as trained against photos.
    pub to_photos: Option<Comparison>,
    /// Frames per second of the model as trained, if measured.
    pub fps: Option<f64>,
    /// Results at each setting.
    pub points: Vec<Point>,
}

impl SceneResult {
    /// Returns the point at a setting.
    pub(crate) fn point(&self, setting: Setting) -> Option<&Point> {
        self.points.iter().find(|point| point.setting == setting)
    }
}

/// A model that could not be evaluated.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Skipped {
    /// Name of the data set.
    pub dataset: String,
    /// Name of the scene.
    pub name: String,
    /// Method that trained the model.
    pub method: Method,
    /// Reason for skipping the model.
    pub reason: String,
}

/// All results of a sweep.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Results {
    /// Version of the program.
    pub version: String,
    /// The command line.
    pub command: String,
    /// Pursuit of files with exact geometry: `omp` or `ols`.
    pub pursuit: String,
    /// Layout of files with exact geometry: `f16`, `f32` or `paper`.
    pub layout: String,
    /// Whether pictures were rounded to 8 bits before scoring.
    pub eight_bit: bool,
    /// Models that were evaluated, in the order of the manifest.
    pub scenes: Vec<SceneResult>,
    /// Models that were not evaluated.
    pub skipped: Vec<Skipped>,
}

impl Results {
    /// Returns the pursuit and the layout of files with exact geometry, for captions. The text is empty if they are not
    /// known.
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
