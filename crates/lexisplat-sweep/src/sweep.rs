//! Evaluates all models of a sweep, one after the other.

use std::collections::HashSet;
use std::path::Path;

use lexisplat_compress::{Error, Result};
use lexisplat_eval::Scorer;
use lexisplat_render::Renderer;

use super::cache::Cache;
use super::manifest::Entry;
use super::options::{SweepOptions, SweepProgress};
use super::picture::PictureFiles;
use super::results::{Results, Skipped};
use super::scene::{Evaluator, Failure, file_start, settings, without_paths};

/// Evaluates every entry. Finished parts and pictures are stored in `folder`.
///
/// Models that do not exist or cannot be evaluated are skipped, and listed with the reason.
///
/// # Errors
/// [`Error::Parameter`] for settings out of range, for two models of the same name, and if no model can be evaluated.
/// Errors of preparing the GPU and of writing to `folder`, and [`lexisplat::Error::Cancelled`].
pub fn sweep(
    entries: &[Entry],
    options: &SweepOptions,
    scorer: &Scorer,
    folder: &Path,
    progress: &dyn SweepProgress,
) -> Result<(Results, Vec<PictureFiles>)> {
    options.check()?;
    let mut names = HashSet::new();
    for entry in entries {
        if !names.insert(file_start(entry)) {
            let expected = "another name or method: two models have these";
            return Err(Error::parameter("models", format!("{} by {}", entry.name, entry.method), expected));
        }
    }
    let renderer = match &options.gpu {
        Some(gpu) => Renderer::on(gpu)?,
        None => Renderer::cpu(),
    };
    let pictures = folder.join("pictures");
    std::fs::create_dir_all(&pictures).map_err(|e| Error::io(&pictures, e))?;
    let cache = Cache::new(folder.join("points"), options.resume, &options.outputs)?;
    let mut evaluator = Evaluator { options, scorer, renderer, cache, pictures, progress };
    let parts = |entry: &Entry| 1 + settings(entry, options).len() as u64;
    progress.start(entries.iter().map(parts).sum());
    let mut results = Results {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        pursuit: options.pursuit.name().to_owned(),
        layout: options.layout.name().to_owned(),
        eight_bit: options.drawing.eight_bit,
        ..Results::default()
    };
    let mut files = Vec::new();
    for entry in entries {
        match evaluator.scene(entry, results.scenes.len()) {
            Ok((scene, pictures)) => {
                results.scenes.push(scene);
                files.extend(pictures);
            }
            Err(Failure::Sweep(error)) => return Err(error),
            Err(Failure::Scene(reason)) => {
                progress.warn(&entry.name, &format!("skipped: {reason}"));
                results.skipped.push(Skipped {
                    dataset: entry.dataset.clone(),
                    name: entry.name.clone(),
                    method: entry.method,
                    reason: without_paths(&reason, entry),
                });
            }
        }
    }
    match results.skipped.first() {
        Some(first) if results.scenes.is_empty() => {
            let expected = format!("at least one that can be evaluated (the first cannot: {})", first.reason);
            Err(Error::parameter("models", format!("{} models", entries.len()), expected))
        }
        _ => Ok((results, files)),
    }
}
