//! Running a sweep: every model, every setting; what is finished is kept at once.

use std::path::{Path, PathBuf};

use lexisplat_render::Renderer;

use super::kept::Kept;
use super::manifest::Entry;
use super::options::{SweepOptions, Watch};
use super::results::{Results, Skipped};
use super::runner::{Runner, Stop, file_start, settings};
use lexisplat_eval::Scorer;
use lexisplat_eval::{Error, Result};

/// A picture that a sweep saved: original, compressed, amplified difference, photo.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Saved {
    /// Place of the scene in [`Results::scenes`].
    pub scene: usize,
    /// The label of its [`super::Setting`].
    pub setting: String,
    /// The view's name.
    pub view: String,
    /// PNG files.
    pub original: PathBuf,
    /// See [`Self::original`].
    pub compressed: PathBuf,
    /// See [`Self::original`].
    pub difference: PathBuf,
    /// If there is one.
    pub photo: Option<PathBuf>,
}

/// Evaluates every entry into `folder`, where finished parts and pictures are kept.
///
/// Models that are not there, or cannot be evaluated, are skipped and listed with the reason.
///
/// # Errors
/// [`Error::Parameter`] for settings out of range, for two models of one name, or if nothing could be evaluated; what opening the device
/// says; what writing to `folder` says.
pub fn sweep(
    entries: &[Entry],
    options: &SweepOptions,
    scorer: &Scorer,
    folder: &Path,
    watch: &dyn Watch,
) -> Result<(Results, Vec<Saved>)> {
    options.check()?;
    for (i, entry) in entries.iter().enumerate() {
        if entries[..i].iter().any(|other| file_start(other) == file_start(entry)) {
            let expected = "another name, or another method: two models have these; a manifest can name them";
            return Err(Error::parameter("models", format!("{} by {}", entry.name, entry.method), expected));
        }
    }
    let gpu = options.device.open_gpu()?;
    let renderer = match &gpu {
        Some(gpu) => Renderer::on(gpu)?,
        None => Renderer::cpu(),
    };
    let pictures = folder.join("pictures");
    std::fs::create_dir_all(&pictures).map_err(|e| Error::io(&pictures, e))?;
    let kept = Kept::new(folder.join("points"), options.resume, &options.outputs)?;
    let mut runner = Runner { options, scorer, gpu, renderer, kept, pictures, watch };
    let parts = |entry: &Entry| 1 + settings(entry, options).len() as u64;
    watch.begin(entries.iter().map(parts).sum());
    let mut results = Results {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        pursuit: options.pursuit.name().to_owned(),
        layout: options.layout.name().to_owned(),
        eight_bit: options.eight_bit,
        ..Results::default()
    };
    let mut saved = Vec::new();
    for entry in entries {
        match runner.scene(entry, results.scenes.len()) {
            Ok((scene, pictures)) => {
                results.scenes.push(scene);
                saved.extend(pictures);
            }
            Err(Stop::All(error)) => return Err(error),
            Err(Stop::Scene(reason)) => {
                watch.warn(&entry.name, &format!("skipped: {reason}"));
                results.skipped.push(Skipped {
                    dataset: entry.dataset.clone(),
                    name: entry.name.clone(),
                    method: entry.method,
                    reason,
                });
            }
        }
    }
    match results.skipped.first() {
        Some(first) if results.scenes.is_empty() => {
            let expected = format!("at least one that can be evaluated (the first cannot: {})", first.reason);
            Err(Error::parameter("models", format!("{} models", entries.len()), expected))
        }
        _ => Ok((results, saved)),
    }
}
