//! Measures how fast a scene is drawn with each way of holding SH, and how fast it could be.
//!
//! Every view is drawn repeatedly after a warm-up. Only drawing is timed, as is usual in the field (INRIA
//! `gaussian-splatting` issues 349 and 351). A GPU is timed by its own time stamps.

use std::collections::BTreeMap;
use std::time::Instant;

use lexisplat::{Model, Progress, Stage};
use lexisplat_render::gpu::{Gpu, GpuRenderer, GpuScene, ShPath, Speed};
use lexisplat_render::{Camera, RenderOptions, Scene, render_measured};
use serde::Serialize;

use lexisplat_compress::{Error, Result};

/// Options of a benchmark.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct BenchOptions {
    /// Number of frames drawn from each view before the timed frames.
    pub warmup: u32,
    /// Number of timed frames of each view, at least 1.
    pub repeat: u32,
    /// Colour behind the scene.
    pub background: [f32; 3],
}

impl BenchOptions {
    /// Returns options with these numbers of frames, over black.
    #[must_use]
    pub fn new(warmup: u32, repeat: u32) -> Self {
        Self { warmup, repeat: repeat.max(1), background: [0.0; 3] }
    }
}

/// Median, tenth and ninetieth percentile, in milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Spread {
    /// Half of the values are below.
    pub median: f64,
    /// A tenth of the values is below.
    pub p10: f64,
    /// A tenth of the values is above.
    pub p90: f64,
}

impl Spread {
    /// Returns the spread of `values`, or zeros if there are none.
    #[must_use]
    pub fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to the length")]
        let at = |share: f64| {
            let rank = share * values.len().saturating_sub(1) as f64;
            values.get(rank.round() as usize).copied().unwrap_or(0.0)
        };
        Self { median: at(0.5), p10: at(0.1), p90: at(0.9) }
    }
}

/// Durations and numbers of bytes of one way of holding the scene.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
#[non_exhaustive]
pub struct PathTimes {
    /// Name of the path: `dense-f32`, `sparse` and so on; on the processor `cpu-dense` or `cpu-sparse`.
    pub path: String,
    /// Duration of a frame, in milliseconds, over all frames of all views.
    pub frame: Spread,
    /// Frames per second: the number of views over the sum of their mean durations.
    pub fps: f64,
    /// Duration of each stage, in milliseconds, by name.
    pub stages: BTreeMap<String, Spread>,
    /// Duration of a frame of each view, in milliseconds, by name.
    pub views: BTreeMap<String, Spread>,
    /// Number of shaded Gaussians, on average over views.
    pub visible: f64,
    /// Number of pairs of a Gaussian and a tile, on average over views; 0 on the processor.
    pub entries: f64,
    /// Bytes of geometry on the GPU, or in memory.
    pub geometry_bytes: u64,
    /// Bytes of everything that colours need, on the GPU or in memory.
    pub sh_bytes: u64,
    /// Number of bytes that are moved to shade one visible Gaussian: its slot, position, SH and colour.
    pub shading_bytes: f64,
    /// Number of bytes that are moved to shade all visible Gaussians of a frame.
    pub shading_bytes_per_frame: f64,
    /// Number of bytes of geometry that a frame reads to find and project visible Gaussians; 0 on the processor.
    pub geometry_bytes_per_frame: f64,
}

impl PathTimes {
    /// Returns the median duration of the stage `name`, in milliseconds; 0 if there is no such stage.
    #[must_use]
    pub fn stage(&self, name: &str) -> f64 {
        self.stages.get(name).map_or(0.0, |spread| spread.median)
    }

    /// Returns the bytes per second that the radiance stage moved; `None` if its duration is 0.
    #[must_use]
    pub fn radiance_bandwidth(&self) -> Option<f64> {
        let seconds = self.stage("radiance") / 1e3;
        (seconds > 0.0).then(|| self.visible * self.shading_bytes / seconds)
    }
}

/// The durations of one frame.
struct Sample {
    total: f64,
    stages: Vec<(String, f64)>,
    visible: f64,
    entries: f64,
}

/// The samples of one path.
#[derive(Default)]
struct Samples {
    all: Vec<f64>,
    stages: BTreeMap<String, Vec<f64>>,
    views: BTreeMap<String, Spread>,
    /// Sum over views of the mean duration of a frame.
    means: f64,
    visible: f64,
    entries: f64,
}

impl Samples {
    fn add(&mut self, view: &str, samples: Vec<Sample>) {
        let times: Vec<f64> = samples.iter().map(|sample| sample.total).collect();
        for sample in samples {
            for (name, time) in sample.stages {
                self.stages.entry(name).or_default().push(time);
            }
            self.visible += sample.visible;
            self.entries += sample.entries;
        }
        self.means += times.iter().sum::<f64>() / times.len() as f64;
        self.all.extend_from_slice(&times);
        self.views.insert(view.to_owned(), Spread::of(times));
    }

