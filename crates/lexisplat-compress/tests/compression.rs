//! The pipeline as programs, windows and bindings call it.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use lexisplat::packed::{PackOptions, Preset};
use lexisplat::{CompressOptions, Layout, Limits, Progress, Silent, Splats, Stage, lexi, ply};
use lexisplat_compress::{
    Compression, CompressionReport, Error, Looked, Packing, Quality, Refine, SensitivitySource, Target,
    Viewpoints,
};
use lexisplat_render::{Camera, Renderer, orbit};
use lexisplat_sample::{SampleOptions, scene};

const GAUSSIANS: usize = 500;
/// Gaussians of the scene of tests that ask nothing of its size. Views of it are looked for sooner.
const LEAST: usize = 100;

fn sample() -> Splats {
    scene(&SampleOptions::new(GAUSSIANS, 0))
}

fn least() -> Splats {
    scene(&SampleOptions::new(LEAST, 0))
}

/// A few small views of `splats`, for tests that do not ask where views come from. None has to be looked for.
fn cameras(splats: &Splats) -> Vec<Camera> {
    orbit(&splats.geometry, 12, 96, 64)
}

fn run(compression: impl Into<Compression>, splats: &Splats) -> (Vec<u8>, CompressionReport) {
    let mut file = Vec::new();
    let report = compression.into().run(splats, &mut file, &Silent).unwrap();
    (file, report)
}

fn refused(compression: impl Into<Compression>, splats: &Splats) -> Error {
    let mut file = Vec::new();
    let error = compression.into().run(splats, &mut file, &Silent).unwrap_err();
    assert!(file.is_empty());
    error
}

#[test]
fn files_and_memory_are_the_same_as_source_and_sink() {
    let folder = tempfile::tempdir().unwrap();
    let [ply_path, lexi_path] = ["scene.ply", "scene.lexi"].map(|name| folder.path().join(name));
    let splats = least();
    ply::write(&ply_path, &splats).unwrap();
    let bytes = std::fs::read(&ply_path).unwrap();
    let source = ply::PlySource::open("scene.ply", &bytes, &ply::ReadOptions::default(), &Silent).unwrap();
    let ways: [Compression; 3] = [
        CompressOptions::default().into(),
        Packing::default().into(),
        Compression::Guessed(Preset::Small, PackOptions::default()),
    ];
    for compression in ways {
        let (file, of_memory) = run(compression.clone(), &splats);
        let of_file = compression.run(&source, &lexi_path, &Silent).unwrap();
        assert!(std::fs::read(&lexi_path).unwrap() == file);
        assert_eq!((of_file.file_bytes, of_memory.file_bytes), (file.len() as u64, file.len() as u64));
        assert_eq!(of_file.source_bytes, bytes.len() as u64);
        let parts: f64 = of_file.attribute_bytes.iter().map(|part| part.1).sum();
        assert!((parts - file.len() as f64).abs() < 1e-6, "{parts}");
        let read = lexi::read_bytes("scene.lexi", &file, &Limits::default()).unwrap();
        assert_eq!(read.len() as u64 + of_file.removed, LEAST as u64);
        assert!(of_file.sh_bytes > 0.0 && of_file.sh_bytes < of_file.dense_sh_bytes as f64);
    }
}

/// A refined file takes fewer Gaussians and bytes for the same quality, by any target, and is the same on any number of
/// threads.
#[test]
fn refined_files_are_smaller() {
    let splats = scene(&SampleOptions::new(300, 0));
    let packing = |quality: Quality| Packing::new(quality).with_cameras(orbit(&splats.geometry, 16, 64, 48));
    let target = Quality::from(Target::MeanPsnr(30.0));
    let (_, plain) = run(packing(target), &splats);
    let (file, report) = run(packing(target).with_refine(Refine::Minutes(0.05)), &splats);
    let refined = report.refined.unwrap();
    assert!(refined.gaussians < plain.gaussians && report.gaussians <= refined.gaussians, "{refined:?}");
    assert!(refined.after_psnr > refined.before_psnr && refined.steps > 10, "{refined:?}");
    assert!(report.file_bytes < plain.file_bytes, "{} {}", report.file_bytes, plain.file_bytes);
    assert!(report.reached.unwrap().mean_psnr >= 30.0);
    let read = lexi::read_bytes("scene.lexi", &file, &Limits::default()).unwrap();
    assert_eq!((read.len(), plain.refined), (report.gaussians, None));
    let brief = Refine::Minutes(0.002);
    let (_, report) = run(packing(Target::MinPsnr(26.0).into()).with_refine(brief), &splats);
    assert!(report.reached.unwrap().min_psnr >= 26.0);
    let of = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let sized = packing(Target::Size(6000).into()).with_refine(brief);
        pool.install(|| run(sized, &splats))
    };
    let (one, two) = (of(1), of(2));
    assert!(one.0 == two.0 && one.0.len() <= 6000, "{}", one.0.len());
    for options in [PackOptions::default().with_keep_all(true), PackOptions::default().with_tolerance(0.1)] {
        let error = refused(packing(Preset::Small.into()).with_refine(brief).with_options(options), &splats);
        assert!(error.to_string().contains("refine"), "{error}");
    }
    let error = refused(packing(Preset::Small.into()).with_refine(Refine::Minutes(0.0)), &splats);
    assert!(error.to_string().contains("minutes above 0"), "{error}");
}

