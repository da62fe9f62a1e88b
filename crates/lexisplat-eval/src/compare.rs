//! Two scenes drawn from the same cameras, scored view by view. No photos needed.

use std::collections::BTreeMap;

use lexisplat_render::{Camera, Image, RenderOptions, Renderer, Scene};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::metrics::Metric;
use crate::scorer::Scorer;

/// How to compare.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct CompareOptions {
    /// Colour behind both scenes. Default black.
    pub background: [f32; 3],
    /// Round both pictures to 8 bits first, as when they are saved and read back. Default no.
    pub eight_bit: bool,
}

impl CompareOptions {
    /// Options with the given background and rounding.
    #[must_use]
    pub fn new(background: [f32; 3], eight_bit: bool) -> Self {
        Self { background, eight_bit }
    }
}

/// The score of one view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ViewScore {
    /// The camera's name.
    pub name: String,
    /// Picture size in pixels.
    pub width: u32,
    /// Picture size in pixels.
    pub height: u32,
    /// PSNR in dB; `None` if the pictures are identical.
    pub psnr: Option<f64>,
    /// SSIM; 1 if the pictures are identical.
    pub ssim: f64,
    /// Whether the clipped pictures are identical.
    pub identical: bool,
    /// What else was measured, by name.
    #[serde(flatten)]
    pub more: BTreeMap<Metric, f64>,
}

impl ViewScore {
    /// The score of a view of `size` (width and height in pixels). Without a `psnr`, in dB, the pictures are
    /// identical.
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

    /// A score, if it was measured; an infinite PSNR is not a number.
    #[must_use]
    pub fn get(&self, metric: Metric) -> Option<f64> {
        match metric {
            Metric::Psnr => self.psnr,
            Metric::Ssim => Some(self.ssim),
            _ => self.more.get(&metric).copied(),
        }
    }
}

/// Mean, minimum and maximum over views. All `None` over no views.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Arithmetic mean.
    pub mean: Option<f64>,
    /// Smallest.
    pub min: Option<f64>,
    /// Largest.
    pub max: Option<f64>,
}

impl Summary {
    /// The summary of `values`.
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
    /// Whether every view is identical.
    pub identical: bool,
    /// PSNR over the views that are not identical: an infinite one would drown the rest.
    pub psnr: Summary,
    /// SSIM over all views.
    pub ssim: Summary,
    /// What else was measured, over all views.
    #[serde(flatten)]
    pub more: BTreeMap<Metric, Summary>,
    /// Each view, in the cameras' order.
    pub views: Vec<ViewScore>,
}

impl Comparison {
    /// Puts scored views together.
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

    /// The summary of what was measured; `None` if it was not.
    #[must_use]
    pub fn get(&self, metric: Metric) -> Option<Summary> {
        match metric {
            Metric::Psnr => Some(self.psnr),
            Metric::Ssim => Some(self.ssim),
            _ => self.more.get(&metric).copied(),
        }
    }

    /// What was measured, in the order of tables.
    pub fn metrics(&self) -> impl Iterator<Item = Metric> {
        Metric::ALL.into_iter().filter(|&metric| self.get(metric).is_some())
    }
}

/// Scores picture `b` against `a` by PSNR and SSIM.
///
/// # Errors
/// [`Error::Parameter`] if their sizes differ.
pub fn score(name: &str, a: &Image, b: &Image) -> Result<ViewScore> {
    Scorer::new().score(name, a, b)
}

/// Draws `a` and `b` with `renderer` from every camera and scores `b` against `a`. `on_view` sees each view
/// when it is done, with both pictures as they were scored.
///
/// # Errors
/// [`Error::Parameter`] if there are no cameras, or one cannot be drawn with; on a GPU [`Error::Render`] if a
/// scene or view does not fit.
pub fn compare(
    renderer: &mut Renderer,
    a: &Scene<'_>,
    b: &Scene<'_>,
    cameras: &[Camera],
    options: &CompareOptions,
    on_view: &mut dyn FnMut(&ViewScore, &Image, &Image),
) -> Result<Comparison> {
    if cameras.is_empty() {
        return Err(Error::parameter("cameras", "none", "at least one view"));
    }
    let drawing = RenderOptions::default().with_background(options.background);
    let (a, b) = (renderer.prepare(*a)?, renderer.prepare(*b)?);
    let mut views = Vec::with_capacity(cameras.len());
    for camera in cameras {
        let mut draw = |scene| {
            let image = renderer.render(scene, camera, &drawing)?;
            if options.eight_bit {
                Image::from_8bit(image.width, image.height, &image.to_8bit())
            } else {
                Ok(image)
            }
        };
        let (image_a, image_b) = (draw(&a)?, draw(&b)?);
        let view = score(&camera.name, &image_a, &image_b)?;
        on_view(&view, &image_a, &image_b);
        views.push(view);
    }
    Ok(Comparison::of(views))
}
