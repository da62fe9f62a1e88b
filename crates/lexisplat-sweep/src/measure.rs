//! What is measured of a compressed model, in one description for tables, figures and the page.

use lexisplat_eval::metrics::Metric;
use lexisplat_eval::{Comparison, FrameRate};

use crate::paper::Quantity;
use crate::table::Cell;
use crate::{Point, SceneResult};

/// What stands for the PSNR of pictures that do not differ.
pub(crate) const IDENTICAL: &str = "identical";
/// Digits of ratios, nonzeros, bytes a Gaussian and differences in dB, as the paper prints them.
pub(crate) const DIGITS: usize = 2;
/// Digits of frames a second, as the paper prints them.
const FPS_DIGITS: usize = 1;

/// A number known of a model at one setting.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Measure {
    /// A score against the original's pictures, averaged over views.
    ToOriginal(Metric),
    /// A score against photos, averaged over views.
    ToPhotos(Metric),
    /// PSNR against photos of the compressed minus that of the original, in dB. A loss is negative.
    PhotoChange,
    /// Nonzeros of a Gaussian on average.
    MeanNonzeros,
    /// The paper's ratio.
    CoefficientRatio,
    /// Bytes of the PLY over bytes of the file.
    FileRatio,
    /// Bytes of the file over Gaussians.
    BytesEach,
    /// Frames a second from codes.
    SparseFps,
    /// Frames a second of the original from dense SH.
    DenseFps,
    /// Frames from codes over frames from dense SH.
    Speedup,
    /// By how much the rounds of drawing from codes differ: half of the difference of the fastest and the slowest, in percent
    /// of the mean.
    SparseSpread,
    /// The same of the original from dense SH.
    DenseSpread,
}

impl Measure {
    /// The heading, with its unit. `device` is what frames were drawn on.
    pub(crate) fn heading(self, device: &str) -> String {
        match self {
            Self::ToOriginal(Metric::Psnr) | Self::ToPhotos(Metric::Psnr) | Self::PhotoChange => {
                "PSNR, dB".to_owned()
            }
            Self::ToOriginal(metric) | Self::ToPhotos(metric) => metric.title().to_owned(),
            Self::MeanNonzeros => "Mean nonzeros".to_owned(),
            Self::CoefficientRatio => "Comp Ratio (coefficients)".to_owned(),
            Self::FileRatio => "Ratio of whole files".to_owned(),
            Self::BytesEach => "Bytes a Gaussian".to_owned(),
            Self::SparseFps => format!("{device} FPS"),
            Self::DenseFps => format!("{device} FPS(-Comp)"),
            Self::Speedup => "Speedup".to_owned(),
            Self::SparseSpread => format!("{device} FPS, \u{b1}\u{a0}%"),
            Self::DenseSpread => format!("{device} FPS(-Comp), \u{b1}\u{a0}%"),
        }
    }

    /// The paper's quantity that this one is compared with. Its FPS are of another device. Its LPIPS is taken for
    /// the 3DGS repository's.
    pub(crate) fn in_paper(self) -> Option<Quantity> {
        match self {
            Self::ToOriginal(metric) | Self::ToPhotos(metric) => match metric {
                Metric::Psnr => Some(Quantity::Psnr),
                Metric::Ssim => Some(Quantity::Ssim),
                Metric::LpipsVggInria => Some(Quantity::Lpips),
                _ => None,
            },
            Self::CoefficientRatio => Some(Quantity::Ratio),
            _ => None,
        }
    }

    /// Digits after the point that tables print.
    pub(crate) fn digits(self) -> usize {
        match self {
            Self::ToOriginal(metric) | Self::ToPhotos(metric) => metric.digits(),
            Self::SparseFps | Self::DenseFps | Self::SparseSpread | Self::DenseSpread => FPS_DIGITS,
            _ => DIGITS,
        }
    }

    /// The comparison that a score is taken from, if it has views. Without a point it is that of the model as
    /// trained.
    fn comparison<'a>(
        self,
        scene: &'a SceneResult,
        point: Option<&'a Point>,
    ) -> Option<(&'a Comparison, Metric)> {
        let (comparison, metric) = match self {
            Self::ToOriginal(metric) => (&point?.to_original, metric),
            Self::ToPhotos(metric) => {
                (point.map_or(&scene.to_photos, |point| &point.to_photos).as_ref()?, metric)
            }
            _ => return None,
        };
        (!comparison.views.is_empty()).then_some((comparison, metric))
    }

    /// Whether this score was computed.
    pub(crate) fn is_measured(self, scene: &SceneResult, point: Option<&Point>) -> bool {
        self.comparison(scene, point).is_some_and(|(comparison, metric)| comparison.get(metric).is_some())
    }

    /// The number. Without a point it is that of the model as trained.
    pub(crate) fn value(self, scene: &SceneResult, point: Option<&Point>) -> Option<f64> {
        if let Some((comparison, metric)) = self.comparison(scene, point) {
            return comparison.get(metric)?.mean;
        }
        let point = point?;
        match self {
            Self::ToOriginal(_) | Self::ToPhotos(_) => None,
            Self::PhotoChange => {
                Some(point.to_photos.as_ref()?.psnr.mean? - scene.to_photos.as_ref()?.psnr.mean?)
            }
            Self::MeanNonzeros => Some(point.mean_nonzeros),
            Self::CoefficientRatio => point.coefficient_ratio,
            Self::FileRatio => quotient(scene.ply_bytes as f64, point.file_bytes as f64),
            Self::BytesEach => quotient(point.file_bytes as f64, scene.gaussians as f64),
            Self::SparseFps => Some(point.fps?.sparse.mean),
            Self::DenseFps => Some(point.fps?.dense.mean),
            Self::Speedup => quotient(point.fps?.sparse.mean, point.fps?.dense.mean),
            Self::SparseSpread => spread(point.fps?.sparse),
            Self::DenseSpread => spread(point.fps?.dense),
        }
    }

    /// The number as a cell. Pictures without any difference have no PSNR and are called identical.
    pub(crate) fn cell(self, scene: &SceneResult, point: Option<&Point>) -> Cell {
        match self.comparison(scene, point) {
            Some((comparison, Metric::Psnr)) if comparison.identical => Cell::text(IDENTICAL),
            _ if self == Self::PhotoChange => Cell::change(self.value(scene, point), self.digits()),
            _ => Cell::number(self.value(scene, point), self.digits()),
        }
    }
}

/// Half of the range of rounds in percent of their mean.
fn spread(rate: FrameRate) -> Option<f64> {
    Some(50.0 * quotient(rate.most - rate.least, rate.mean)?)
}

/// `a / b`, or `None` if `b` is not above 0.
pub(crate) fn quotient(a: f64, b: f64) -> Option<f64> {
    (b > 0.0).then(|| a / b)
}
