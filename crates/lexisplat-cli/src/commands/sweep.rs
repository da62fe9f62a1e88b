//! `lexisplat sweep`.

use std::cell::Cell;
use std::fmt::Write as _;
use std::path::Path;

use anyhow::Result;
use lexisplat::Progress;
use lexisplat_eval::{SplitFilter, text};
use lexisplat_sweep::{Entry, Results, Setting, SweepOptions, Watch, read_manifest, sweep, write_report};
use serde_json::json;

use super::eval::scorer;
use crate::args::{Common, Sweep};
use crate::exit::OutputExists;
use crate::files::{make_folder, outputs, print, print_json};
use crate::progress::Bars;
use crate::stop::{self, Work};

/// The paper's tolerances.
const TOLERANCES: [f64; 4] = [0.03, 0.05, 0.1, 0.2];
/// What a sweep keeps in its folder: by this it is told from any other folder.
const KEPT: &str = "points";

pub(crate) fn run(args: &Sweep, common: &Common) -> Result<()> {
    let folder = &args.output;
    check_folder(folder, common.overwrite)?;
    let entries = entries(args)?;
    let scorer = scorer(&args.measures)?;
    let options = options(args, common)?;
    stop::while_writing(Work::Resumable);
    make_folder(folder)?;
    let watch = Watcher { bars: Bars::new(common.quiet), reused: Cell::new(0), made: Cell::new(0) };
    let outcome = sweep(&entries, &options, &scorer, folder, &watch);
    watch.bars.end();
    let (mut results, saved) = outcome?;
    results.command = command();
    let files = write_report(folder, &results, &saved, args.date.as_deref(), outputs())?;
    if common.json {
        return print_json(&json!({
            "output": folder.display().to_string(),
            "files": files.iter().map(|path| path.display().to_string()).collect::<Vec<_>>(),
            "parts_reused": watch.reused.get(),
            "parts_made": watch.made.get(),
            "results": results,
        }));
    }
    if common.quiet {
        return Ok(());
    }
    print(&summary(folder, &results, &watch)?)
}

/// Refuses folders that hold something else than a sweep.
fn check_folder(folder: &Path, overwrite: bool) -> Result<()> {
    let used = std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    if (used || folder.is_file()) && !folder.join(KEPT).is_dir() && !overwrite {
        return Err(OutputExists(folder.display().to_string()).into());
    }
    Ok(())
}

fn entries(args: &Sweep) -> Result<Vec<Entry>> {
    if let Some(path) = &args.manifest {
        return Ok(read_manifest(path, args.root.as_deref())?);
    }
    let mut entries: Vec<Entry> = args.models.iter().map(|model| Entry::of_model(model)).collect();
    for entry in &mut entries {
        entry.method = args.method;
        entry.cameras.clone_from(&args.views.cameras);
        entry.images.clone_from(&args.photos.images);
        entry.resolution = args.photos.resolution;
        entry.split = args.views.split.unwrap_or(SplitFilter::Test);
    }
    Ok(entries)
}

fn options(args: &Sweep, common: &Common) -> Result<SweepOptions> {
    let mut options = SweepOptions::default();
    options.limits = common.limits()?;
    let given = [args.max_nnz.is_empty(), args.presets.is_empty()];
    let tolerances: &[f64] =
        if args.tol.is_empty() && given == [true, true] { &TOLERANCES } else { &args.tol };
    options.settings = tolerances.iter().copied().map(Setting::Tolerance).collect();
    options.settings.extend(args.max_nnz.iter().copied().map(Setting::MaxNonzeros));
    options.settings.extend(args.presets.iter().copied().map(Setting::Preset));
    options.pursuit = args.pursuit;
    options.layout = args.layout;
    options.seed = args.seed;
    options.eight_bit = args.measures.eight_bit;
    options.fps = !args.no_fps;
    options.background = args.views.background;
    options.max_width = args.views.width;
    options.generated = args.views.orbit;
    options.kind = args.views.scene;
    options.hold = args.views.hold;
    options.device = args.views.device;
    options.pictures = args.pictures;
    options.resume = !args.fresh;
    options.outputs = outputs().clone();
    for path in &args.measures.lpips {
        let bytes = std::fs::metadata(path).map_err(|e| lexisplat::Error::io(path, e))?.len();
        write!(options.fingerprint, "{} {bytes}; ", path.display())?;
    }
    Ok(options)
}

