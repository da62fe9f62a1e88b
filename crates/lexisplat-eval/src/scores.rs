//! Scores of views, and their summaries.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::metrics::Metric;

/// The score of one view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ViewScore {
    /// The camera's name.
    pub name: String,
    /// Width of the picture, in pixels.
    pub width: u32,
    /// Height of the picture, in pixels.
    pub height: u32,
    /// PSNR in dB; `None` if the pictures are identical.
    pub psnr: Option<f64>,
    /// SSIM; 1 if the pictures are identical.
    pub ssim: f64,
    /// Whether the clipped pictures are identical.
    pub identical: bool,
    /// Values of all other metrics that were measured.
    #[serde(flatten)]
    pub more: BTreeMap<Metric, f64>,
}

impl ViewScore {
    /// Returns the score of a view whose picture has the `size` width and height, in pixels. `psnr` is in dB; `None`
    /// means that the pictures are identical.
    #[must_use]
    pub fn new(
        name: &str,
        size: [u32; 2],
        psnr: Option<f64>,
        ssim: f64,
        more: BTreeMap<Metric, f64>,
    ) -> Self {
        let ([width, height], identical) = (size, psnr.is_none());
        Self { name: name.to_owned(), width, height, psnr, ssim, identical, more }
    }

    /// Returns the value of `metric`; `None` if it was not measured, and for the infinite PSNR of identical pictures.
    #[must_use]
    pub fn get(&self, metric: Metric) -> Option<f64> {
        match metric {
            Metric::Psnr => self.psnr,
            Metric::Ssim => Some(self.ssim),
            _ => self.more.get(&metric).copied(),
        }
    }
}

/// Mean, minimum and maximum over views. All are `None` if there are no views.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Arithmetic mean.
    pub mean: Option<f64>,
    /// Smallest value.
    pub min: Option<f64>,
    /// Largest value.
    pub max: Option<f64>,
}

/// The name of a statistic, and the function that returns it.
type Statistic = (&'static str, fn(&Summary) -> Option<f64>);

impl Summary {
    /// The names of the statistics, and the functions that return them.
    pub const STATISTICS: [Statistic; 3] =
        [("mean", |s| s.mean), ("minimum", |s| s.min), ("maximum", |s| s.max)];

    /// Returns the summary of `values`.
    #[must_use]
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let values: Vec<f64> = values.into_iter().collect();
        Self {
            mean: (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64),
            min: values.iter().copied().reduce(f64::min),
            max: values.iter().copied().reduce(f64::max),
        }
    }
}

/// The scores of all views.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Comparison {
    /// Whether the pictures of every view are identical.
    pub identical: bool,
    /// Summary of PSNR over the views that are not identical. Identical views have an infinite PSNR.
    pub psnr: Summary,
    /// Summary of SSIM over all views.
    pub ssim: Summary,
    /// Summaries of all other metrics that were measured, over all views.
    #[serde(flatten)]
    pub more: BTreeMap<Metric, Summary>,
    /// Score of each view, in the order of the cameras.
    pub views: Vec<ViewScore>,
}

impl Comparison {
    /// Returns the comparison with these views.
    #[must_use]
    pub fn of(views: Vec<ViewScore>) -> Self {
        Self {
            identical: views.iter().all(|v| v.identical),
            psnr: Summary::of(views.iter().filter_map(|v| v.psnr)),
            ssim: Summary::of(views.iter().map(|v| v.ssim)),
            more: Metric::ALL
                .into_iter()
                .map(|metric| (metric, views.iter().filter_map(move |v| v.more.get(&metric)).copied()))
                .map(|(metric, values)| (metric, Summary::of(values)))
                .filter(|(_, summary)| summary.mean.is_some())
                .collect(),
            views,
        }
    }

    /// Returns the summary of `metric`; `None` if it was not measured.
    #[must_use]
    pub fn get(&self, metric: Metric) -> Option<Summary> {
        match metric {
            Metric::Psnr => Some(self.psnr),
            Metric::Ssim => Some(self.ssim),
            _ => self.more.get(&metric).copied(),
        }
    }

    /// Returns the metrics that were measured, in the order of tables.
    pub fn metrics(&self) -> impl Iterator<Item = Metric> {
        Metric::ALL.into_iter().filter(|&metric| self.get(metric).is_some())
    }
}
