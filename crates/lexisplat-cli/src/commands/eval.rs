//! `lexisplat eval`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Result;
use lexisplat::Progress as _;
use lexisplat_compress::views::{ChosenViews, View, ViewOptions, find_views, photo};
use lexisplat_compress::{DrawOptions, draw_views};
use lexisplat_eval::{Comparison, SceneFile, Scorer, Whereabouts, format, misfit, montage, png, score_views};
use lexisplat_render::{Camera, Image};
use serde::Serialize;

use super::scores::ScoreTable;
use crate::args::{Common, Eval, Measures};
use crate::device::open_renderer;
use crate::files::{
    check_free, check_output, load, make_folder, tell, view_name, warn, warn_of, write_bytes,
};
use crate::progress::Bars;
use crate::stop::{self, Work};

/// Narrowest column of scores, in characters.
const LEAST_COLUMN: usize = 9;

/// The scores of models.
#[derive(Serialize)]
struct Report<'a> {
    original: Option<String>,
    images: Option<String>,
    views_from: &'a str,
    views: usize,
    device: &'a str,
    eight_bit: bool,
    models: Vec<Scored>,
    warnings: Vec<String>,
}

/// The scores of a model.
#[derive(Serialize)]
struct Scored {
    file: String,
    bytes: u64,
    gaussians: usize,
    to_photos: Option<Comparison>,
    to_original: Option<Comparison>,
}

impl Scored {
    /// Returns the comparisons that exist, each with the word for its reference.
    fn comparisons(&self) -> impl Iterator<Item = (&'static str, &Comparison)> {
        [("photos", &self.to_photos), ("original", &self.to_original)]
            .into_iter()
            .filter_map(|(name, comparison)| Some((name, comparison.as_ref()?)))
    }
}

pub(crate) fn run(args: &Eval, common: &Common) -> Result<()> {
    if args.original.is_none() && args.photos.images.is_none() {
        let expected = "--images, --original, or both: something to score against";
        return Err(lexisplat::Error::parameter("eval", "neither photos nor an original", expected).into());
    }
    if let Some(path) = &args.csv {
        check_output(path, &[], common.overwrite)?;
    }
    if args.csv.is_some() || args.save_views.is_some() {
        stop::while_writing(Work::Files(usize::MAX));
    }
    let scorer = scorer(&args.measures)?;
    let mut renderer = open_renderer(args.views.device)?;
    let drawing = DrawOptions::new(args.views.background, args.measures.eight_bit);
    // Generated views are made for the original, and all models are drawn from the same views.
    let original = args.original.as_deref().map(|path| load(path, common)).transpose()?;
    let first = match &original {
        Some(_) => None,
        None => Some(load(&args.models[0], common)?),
    };
    let Some(reference) = original.as_ref().or(first.as_ref()) else { return Ok(()) };
    let (offset, whereabouts) = (reference.scene().meta().offset, Whereabouts::of(&reference.scene()));
    let options = ViewOptions { offset, ..args.views.options(Some(&args.photos)) };
    let found = find_views(&options, reference.scene().geometry())?;
    warn("views", &found.warnings);
    let cameras: Vec<Camera> = found.views.iter().map(|view| view.camera.clone()).collect();
    let bars = Bars::new(common.quiet);
    let photos = photos(&found, args.views.background, &bars)?;
    let originals = match &original {
        Some(original) => {
            warn_of(original);
            draw_views(&mut renderer, &original.scene(), &cameras, &drawing, &bars)?
        }
        None => Vec::new(),
    };
    let mut models = Vec::new();
    let mut warnings = found.warnings;
    let mut first = first;
    for path in &args.models {
        let mut model = match first.take() {
            Some(model) => model,
            None => load(path, common)?,
        };
        model.align(&whereabouts);
        warn_of(&model);
        let drawn = draw_views(&mut renderer, &model.scene(), &cameras, &drawing, &bars)?;
        let against = |references: &[Image]| {
            let given = !references.is_empty();
            given.then(|| score_views(&scorer, &cameras, references, &drawn, &bars)).transpose()
        };
        let (to_photos, to_original) = (against(&photos)?, against(&originals)?);
        let misfits = misfit(&model.name, &drawn, drawing.background, to_photos.as_ref());
        warn("views", &misfits);
        warnings.extend(misfits);
        if let Some(folder) = &args.save_views {
            let references = if photos.is_empty() { &originals } else { &photos };
            let folder = folder.join(path.file_name().unwrap_or_default());
            save(&folder, &cameras, references, &drawn, common, &bars)?;
        }
        let SceneFile { name, bytes, .. } = &model;
        let gaussians = model.scene().len();
        models.push(Scored { file: name.clone(), bytes: *bytes, gaussians, to_photos, to_original });
    }
    if let Some(path) = &args.csv {
        write_bytes(path, csv(&models)?.as_bytes(), common.overwrite)?;
    }
    let name = |path: &Option<PathBuf>| path.as_ref().map(|path| path.display().to_string());
    let report = Report {
        original: name(&args.original),
        images: name(&args.photos.images),
        views_from: &found.from,
        views: cameras.len(),
        device: renderer.name(),
        eight_bit: args.measures.eight_bit,
        models,
        warnings,
    };
    tell(common, &report, || table(&report))
}