    fn times(self, path: &str) -> PathTimes {
        let frames = self.all.len() as f64;
        PathTimes {
            path: path.to_owned(),
            frame: Spread::of(self.all),
            fps: 1e3 * self.views.len() as f64 / self.means,
            stages: self.stages.into_iter().map(|(name, times)| (name, Spread::of(times))).collect(),
            views: self.views,
            visible: self.visible / frames,
            entries: self.entries / frames,
            ..PathTimes::default()
        }
    }
}

/// Draws each of `paths` from every camera, one frame of each path in turn. `frame` draws one frame of the path of the given
/// number.
fn run(
    paths: &[&str],
    cameras: &[Camera],
    options: &BenchOptions,
    progress: &dyn Progress,
    mut frame: impl FnMut(usize, &Camera) -> Result<Sample>,
) -> Result<Vec<PathTimes>> {
    if cameras.is_empty() {
        return Err(Error::parameter("cameras", "none", "at least one view"));
    }
    let mut all: Vec<Samples> = paths.iter().map(|_| Samples::default()).collect();
    progress.begin(Stage::Draw, cameras.len() as u64);
    for camera in cameras {
        progress.check()?;
        let mut samples: Vec<Vec<Sample>> = paths.iter().map(|_| Vec::new()).collect();
        for number in 0..options.warmup.saturating_add(options.repeat.max(1)) {
            for (path, samples) in samples.iter_mut().enumerate() {
                let sample = frame(path, camera)?;
                if number >= options.warmup {
                    samples.push(sample);
                }
            }
        }
        for (all, samples) in all.iter_mut().zip(samples) {
            all.add(&camera.name, samples);
        }
        progress.advance(1);
    }
    progress.end();
    Ok(all.into_iter().zip(paths).map(|(samples, path)| samples.times(path)).collect())
}

/// Times drawing on `gpu` with the scene held by `path`. Reports [`Stage::Draw`] to `progress`, in views.
///
/// # Errors
/// [`Error::Parameter`] without cameras. [`Error::Render`] if the scene or a view does not fit on the GPU.
/// [`Error::Codec`] if `progress` cancels.
pub fn bench_gpu(
    gpu: &Gpu,
    scene: &Scene<'_>,
    path: ShPath,
    cameras: &[Camera],
    options: &BenchOptions,
    progress: &dyn Progress,
) -> Result<PathTimes> {
    let mut renderer = GpuRenderer::new(gpu)?;
    let uploaded = GpuScene::new(gpu, scene, path)?;
    let drawing = RenderOptions::default().with_background(options.background);
    let mut all = run(&[path.name()], cameras, options, progress, |_, camera| {
        let clock = Instant::now();
        let stats = renderer.draw(&uploaded, camera, &drawing)?.stats;
        let wall = clock.elapsed().as_secs_f64() * 1e3;
        Ok(Sample {
            total: stats.total.unwrap_or(wall),
            stages: stats.stages.iter().map(|(stage, ms)| (stage.name().to_owned(), *ms)).collect(),
            visible: f64::from(stats.visible),
            entries: f64::from(stats.entries),
        })
    })?;
    let (times, bytes) = (all.pop().unwrap_or_default(), uploaded.bytes());
    Ok(PathTimes {
        geometry_bytes: bytes.geometry,
        sh_bytes: bytes.sh,
        shading_bytes: uploaded.shading_bytes(),
        shading_bytes_per_frame: times.visible * uploaded.shading_bytes(),
        geometry_bytes_per_frame: uploaded.looking_bytes(times.visible),
        ..times
    })
}

/// Times drawing on the processor, one frame of each scene in turn, so that other work of the machine slows all of them alike.
/// Reports [`Stage::Draw`] to `progress`, in views.
///
/// # Errors
/// [`Error::Parameter`] without cameras, or if a camera is not valid. [`Error::Codec`] if `progress` cancels.
pub fn bench_cpu(
    scenes: &[Scene<'_>],
    cameras: &[Camera],
    options: &BenchOptions,
    progress: &dyn Progress,
) -> Result<Vec<PathTimes>> {
    let drawing = RenderOptions::default().with_background(options.background);
    let held = |scene: &Scene<'_>| match scene {
        Scene::Dense(splats) => {
            let dc = size_of_val(splats.geometry.dc.as_slice());
            ("cpu-dense", dc + size_of_val(splats.sh_rest.as_slice()))
        }
        Scene::Sparse(model) => ("cpu-sparse", model.resident_sh_bytes()),
    };
    let names: Vec<&str> = scenes.iter().map(|scene| held(scene).0).collect();
    let times = run(&names, cameras, options, progress, |path, camera| {
        let clock = Instant::now();
        let drawn = render_measured(&scenes[path], camera, &drawing)?;
        Ok(Sample {
            total: clock.elapsed().as_secs_f64() * 1e3,
            stages: drawn.stage_times.iter().map(|(name, ms)| ((*name).to_owned(), *ms)).collect(),
            visible: drawn.gaussians as f64,
            entries: 0.0,
        })
    })?;
    // Positions, opacities, scales, rotations.
    let each = size_of::<[f32; 11]>();
    let with_bytes = |(times, scene): (PathTimes, &Scene<'_>)| PathTimes {
        geometry_bytes: (scene.len() * each) as u64,
        sh_bytes: held(scene).1 as u64,
        ..times
    };
    Ok(times.into_iter().zip(scenes).map(with_bytes).collect())
}

