//! `lexisplat sweep`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::Result;
use lexisplat::{Progress, Stage};
use lexisplat_compress::{DrawOptions, Error, SplitFilter};
use lexisplat_eval::{Comparison, format};
use lexisplat_sweep::{
    Entry, Results, Setting, SweepOptions, SweepProgress, fingerprint, read_manifest, shown_path, sweep,
    write_report,
};
use serde::Serialize;

use super::eval::scorer;
use crate::args::{Common, Sweep};
use crate::device::open_gpu;
use crate::exit::OutputExists;
use crate::files::{make_folder, note, outputs, tell};
use crate::progress::Bars;
use crate::stop::{self, Work};

/// Folder of finished parts. A folder that contains it is the output of a sweep.
const PARTS: &str = "points";
/// Number of columns of the summary with text. The other columns have numbers.
const TEXT_COLUMNS: usize = 3;

/// The outputs of a sweep.
#[derive(Serialize)]
struct Report<'a> {
    output: String,
    files: Vec<String>,
    parts_reused: u64,
    parts_made: u64,
    results: &'a Results,
}

pub(crate) fn run(args: &Sweep, common: &Common) -> Result<()> {
    let folder = &args.output;
    check_folder(folder, common.overwrite)?;
    let entries = entries(args)?;
    let scorer = scorer(&args.measures)?;
    let options = options(args, common)?;
    stop::while_writing(Work::Resumable);
    make_folder(folder)?;
    let progress =
        Shown { bars: Bars::new(common.quiet), reused: AtomicU64::new(0), made: AtomicU64::new(0) };
    let outcome = sweep(&entries, &options, &scorer, folder, &progress);
    progress.bars.end_parts();
    let (mut results, pictures) = outcome?;
    results.command = command();
    let files = write_report(folder, &results, &pictures, args.date.as_deref(), outputs())?;
    let report = Report {
        output: folder.display().to_string(),
        files: files.iter().map(|path| path.display().to_string()).collect(),
        parts_reused: progress.reused.load(Ordering::Relaxed),
        parts_made: progress.made.load(Ordering::Relaxed),
        results: &results,
    };
    tell(common, &report, || summary(folder, &results, &progress))
}

/// Returns an error for a folder that holds something other than a sweep.
fn check_folder(folder: &Path, overwrite: bool) -> Result<()> {
    let used = std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    if (used || folder.is_file()) && !folder.join(PARTS).is_dir() && !overwrite {
        return Err(OutputExists(folder.display().to_string()).into());
    }
    Ok(())
}

fn entries(args: &Sweep) -> Result<Vec<Entry>> {
    if let Some(path) = &args.manifest {
        return Ok(read_manifest(path, args.root.as_deref())?);
    }
    let mut entries: Vec<Entry> = args.models.iter().map(|model| Entry::of_model(model)).collect();
    if args.names.len() > entries.len() {
        let expected = format!("at most one name for each of the {} models", entries.len());
        return Err(Error::parameter("name", format!("{} names", args.names.len()), expected).into());
    }
    for (entry, name) in entries.iter_mut().zip(&args.names) {
        entry.name.clone_from(name);
    }
    for entry in &mut entries {
        entry.method = args.method;
        entry.cameras.clone_from(&args.views.cameras);
        entry.images.clone_from(&args.photos.images);
        entry.resolution = args.photos.resolution;
        entry.near = args.views.near;
        entry.split = args.views.split.unwrap_or(SplitFilter::Test);
    }
    Ok(entries)
}

fn options(args: &Sweep, common: &Common) -> Result<SweepOptions> {
    let mut options = SweepOptions::default();
    options.limits = common.limits()?;
    let is_default = args.max_nonzeros.is_empty() && args.presets.is_empty() && args.tol.is_empty();
    if !is_default {
        let tolerances = args.tol.iter().copied().map(Setting::Tolerance);
        let caps = args.max_nonzeros.iter().copied().map(Setting::MaxNonzeros);
        let presets = args.presets.iter().copied().map(Setting::Preset);
        options.settings = tolerances.chain(caps).chain(presets).collect();
    }
    options.pursuit = args.pursuit;
    options.layout = args.layout;
    options.seed = args.seed;
    options.drawing = DrawOptions::new(args.views.background, args.measures.eight_bit);
    options.fps = !args.no_fps;
    options.views = args.views.options(None);
    options.gpu = open_gpu(args.views.device)?;
    options.pictures = args.pictures;
    options.resume = !args.fresh;
    options.outputs = outputs().clone();
    options.fingerprint = weights(&args.measures.lpips)?;
    Ok(options)
}

/// Returns a text that tells files of weights apart. Files of one network have the same size whatever weights they hold,
/// so their checksums are in it.
fn weights(files: &[PathBuf]) -> Result<String> {
    let mut text = String::new();
    for path in files {
        write!(text, "{} {}; ", shown_path(path), fingerprint(path)?)?;
    }
    Ok(text)
}