/// The command line, for the report.
fn command() -> String {
    let quote = |word: String| {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_.,/=+:@%".contains(c);
        if !word.is_empty() && word.chars().all(plain) {
            word
        } else {
            format!("'{}'", word.replace('\'', r"'\''"))
        }
    };
    let words: Vec<String> = std::env::args().skip(1).map(quote).collect();
    format!("lexisplat {}", words.join(" "))
}

/// Shows how the sweep goes.
struct Watcher {
    bars: Bars,
    reused: Cell<u64>,
    made: Cell<u64>,
}

impl Watch for Watcher {
    fn begin(&self, parts: u64) {
        self.bars.start("sweeping", "parts", parts);
    }

    fn part(&self, what: &str) {
        self.bars.say(what);
    }

    fn done(&self, parts: u64, reused: bool) {
        let count = if reused { &self.reused } else { &self.made };
        count.set(count.get() + parts);
        self.bars.advance(parts);
    }

    fn warn(&self, model: &str, warning: &str) {
        self.bars.aside(&format!("warning: {model}: {warning}"));
    }
}

fn summary(folder: &Path, results: &Results, watch: &Watcher) -> Result<String> {
    let mut out = String::new();
    let head = ["scene", "method", "setting", "ratio", "bytes each", "PSNR", "photos", "fps"];
    let mut rows = vec![head.map(str::to_owned)];
    for scene in &results.scenes {
        let photos = |comparison: &Option<lexisplat_eval::Comparison>| {
            comparison.as_ref().map_or_else(|| "-".to_owned(), |c| text::decibels(c.psnr.mean))
        };
        let each = |bytes: u64| format!("{:.2}", bytes as f64 / scene.gaussians.max(1) as f64);
        let fps = |fps: Option<f64>| fps.map_or_else(|| "-".to_owned(), |fps| format!("{fps:.1}"));
        let row = |setting: &str, bytes, psnr, found: &_, speed| {
            let (name, method) = (scene.name.clone(), scene.method.to_string());
            let ratio = text::ratio(scene.ply_bytes, bytes);
            [name, method, setting.to_owned(), ratio, each(bytes), psnr, photos(found), fps(speed)]
        };
        rows.push(row("original", scene.ply_bytes, "-".to_owned(), &scene.to_photos, scene.fps));
        for point in &scene.points {
            let psnr = text::decibels(point.to_original.psnr.mean);
            let speed = point.fps.map(|fps| fps.sparse);
            rows.push(row(&point.setting.label(), point.file_bytes, psnr, &point.to_photos, speed));
        }
    }
    let widths: [usize; 8] =
        std::array::from_fn(|i| rows.iter().map(|row| row[i].chars().count()).max().unwrap_or(0));
    for row in &rows {
        let mut line = String::new();
        for (i, (cell, width)) in row.iter().zip(widths).enumerate() {
            if i < 3 { write!(line, "{cell:<width$}  ")? } else { write!(line, "{cell:>width$}  ")? }
        }
        writeln!(out, "{}", line.trim_end())?;
    }
    writeln!(
        out,
        "\nratio: whole files; PSNR: mean over views, against the original; photos: PSNR against photos"
    )?;
    if let Some(scene) = results.scenes.first() {
        let kind = if scene.on_gpu { "frames a second of" } else { "frames a second on the processor," };
        writeln!(out, "fps: {kind} {}", scene.device)?;
    }
    if !results.skipped.is_empty() {
        writeln!(out, "skipped: {} models, listed in the report", results.skipped.len())?;
    }
    writeln!(out, "{} parts made, {} kept from before", watch.made.get(), watch.reused.get())?;
    writeln!(out, "wrote {}: report.html, report.md, tables, figures, results.json", folder.display())?;
    Ok(out)
}