/// The paper's model of the time to shade Gaussians, with the measured rates of a GPU.
///
/// The paper (section 5, rendering) counts 96 operations and 192 bytes for dense SH. For codes it adds 90 operations for
/// each nonzero. The time of a stage is the larger of the times of moving and of computing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RadianceModel {
    /// Number of bytes moved for a Gaussian.
    pub bytes: f64,
    /// Number of operations for a Gaussian.
    pub operations: f64,
    /// Predicted duration for all visible Gaussians, in milliseconds.
    pub predicted: f64,
    /// Measured duration for all visible Gaussians, in milliseconds.
    pub measured: f64,
}

/// Number of operations of dense SH of degree 3 for one Gaussian, as counted by the paper.
const DENSE_OPERATIONS: f64 = 96.0;
/// Number of operations of one nonzero: a multiplication and an addition for each of 45 coefficients.
const NONZERO_OPERATIONS: f64 = 90.0;

impl RadianceModel {
    /// Returns the model of one path on a GPU of `speed`. `nonzeros` is the mean number of nonzeros of a Gaussian, if the
    /// path is sparse.
    #[must_use]
    pub fn new(times: &PathTimes, nonzeros: Option<f64>, speed: &Speed) -> Self {
        let operations = DENSE_OPERATIONS + nonzeros.unwrap_or(0.0) * NONZERO_OPERATIONS;
        let seconds = (times.shading_bytes / speed.copy).max(operations / speed.arithmetic);
        Self {
            bytes: times.shading_bytes,
            operations,
            predicted: seconds * times.visible * 1e3,
            measured: times.stage("radiance"),
        }
    }
}

/// Returns the share of lanes that work while a group of `lanes` lanes sums codes. The group takes as long as its longest
/// code. The first value is for Gaussians in their own order, the second for Gaussians ordered by nonzeros within blocks
/// of `block`.
#[must_use]
pub fn busy_lanes(model: &Model, lanes: usize, block: usize) -> [f64; 2] {
    let counts = model.codes().counts();
    let busy = |counts: &[u8]| {
        let used: u64 = counts.iter().map(|&c| u64::from(c)).sum();
        let held: u64 = counts
            .chunks(lanes.max(1))
            .map(|group| u64::from(group.iter().copied().max().unwrap_or(0)) * group.len() as u64)
            .sum();
        if held == 0 { 1.0 } else { used as f64 / held as f64 }
    };
    let mut ordered = counts.to_vec();
    ordered.chunks_mut(block.max(1)).for_each(<[u8]>::sort_unstable);
    [busy(counts), busy(&ordered)]
}

#[cfg(test)]
mod tests {
    use lexisplat::{CompressOptions, Silent, compress};
    use lexisplat_render::orbit;
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    #[test]
    fn spreads_are_of_sorted_values() {
        let spread = Spread::of((0..=100).rev().map(f64::from).collect());
        assert_eq!((spread.p10, spread.median, spread.p90), (10.0, 50.0, 90.0));
        assert_eq!(Spread::of(Vec::new()).median, 0.0);
        assert_eq!(Spread::of(vec![7.0]).p90, 7.0);
    }

    #[test]
    fn the_processor_is_measured_by_stage() {
        let splats = scene(&SampleOptions::new(500, 1));
        let cameras = orbit(&splats.geometry, 3, 64, 48);
        let (model, _) = compress(splats.clone(), &CompressOptions::default(), &Silent).unwrap();
        let scenes = [Scene::from(&splats), Scene::from(&model)];
        let all = bench_cpu(&scenes, &cameras, &BenchOptions::new(1, 4), &Silent).unwrap();
        assert_eq!(
            all.iter().map(|times| times.path.as_str()).collect::<Vec<_>>(),
            ["cpu-dense", "cpu-sparse"]
        );
        assert!(all[1].sh_bytes < all[0].sh_bytes);
        let times = &all[0];
        assert_eq!(times.views.len(), 3);
        assert_eq!(times.sh_bytes, 500 * 192);
        assert!(times.visible > 10.0 && times.visible <= 500.0);
        assert!(times.frame.p10 <= times.frame.median && times.frame.median <= times.frame.p90);
        let stages: f64 = times.stages.values().map(|spread| spread.median).sum();
        assert!(stages > 0.0 && times.fps > 0.0);
        assert!(bench_cpu(&scenes, &[], &BenchOptions::new(0, 1), &Silent).is_err());
    }

    #[test]
    fn ordering_keeps_more_lanes_busy() {
        let splats = scene(&SampleOptions::new(2000, 1));
        let (model, _) = compress(splats, &CompressOptions::default(), &Silent).unwrap();
        let [stored, ordered] = busy_lanes(&model, 32, 1024);
        assert!(stored > 0.0 && stored < ordered && ordered <= 1.0, "{stored} {ordered}");
        assert_eq!(busy_lanes(&model, 1, 1024)[0], 1.0);
    }
}
