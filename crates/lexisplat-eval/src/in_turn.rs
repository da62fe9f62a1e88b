//! Measures how fast several scenes are drawn in turn: a frame of the first scene, a frame of the second, and so on.
//! Other load on the machine therefore slows all scenes alike, and the rounds show how much the same drawing varies.

use std::time::Instant;

use lexisplat::{Progress, Stage};
use lexisplat_render::gpu::{Gpu, GpuRenderer, GpuScene, ShPath};
use lexisplat_render::{Camera, RenderOptions, Scene, render_measured};
use serde::{Deserialize, Serialize};

use crate::bench::BenchOptions;
use lexisplat_compress::{Error, Result};

/// Frames per second of one scene. A round draws every view once.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FrameRate {
    /// Number of frames of all rounds over their duration.
    pub mean: f64,
    /// Frames per second of the slowest round.
    pub least: f64,
    /// Frames per second of the fastest round.
    pub most: f64,
}

impl FrameRate {
    /// Returns the rate of rounds of `views` frames. `rounds` has the durations of the rounds, in milliseconds.
    fn of(views: usize, rounds: &[f64]) -> Self {
        let rate = |milliseconds: f64| 1e3 * views as f64 / milliseconds.max(f64::MIN_POSITIVE);
        let pick = |by: fn(f64, f64) -> f64| rounds.iter().copied().reduce(by).unwrap_or_default();
        let mean = rounds.iter().sum::<f64>() / rounds.len().max(1) as f64;
        Self { mean: rate(mean), least: rate(pick(f64::max)), most: rate(pick(f64::min)) }
    }
}

/// Draws `scenes` in turn in every view, and again in each further round. `frame` draws a scene from a camera and returns
/// the duration in milliseconds.
fn in_turn(
    scenes: usize,
    cameras: &[Camera],
    options: &BenchOptions,
    progress: &dyn Progress,
    mut frame: impl FnMut(usize, &Camera) -> Result<f64>,
) -> Result<Vec<FrameRate>> {
    if cameras.is_empty() {
        return Err(Error::parameter("cameras", "none", "at least one view"));
    }
    let repeat = options.repeat.max(1);
    let mut rounds = vec![Vec::new(); scenes];
    progress.begin(Stage::Draw, u64::from(options.warmup.saturating_add(repeat)) * cameras.len() as u64);
    for round in 0..options.warmup.saturating_add(repeat) {
        let mut sums = vec![0.0; scenes];
        for camera in cameras {
            progress.check()?;
            for (scene, sum) in sums.iter_mut().enumerate() {
                *sum += frame(scene, camera)?;
            }
            progress.advance(1);
        }
        if round >= options.warmup {
            rounds.iter_mut().zip(sums).for_each(|(times, sum)| times.push(sum));
        }
    }
    progress.end();
    Ok(rounds.iter().map(|times| FrameRate::of(cameras.len(), times)).collect())
}

/// Times drawing `scenes` in turn on the processor. Reports [`Stage::Draw`] to `progress`, in views.
///
/// # Errors
/// [`Error::Parameter`] without cameras, or if a camera is not valid. [`Error::Codec`] if `progress` cancels.
pub fn bench_cpu_in_turn(
    scenes: &[Scene<'_>],
    cameras: &[Camera],
    options: &BenchOptions,
    progress: &dyn Progress,
) -> Result<Vec<FrameRate>> {
    let drawing = RenderOptions::default().with_background(options.background);
    in_turn(scenes.len(), cameras, options, progress, |scene, camera| {
        let clock = Instant::now();
        if let Some(scene) = scenes.get(scene) {
            render_measured(scene, camera, &drawing)?;
        }
        Ok(clock.elapsed().as_secs_f64() * 1e3)
    })
}

/// Times drawing `scenes` in turn on `gpu`, by its own time stamps if it has them. Reports [`Stage::Draw`] to `progress`,
/// in views.
///
/// # Errors
/// [`Error::Parameter`] without cameras. [`Error::Render`] if the scenes together or a view do not fit on the GPU.
/// [`Error::Codec`] if `progress` cancels.
pub fn bench_gpu_in_turn(
    gpu: &Gpu,
    scenes: &[Scene<'_>],
    cameras: &[Camera],
    options: &BenchOptions,
    progress: &dyn Progress,
) -> Result<Vec<FrameRate>> {
    let mut renderer = GpuRenderer::new(gpu)?;
    let upload = |scene: &Scene<'_>| GpuScene::new(gpu, scene, ShPath::of(scene));
    let uploaded: Vec<GpuScene> = scenes.iter().map(upload).collect::<Result<_, _>>()?;
    let drawing = RenderOptions::default().with_background(options.background);
    in_turn(scenes.len(), cameras, options, progress, |scene, camera| {
        let clock = Instant::now();
        let stamped = match uploaded.get(scene) {
            Some(scene) => renderer.draw(scene, camera, &drawing)?.stats.total,
            None => None,
        };
        Ok(stamped.unwrap_or_else(|| clock.elapsed().as_secs_f64() * 1e3))
    })
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat_render::orbit;
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    #[test]
    fn scenes_are_drawn_in_turn_and_rounds_make_the_spread() {
        let splats = scene(&SampleOptions::new(50, 1));
        let cameras = orbit(&splats.geometry, 2, 16, 16);
        let mut drawn = Vec::new();
        // Views of the first scene take 10, 20, 5 and 5 ms, those of the second twice as long.
        let times = [99.0, 99.0, 10.0, 20.0, 5.0, 5.0];
        let rates = in_turn(2, &cameras, &BenchOptions::new(1, 2), &Silent, |scene, _| {
            drawn.push(scene);
            Ok(times[(drawn.len() - 1) / 2] * (1.0 + scene as f64))
        })
        .unwrap();
        assert_eq!(drawn, [0, 1].repeat(6));
        assert_eq!(rates[0], FrameRate { mean: 100.0, least: 2000.0 / 30.0, most: 200.0 });
        assert_eq!(rates[1], FrameRate { mean: 50.0, least: 1000.0 / 30.0, most: 100.0 });
        let scenes = [Scene::from(&splats); 2];
        let rates = bench_cpu_in_turn(&scenes, &cameras, &BenchOptions::new(0, 2), &Silent).unwrap();
        assert!(rates.iter().all(|rate| rate.least > 0.0 && rate.least <= rate.most), "{rates:?}");
        assert!(bench_cpu_in_turn(&scenes, &[], &BenchOptions::new(0, 1), &Silent).is_err());
    }
}
