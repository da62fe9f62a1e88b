//! The measures of a compressed model, described once for tables, figures and the page.

use lexisplat_eval::metrics::Metric;
use lexisplat_eval::{Comparison, FrameRate};

use crate::numbers::{number, signed};
use crate::{Point, SceneResult};

/// Number of digits of ratios, nonzeros, bytes per Gaussian and differences in dB, as in the paper.
const DIGITS: usize = 2;
/// Number of digits of frames per second, as in the paper.
const FPS_DIGITS: usize = 1;
/// Text instead of the PSNR of identical pictures.
const IDENTICAL: &str = "identical";

/// A measure of a model at one setting.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Measure {
    /// Score against the original's pictures, averaged over views.
    ToOriginal(Metric),
    /// Score against photos, averaged over views.
    ToPhotos(Metric),
    /// PSNR against photos of the compressed model minus that of the original, in dB. A loss is negative.
    PhotoChange,
    /// Mean number of nonzeros of a Gaussian.
    MeanNonzeros,
    /// The paper's ratio.
    CoefficientRatio,
    /// Bytes of the PLY over bytes of the file.
    FileRatio,
    /// Bytes of the file over the number of Gaussians.
    BytesEach,
    /// Frames per second of the compressed model, drawn from codes.
    SparseFps,
    /// Frames per second of the original, drawn from dense SH.
    DenseFps,
    /// Frame rate from codes over frame rate from dense SH.
    Speedup,
    /// Spread of the rounds of drawing from codes: half of the difference of the fastest and the slowest round, in
    /// percent of the mean.
    SparseSpread,
    /// Spread of the rounds of drawing the original from dense SH, in the same unit.
    DenseSpread,
}

impl Measure {
    /// Returns the heading, with its unit.
    pub(crate) fn heading(self) -> &'static str {
        match self {
            Self::ToOriginal(Metric::Psnr) | Self::ToPhotos(Metric::Psnr) => "PSNR, dB",
            Self::ToOriginal(metric) | Self::ToPhotos(metric) => metric.title(),
            Self::PhotoChange => "Change, dB",
            Self::MeanNonzeros => "Mean nonzeros",
            Self::CoefficientRatio => "Comp Ratio",
            Self::FileRatio => "Ratio of whole files",
            Self::BytesEach => "Bytes a Gaussian",
            Self::SparseFps => "From codes",
            Self::DenseFps => "Dense SH",
            Self::Speedup => "Speedup",
            Self::SparseSpread | Self::DenseSpread => "\u{b1}\u{a0}%",
        }
    }

    /// Returns the number as text for people; a dash if there is none.
    pub(crate) fn shown(self, value: Option<f64>) -> String {
        match (self, value) {
            (Self::ToOriginal(Metric::Psnr) | Self::ToPhotos(Metric::Psnr), Some(f64::INFINITY)) => {
                IDENTICAL.to_owned()
            }
            (Self::ToOriginal(metric) | Self::ToPhotos(metric), _) => number(value, metric.digits()),
            (Self::PhotoChange, Some(value)) => signed(value, DIGITS),
            (Self::SparseFps | Self::DenseFps | Self::SparseSpread | Self::DenseSpread, _) => {
                number(value, FPS_DIGITS)
            }
            _ => number(value, DIGITS),
        }
    }

    /// Returns the number. Without a point it is the number of the model as trained. The PSNR of identical pictures is
    /// infinite.
    pub(crate) fn value(self, scene: &SceneResult, point: Option<&Point>) -> Option<f64> {
        let score = |comparison: Option<&Comparison>, metric: Metric| {
            let comparison = comparison.filter(|comparison| !comparison.views.is_empty())?;
            let is_identical = metric == Metric::Psnr && comparison.identical;
            if is_identical { Some(f64::INFINITY) } else { comparison.get(metric)?.mean }
        };
        let bytes =
            point.map_or(scene.shipped_bytes, |point| Some(point.file_bytes)).map(|bytes| bytes as f64);
        let fps = point.and_then(|point| point.fps);
        match self {
            Self::ToOriginal(metric) => score(Some(&point?.to_original), metric),
            Self::ToPhotos(metric) => {
                score(point.map_or(&scene.to_photos, |point| &point.to_photos).as_ref(), metric)
            }
            Self::PhotoChange => {
                Some(point?.to_photos.as_ref()?.psnr.mean? - scene.to_photos.as_ref()?.psnr.mean?)
            }
            Self::MeanNonzeros => Some(point?.mean_nonzeros),
            Self::CoefficientRatio => point?.coefficient_ratio,
            Self::FileRatio => quotient(scene.ply_bytes as f64, bytes?),
            Self::BytesEach => quotient(bytes?, scene.gaussians as f64),
            Self::SparseFps => Some(fps?.sparse.mean),
            Self::DenseFps => Some(fps?.dense.mean),
            Self::Speedup => quotient(fps?.sparse.mean, fps?.dense.mean),
            Self::SparseSpread => spread(fps?.sparse),
            Self::DenseSpread => spread(fps?.dense),
        }
    }
}

/// Returns the mean of the finite `values`. If none is finite and one is infinite, returns infinity, because all pictures
/// are identical then.
pub(crate) fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.collect();
    let finite: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    match finite.len() {
        0 => values.into_iter().find(|value| *value == f64::INFINITY),
        count => Some(finite.iter().sum::<f64>() / count as f64),
    }
}

/// Returns half of the range of the rounds, in percent of their mean.
fn spread(rate: FrameRate) -> Option<f64> {
    Some(50.0 * quotient(rate.most - rate.least, rate.mean)?)
}

/// Returns `a / b`; `None` if `b` is not above 0.
fn quotient(a: f64, b: f64) -> Option<f64> {
    (b > 0.0).then(|| a / b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_skip_what_is_missing() {
        assert_eq!(mean([1.0, f64::NAN, 4.0, f64::INFINITY].into_iter()), Some(2.5));
        assert_eq!(mean([f64::NAN, f64::INFINITY].into_iter()), Some(f64::INFINITY));
        assert_eq!(mean([f64::NAN].into_iter()), None);
        assert_eq!(Measure::ToPhotos(Metric::Psnr).shown(Some(f64::INFINITY)), IDENTICAL);
        assert_eq!(Measure::PhotoChange.shown(Some(-1.0)), "-1.00");
        assert_eq!(Measure::PhotoChange.shown(None), "\u{2013}");
    }
}