/// Returns the scorer for these options.
pub(crate) fn scorer(measures: &Measures) -> Result<Scorer> {
    let mut scorer = Scorer::new();
    if !measures.no_flip {
        scorer = scorer.with_flip();
    }
    for path in &measures.lpips {
        scorer = scorer.with_lpips(lexisplat_eval::metrics::Lpips::load(path)?);
    }
    Ok(scorer)
}

/// Reads the photos of views, in order. Returns none if the views have no photos.
fn photos(found: &ChosenViews, background: [f32; 3], bars: &Bars) -> Result<Vec<Image>> {
    let with_photos: Vec<&View> = found.views.iter().filter(|view| view.photo.is_some()).collect();
    bars.start("reading", "photos", with_photos.len() as u64);
    let read = |view: &View| {
        let photo = photo(view, background);
        bars.advance(1);
        photo
    };
    let photos = with_photos.into_iter().map(read).collect::<Result<_, _>>()?;
    bars.end();
    Ok(photos)
}

fn save(
    folder: &Path,
    cameras: &[Camera],
    references: &[Image],
    drawn: &[Image],
    common: &Common,
    bars: &Bars,
) -> Result<()> {
    make_folder(folder)?;
    bars.start("saving", "pictures", drawn.len() as u64);
    for (i, (camera, (a, b))) in cameras.iter().zip(references.iter().zip(drawn)).enumerate() {
        let path = folder.join(view_name(i, cameras.len(), &camera.name));
        check_free(&path, &[], common.overwrite)?;
        let (width, height, pixels) = montage::montage(a, b);
        write_bytes(&path, &png(width, height, &pixels)?, common.overwrite)?;
        bars.advance(1);
    }
    bars.end();
    Ok(())
}

fn csv(scored: &[Scored]) -> Result<String> {
    let mut out = String::from("model,against,view,width,height,metric,value\n");
    for model in scored {
        for (against, comparison) in model.comparisons() {
            for view in &comparison.views {
                for metric in comparison.metrics() {
                    let value = view.get(metric).map(|v| v.to_string()).unwrap_or_default();
                    let (file, name) = (quoted(&model.file), quoted(&view.name));
                    let (width, height) = (view.width, view.height);
                    writeln!(out, "{file},{against},{name},{width},{height},{},{value}", metric.name())?;
                }
            }
        }
    }
    Ok(out)
}

/// Returns a field of a CSV file (RFC 4180).
fn quoted(text: &str) -> String {
    let text = &*format::csv_cell(text);
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

fn table(report: &Report<'_>) -> Result<String> {
    let mut out = String::new();
    for model in &report.models {
        for (against, comparison) in model.comparisons() {
            writeln!(out, "{} against {against}", model.file)?;
            let scores = ScoreTable::new(
                comparison,
                |m| m.title().len().max(LEAST_COLUMN),
                |metric, value| {
                    value.map_or_else(|| "identical".to_owned(), |v| format!("{v:.*}", metric.digits()))
                },
            );
            scores.views(&mut out)?;
            scores.summary(&mut out)?;
            writeln!(out)?;
        }
        let (bytes, count) = (format::bytes(model.bytes), format::count(model.gaussians as u64));
        writeln!(out, "{bytes:>10}  {}: {count} Gaussians", model.file)?;
    }
    let photos = if report.images.is_some() { ", each with a photo" } else { "" };
    writeln!(out, "{:>10}  views from {}{photos}", report.views, report.views_from)?;
    writeln!(out, "{:>10}  {}", "drawn on", report.device)?;
    let rounded = if report.eight_bit { "rounded to 8 bits" } else { "not rounded" };
    writeln!(out, "{:>10}  {rounded} before scoring", "pictures")?;
    Ok(out)
}
