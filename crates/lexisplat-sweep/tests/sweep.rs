//! A whole sweep over made-up scenes: what it finds, keeps, reuses and skips.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use lexisplat::packed::Preset;
use lexisplat::{Progress, ply};
use lexisplat_eval::Scorer;
use lexisplat_sample::{SampleOptions, scene};
use lexisplat_sweep::{
    Entry, Method, PictureFiles, Point, Results, Setting, SweepOptions, SweepProgress, parse_manifest, sweep,
};

const GAUSSIANS: usize = 300;

#[derive(Default)]
struct Count(AtomicU64);

impl Count {
    fn add(&self, parts: u64) {
        self.0.fetch_add(parts, Ordering::Relaxed);
    }

    fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

#[derive(Default)]
struct Seen {
    made: Count,
    reused: Count,
    all: Count,
    warnings: Mutex<Vec<String>>,
}

impl Progress for Seen {}

impl SweepProgress for Seen {
    fn start(&self, parts: u64) {
        self.all.add(parts);
    }

    fn done(&self, reused: bool) {
        let count = if reused { &self.reused } else { &self.made };
        count.add(1);
    }

    fn warn(&self, model: &str, warning: &str) {
        self.warnings.lock().unwrap().push(format!("{model}: {warning}"));
    }
}

fn options() -> SweepOptions {
    let mut options = SweepOptions::default();
    options.settings = vec![Setting::Tolerance(0.1), Setting::MaxNonzeros(1), Setting::Preset(Preset::Small)];
    options.views.max_width = 96;
    options.views.count = 3;
    options.fps = false;
    options
}

fn entry(folder: &Path, name: &str, seed: u64) -> Entry {
    let path = folder.join(format!("{name}.ply"));
    ply::write(&path, &scene(&SampleOptions::new(GAUSSIANS, seed))).unwrap();
    Entry::of_model(&path)
}

fn run(entries: &[Entry], options: &SweepOptions, out: &Path) -> (Results, Vec<PictureFiles>, Seen) {
    let seen = Seen::default();
    let (results, saved) = sweep(entries, options, &Scorer::new(), out, &seen).unwrap();
    (results, saved, seen)
}

#[test]
fn every_setting_of_every_model_is_scored() {
    let folder = tempfile::tempdir().unwrap();
    let entries = [entry(folder.path(), "a", 0), entry(folder.path(), "b", 1)];
    let (results, saved, seen) = run(&entries, &options(), &folder.path().join("out"));
    assert_eq!((results.scenes.len(), results.skipped.len()), (2, 0));
    assert_eq!((seen.all.get(), seen.made.get(), seen.reused.get()), (8, 8, 0));
    for scene in &results.scenes {
        let [tolerance, one, small] = &scene.points[..] else { panic!("three points") };
        assert_eq!((scene.views, scene.gaussians), (3, GAUSSIANS as u64));
        assert!(tolerance.max_residual.unwrap() <= 0.1 && tolerance.over_tolerance == 0);
        assert!(one.mean_nonzeros <= 1.0 && one.coefficient_ratio.unwrap() >= 45.0);
        let psnr = |point: &Point| point.to_original.psnr.mean.unwrap();
        assert!(psnr(tolerance) > psnr(one) + 3.0, "{} {}", psnr(tolerance), psnr(one));
        assert!(small.file_bytes < one.file_bytes && one.file_bytes < tolerance.file_bytes);
        assert!(tolerance.sh_bytes < tolerance.file_bytes && tolerance.to_photos.is_none());
    }
    assert_eq!(saved.len(), 6);
    for picture in &saved {
        for path in [&picture.original, &picture.compressed, &picture.difference] {
            assert_eq!(image::image_dimensions(path).unwrap(), (96, 64), "{}", path.display());
        }
        assert!(picture.photo.is_none());
    }
}

#[test]
fn an_interrupted_sweep_goes_on_where_it_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let entries = [entry(folder.path(), "a", 0)];
    let whole = run(&entries, &options(), &folder.path().join("whole")).0;
    // The first run gets no further than one setting, as if it had been killed.
    let out = folder.path().join("out");
    let mut first = options();
    first.settings.truncate(1);
    run(&entries, &first, &out);
    let (results, _, seen) = run(&entries, &options(), &out);
    assert_eq!((seen.made.get(), seen.reused.get()), (2, 2));
    let timeless = |mut results: Results| {
        results.scenes.iter_mut().flat_map(|s| &mut s.points).for_each(|p| p.seconds = 0.0);
        results
    };
    assert_eq!(timeless(results.clone()), timeless(whole));
    let (again, _, seen) = run(&entries, &options(), &out);
    assert_eq!((again, seen.made.get(), seen.reused.get()), (results, 0, 4));
    let part = std::fs::read_dir(out.join("points")).unwrap().next().unwrap().unwrap().path();
    std::fs::write(part, "{").unwrap();
    assert_eq!(run(&entries, &options(), &out).2.made.get(), 1);
    let mut fresh = options();
    fresh.resume = false;
    assert_eq!(run(&entries, &fresh, &out).2.made.get(), 4);
}