/// Returns the command line without folders of this machine, for the report.
fn command() -> String {
    let shown = |word: String| match word.split_once('=') {
        Some((option, value)) if option.starts_with("--") => {
            format!("{option}={}", shown_path(Path::new(value)))
        }
        _ => shown_path(Path::new(&word)),
    };
    let quote = |word: String| {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_.,/=+:@%".contains(c);
        if !word.is_empty() && word.chars().all(plain) {
            word
        } else {
            format!("'{}'", word.replace('\'', r"'\''"))
        }
    };
    let words: Vec<String> = std::env::args().skip(1).map(shown).map(quote).collect();
    format!("lexisplat {}", words.join(" "))
}

/// Shows the progress of a sweep, and counts its parts.
struct Shown {
    bars: Bars,
    /// Number of parts that an earlier run had finished.
    reused: AtomicU64,
    /// Number of parts that this run finished.
    made: AtomicU64,
}

impl Progress for Shown {
    fn begin(&self, stage: Stage, total: u64) {
        self.bars.begin(stage, total);
    }

    fn advance(&self, units: u64) {
        self.bars.advance(units);
    }

    fn end(&self) {
        self.bars.end();
    }
}

impl SweepProgress for Shown {
    fn start(&self, parts: u64) {
        self.bars.start_parts("sweeping", "parts", parts);
    }

    fn part(&self, what: &str) {
        self.bars.say(what);
    }

    fn done(&self, reused: bool) {
        let count = if reused { &self.reused } else { &self.made };
        count.fetch_add(1, Ordering::Relaxed);
        self.bars.part_done();
    }

    fn warn(&self, model: &str, warning: &str) {
        note(&format!("warning: {model}: {warning}"));
    }
}

fn summary(folder: &Path, results: &Results, progress: &Shown) -> Result<String> {
    let head = ["scene", "method", "setting", "ratio", "bytes each", "PSNR", "photos", "fps"];
    let mut rows = vec![head.map(str::to_owned)];
    let none = || "-".to_owned();
    for scene in &results.scenes {
        let mut add =
            |setting: &str, bytes: u64, psnr: String, photos: &Option<Comparison>, fps: Option<f64>| {
                rows.push([
                    format::escape(&scene.name).into_owned(),
                    scene.method.to_string(),
                    setting.to_owned(),
                    format::ratio(scene.ply_bytes, bytes),
                    format!("{:.2}", bytes as f64 / scene.gaussians.max(1) as f64),
                    psnr,
                    photos.as_ref().map_or_else(none, |photos| format::decibels(photos.psnr.mean)),
                    fps.map_or_else(none, |fps| format!("{fps:.1}")),
                ]);
            };
        add("original", scene.ply_bytes, none(), &scene.to_photos, scene.fps);
        for point in &scene.points {
            let psnr = format::decibels(point.to_original.psnr.mean);
            let fps = point.fps.map(|fps| fps.sparse.mean);
            add(&point.setting.label(), point.file_bytes, psnr, &point.to_photos, fps);
        }
    }
    let widths: [usize; 8] =
        std::array::from_fn(|i| rows.iter().map(|row| row[i].chars().count()).max().unwrap_or(0));
    let mut out = String::new();
    for row in &rows {
        let mut line = String::new();
        for (i, (cell, width)) in row.iter().zip(widths).enumerate() {
            let cell = if i < TEXT_COLUMNS { format!("{cell:<width$}") } else { format!("{cell:>width$}") };
            write!(line, "{cell}  ")?;
        }
        writeln!(out, "{}", line.trim_end())?;
    }
    writeln!(
        out,
        "\nratio: whole files; PSNR: mean over views, against the original; photos: PSNR against photos"
    )?;
    if let Some(scene) = results.scenes.first() {
        let kind = if scene.on_gpu { "frames a second of" } else { "frames a second on the processor," };
        writeln!(out, "fps: {kind} {}", format::escape(&scene.device))?;
    }
    if !results.skipped.is_empty() {
        writeln!(out, "skipped: {} models, listed in the report", results.skipped.len())?;
    }
    let [made, reused] = [&progress.made, &progress.reused].map(|count| count.load(Ordering::Relaxed));
    writeln!(out, "{made} parts made, {reused} kept from before")?;
    writeln!(out, "wrote {}: report.html, all.csv, tables, figures", folder.display())?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_weights_of_the_same_name_and_size_are_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        let files = [folder.path().join("vgg.safetensors")];
        let written = |bytes: &[u8]| {
            std::fs::write(&files[0], bytes).unwrap();
            weights(&files).unwrap()
        };
        let first = written(&[1, 2, 3]);
        assert_ne!(written(&[1, 2, 4]), first);
        assert_eq!(written(&[1, 2, 3]), first);
        assert!(!first.contains(&folder.path().display().to_string()), "{first}");
        std::fs::remove_file(&files[0]).unwrap();
        assert!(weights(&files).unwrap_err().to_string().contains("vgg.safetensors"));
    }
}