#[test]
fn gaussians_go_unless_they_are_to_stay() {
    let splats = sample();
    let cameras = cameras(&splats);
    let removed = |options: PackOptions| {
        let (file, report) =
            run(Packing::new(Preset::Small).with_cameras(cameras.clone()).with_options(options), &splats);
        let read = lexi::read_bytes("scene.lexi", &file, &Limits::default()).unwrap();
        assert_eq!(read.len(), report.gaussians);
        assert_eq!(read.len() as u64 + report.removed, GAUSSIANS as u64);
        report.removed
    };
    assert!(removed(PackOptions::default()) > 0);
    assert_eq!(removed(PackOptions::default().with_keep_all(true)), 0);
    assert_eq!(removed(PackOptions::default().with_keep_order(true)), 0);
    assert_eq!(removed(PackOptions::default().with_tolerance(0.1)), 0);
}

#[test]
fn reports_have_the_same_keys_for_every_layout() {
    let splats = sample();
    let keys = |compression: Compression| {
        let value = serde_json::to_value(run(compression, &splats).1).unwrap();
        let keys: Vec<String> = value.as_object().unwrap().keys().cloned().collect();
        (keys, value)
    };
    let (exact_keys, exact) = keys(CompressOptions::default().into());
    let (packed_keys, packed) =
        keys(Packing::new(Target::Size(20_000)).with_cameras(cameras(&splats)).into());
    assert_eq!(exact_keys, packed_keys);
    assert!(exact["attribute_bytes"]["dictionary"].is_u64() && exact["pursuit"] == "ols");
    assert!(exact["sensitivity"].is_null() && exact["target"].is_null());
    assert!(packed["pursuit"].is_null() && packed["learn_rounds"].is_null());
    assert_eq!((&packed["sensitivity"], &packed["device"]), (&"views".into(), &"cpu".into()));
    assert_eq!(packed["target"]["kind"], "size");
}

#[test]
fn memory_decides_between_whole_and_part_by_part() {
    let splats = least();
    let (whole, report) = run(Packing::new(Preset::Small), &splats);
    assert!(!report.in_parts && report.sensitivity == Some(SensitivitySource::Views));
    let (parts, report) = run(Packing::new(Preset::Small).with_memory(1000), &splats);
    assert!(report.in_parts && report.sensitivity == Some(SensitivitySource::Views));
    assert!(whole != parts);
    let refined = Packing::new(Target::MeanPsnr(33.0)).with_refine(Refine::Minutes(0.001));
    let told = Stages::default();
    let report = Compression::from(refined.with_memory(1000)).run(&splats, &mut Vec::new(), &told).unwrap();
    assert!(report.in_parts && report.sensitivity == Some(SensitivitySource::Views));
    let made = report.refined.unwrap();
    // A part is refined within the step that looks at it.
    assert!(told.current.into_inner().unwrap().is_empty() && told.qualities.into_inner() > 0);
    let around = told.around_refining.into_inner().unwrap();
    assert!(around.contains(&Stage::Look), "{around:?}");
    assert!(made.steps > 1 && report.gaussians <= made.gaussians, "{made:?}");
    assert_eq!(report.removed, (splats.len() - report.gaussians) as u64);
    let (_, report) = run(Compression::Guessed(Preset::Small, PackOptions::default()), &splats);
    assert!(report.in_parts && report.sensitivity == Some(SensitivitySource::Guess));
    let cameras = orbit(&splats.geometry, 24, 64, 48);
    for (packing, name) in [
        (Packing::new(Target::MinPsnr(40.0)), "min-psnr"),
        (Packing::new(Target::Ratio(9.0)), "ratio"),
        (Packing::default().with_cameras(cameras), "cameras"),
        (Packing::default().with_viewpoints(Viewpoints::Room), "views"),
    ] {
        match refused(packing.with_memory(1000), &splats) {
            Error::Memory { choice, needed, allowed } => {
                assert_eq!((choice, allowed), (name, 1000));
                assert!(needed > 1000);
            }
            other => panic!("{other}"),
        }
    }
}