#[test]
fn another_model_or_option_is_another_point() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut one = options();
    one.settings.truncate(1);
    run(&[entry(folder.path(), "a", 0)], &one, &out);
    let changed = [entry(folder.path(), "a", 5)];
    assert_eq!(run(&changed, &one, &out).2.reused.get(), 0);
    one.drawing.eight_bit = true;
    assert_eq!(run(&changed, &one, &out).2.reused.get(), 0);
    assert_eq!(run(&changed, &one, &out).2.reused.get(), 2);
    one.fingerprint = "other weights".to_owned();
    assert_eq!(run(&changed, &one, &out).2.reused.get(), 0);
}

#[test]
fn what_is_missing_is_skipped_and_listed() {
    let folder = tempfile::tempdir().unwrap();
    let mut entries = vec![entry(folder.path(), "a", 0)];
    std::fs::write(folder.path().join("e.pkl"), [0x80, 4, 0x95]).unwrap();
    let text = r#"
        [[scene]]
        name = "gone"
        method = "mcmc"
        model = "nowhere/point_cloud.ply"
        [[scene]]
        name = "pickled"
        method = "eagles"
        model = "e.pkl"
        [[scene]]
        name = "decoded"
        method = "eagles"
        model = "a.ply"
        shipped = "e.pkl"
    "#;
    entries.extend(parse_manifest(Path::new("scenes.toml"), text, folder.path()).unwrap());
    let (results, _, seen) = run(&entries, &options(), &folder.path().join("out"));
    let skipped: Vec<(&str, Method)> = results.skipped.iter().map(|s| (&*s.name, s.method)).collect();
    assert_eq!(skipped, [("gone", Method::Mcmc), ("pickled", Method::Eagles)]);
    assert!(results.skipped[0].reason.contains("does not exist"), "{}", results.skipped[0].reason);
    assert!(results.skipped[1].reason.contains("pickle"), "{}", results.skipped[1].reason);
    assert_eq!(seen.warnings.lock().unwrap().len(), 2);
    // A competitor is scored, not compressed; what it ships is counted.
    let [_, decoded] = &results.scenes[..] else { panic!("two scenes") };
    assert_eq!((decoded.points.len(), decoded.shipped_bytes), (0, Some(3)));

    let nothing = sweep(&entries[1..3], &options(), &Scorer::new(), folder.path(), &Seen::default());
    let message = nothing.unwrap_err().to_string();
    assert!(message.contains("does not exist"), "{message}");
}

#[test]
fn settings_are_checked_before_anything_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let entries = [entry(folder.path(), "a", 0)];
    let out = folder.path().join("out");
    for settings in [
        vec![],
        vec![Setting::Tolerance(-0.1)],
        vec![Setting::Tolerance(f64::NAN)],
        vec![Setting::MaxNonzeros(0)],
        vec![Setting::Tolerance(0.1), Setting::Tolerance(0.1)],
    ] {
        let mut bad = options();
        bad.settings = settings;
        assert!(sweep(&entries, &bad, &Scorer::new(), &out, &Seen::default()).is_err());
    }
    let twice = [entries[0].clone(), entries[0].clone()];
    let message = sweep(&twice, &options(), &Scorer::new(), &out, &Seen::default()).unwrap_err().to_string();
    assert!(message.contains("two models"), "{message}");
    assert!(!out.exists());
}