#[test]
fn choices_out_of_range_are_refused_before_any_work() {
    for (packing, text) in
        [(Packing::new(Target::MeanPsnr(-3.0)), "psnr = -3"), (Packing::new(Target::Ratio(1.0)), "ratio = 1")]
    {
        let error = refused(packing, &least()).to_string();
        assert!(error.contains(text) && !error.contains("--"), "{error}");
    }
}

#[test]
fn targets_out_of_reach_are_told_in_their_own_unit() {
    let splats = sample();
    let refused = |target: Target| refused(Packing::new(target).with_cameras(cameras(&splats)), &splats);
    let ratio = refused(Target::Ratio(1000.0)).to_string();
    let best: f64 = ratio.split_once("at most ").unwrap().1.split_once(':').unwrap().0.parse().unwrap();
    assert!(ratio.starts_with("ratio = 1000") && (5.0..1000.0).contains(&best), "{ratio}");
    let size = refused(Target::Size(300)).to_string();
    assert!(size.starts_with("size = 300: at least ") && size.contains("bytes"), "{size}");
}

#[test]
fn one_look_serves_several_files() {
    let splats = least();
    let looked =
        Arc::new(Looked::at(&mut Renderer::cpu(), &splats, None, Viewpoints::Auto, &Silent).unwrap());
    for preset in [Preset::Small, Preset::High] {
        let known = Packing::new(preset).with_looked(Arc::clone(&looked));
        assert!(run(known, &splats).0 == run(Packing::new(Quality::Preset(preset)), &splats).0);
    }
}

/// Holds progress to its rules: stages are within one another, and none does more units than it has.
#[derive(Default)]
struct Stages {
    /// The current stages, with the units that are left of each.
    current: Mutex<Vec<(Stage, u64)>>,
    /// The stages that a stage of refining was a part of.
    around_refining: Mutex<Vec<Stage>>,
    qualities: AtomicU64,
}

impl Progress for Stages {
    fn begin(&self, stage: Stage, total: u64) {
        let mut current = self.current.lock().unwrap();
        if stage == Stage::Refine {
            self.around_refining.lock().unwrap().extend(current.iter().map(|(stage, _)| *stage));
        }
        current.push((stage, total));
    }

    fn advance(&self, units: u64) {
        let mut current = self.current.lock().unwrap();
        let (stage, left) = current.last_mut().unwrap();
        *left = left.checked_sub(units).unwrap_or_else(|| panic!("{units} of {stage:?}, {left} are left"));
    }

    fn quality(&self, decibels: f64) {
        assert!(decibels > 0.0, "{decibels}");
        self.qualities.fetch_add(1, Ordering::Relaxed);
    }

    fn end(&self) {
        let (stage, left) = self.current.lock().unwrap().pop().unwrap();
        // Learning ends once it gains no more.
        assert!(left == 0 || stage == Stage::Learn, "{left} of {stage:?} are left");
    }
}

/// Cancels at the end of a stage.
struct Until(Stage, AtomicU64);

impl Progress for Until {
    fn begin(&self, stage: Stage, _: u64) {
        if stage == self.0 {
            self.1.store(1, Ordering::Relaxed);
        }
    }

    fn end(&self) {
        self.1.fetch_add(1, Ordering::Relaxed);
    }

    fn is_cancelled(&self) -> bool {
        self.1.load(Ordering::Relaxed) >= 2
    }
}

#[test]
fn work_that_is_cancelled_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("scene.lexi");
    let ways: [Compression; 3] = [
        CompressOptions::default().into(),
        Packing::new(Target::MeanPsnr(40.0)).into(),
        Packing::default().into(),
    ];
    for (compression, stage) in ways.iter().zip([Stage::Learn, Stage::Code, Stage::Draw]) {
        let error = compression.run(&sample(), &output, &Until(stage, AtomicU64::new(0))).unwrap_err();
        assert!(matches!(error, Error::Codec(lexisplat::Error::Cancelled)), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

#[test]
fn the_geometry_of_exact_layouts_is_exact() {
    let splats = sample();
    let mut options = CompressOptions::default();
    options.values = Layout::F32.values();
    let (file, report) = run(options, &splats);
    assert_eq!(report.layout, Layout::F32);
    let model = lexi::read_bytes("scene.lexi", &file, &Limits::default()).unwrap();
    assert_eq!(model.into_splats().geometry, splats.geometry);
    assert_eq!(report.dictionary.map(|dictionary| dictionary.len()), Some(report.atoms));
}
