//! `lexisplat bench`.

use std::fmt::Write as _;

use anyhow::Result;
use lexisplat_eval::{
    BenchOptions, PathTimes, RadianceModel, Spread, bench_cpu, bench_gpu, busy_lanes, format,
};
use lexisplat_render::gpu::{DrawStage, Gpu, ShPath, Speed, measure_speed};
use lexisplat_render::{Camera, Device, Scene};
use serde_json::{Value, json};

use crate::args::{Bench, Common};
use crate::device::open_gpu;
use crate::files::{load, note, print, print_json, warn_of};
use crate::progress::Bars;

/// Number of lanes that run in lockstep on most GPUs.
const LANES: usize = 32;
/// Number of Gaussians in a block. Codes are ordered only within a block, so that neighbours stay together.
const ORDER_BLOCK: usize = 1024;

pub(crate) fn run(args: &Bench, common: &Common) -> Result<()> {
    let input = load(&args.file, common)?;
    warn_of(&input);
    let scene = input.scene();
    let views = &args.views;
    let cameras = super::cameras(views, scene.geometry())?;
    let gpu = open_gpu(views.device)?;
    if gpu.is_none() && views.device == Device::Auto {
        note(
            "warning: the only GPU is emulated in software, so only the CPU is measured; --device gpu measures it too",
        );
    }
    let bars = Bars::new(common.quiet);
    let paths = paths(&args.paths, &scene);
    let mut results = Vec::new();
    let mut options = BenchOptions::new(args.warmup, args.repeat);
    options.background = views.background;
    let mut speed = None;
    if let Some(gpu) = &gpu {
        speed = Some(measure_speed(gpu)?);
        for &path in &paths {
            match bench_gpu(gpu, &scene, path, &cameras, &options, &bars) {
                Ok(times) => results.push(times),
                // A path that has no room for this dictionary does not stop the others from being measured.
                Err(lexisplat_eval::Error::Render(error @ lexisplat_render::Error::Parameter { .. }))
                    if args.paths.is_empty() =>
                {
                    note(&format!("warning: {}: {error}", path.name()));
                }
                Err(error) => return Err(error.into()),
            }
        }
    }
    if args.cpu_repeat > 0 {
        options.repeat = args.cpu_repeat;
        results.push(bench_cpu(&scene, &cameras, &options, &bars)?);
    }
    let report = Report {
        args,
        name: &input.name,
        scene,
        cameras: &cameras,
        device: gpu.as_ref().map(|gpu| (gpu.summary().name.clone(), gpu.summary().driver.clone())),
        most_bytes: gpu.as_ref().map(Gpu::most_bytes),
        speed,
        results: &results,
    };
    if common.json {
        return print_json(&report.json());
    }
    print(&report.text()?)
}

/// Returns the paths asked for, or all that the scene has.
fn paths(asked: &[ShPath], scene: &Scene<'_>) -> Vec<ShPath> {
    if !asked.is_empty() {
        return asked.to_vec();
    }
    let sparse = matches!(scene, Scene::Sparse(_));
    ShPath::ALL.into_iter().filter(|path| sparse || !path.is_sparse()).collect()
}

struct Report<'a> {
    args: &'a Bench,
    name: &'a str,
    scene: Scene<'a>,
    cameras: &'a [Camera],
    /// Name and driver of the GPU.
    device: Option<(String, String)>,
    most_bytes: Option<u64>,
    speed: Option<Speed>,
    results: &'a [PathTimes],
}

impl Report<'_> {
    fn nonzeros(&self) -> Option<f64> {
        match self.scene {
            Scene::Sparse(model) => Some(model.codes().nonzeros() as f64 / model.len().max(1) as f64),
            Scene::Dense(_) => None,
        }
    }

    fn find(&self, path: ShPath) -> Option<&PathTimes> {
        self.results.iter().find(|times| times.path == path.name())
    }

    /// Returns the paper's model for every path measured on the GPU.
    fn models(&self) -> Vec<(&PathTimes, RadianceModel)> {
        let Some(speed) = &self.speed else { return Vec::new() };
        let on_gpu = |times: &&PathTimes| ShPath::ALL.iter().any(|path| path.name() == times.path);
        let nonzeros =
            |times: &PathTimes| if times.path.starts_with("sparse") { self.nonzeros() } else { None };
        self.results
            .iter()
            .filter(on_gpu)
            .map(|times| (times, RadianceModel::new(times, nonzeros(times), speed)))
            .collect()
    }

    fn json(&self) -> Value {
        let paths: Vec<Value> = self
            .results
            .iter()
            .map(|times| {
                let mut value = json!(times);
                value["radiance_bytes_per_second"] = json!(times.radiance_bandwidth());
                let named = |list: &[(String, Spread)]| -> Value {
                    list.iter().map(|(name, spread)| (name.clone(), json!(spread))).collect()
                };
                value["stages"] = named(&times.stages);
                value["views"] = named(&times.views);
                value
            })
            .collect();
        let models: serde_json::Map<String, Value> =
            self.models().into_iter().map(|(times, model)| (times.path.clone(), json!(model))).collect();
        let busy = match self.scene {
            Scene::Sparse(model) => Some(busy_lanes(model, LANES, ORDER_BLOCK)),
            Scene::Dense(_) => None,
        };
        json!({
            "file": self.name,
            "gaussians": self.scene.len(),
            "sh_degree": self.scene.degree().get(),
            "mean_nonzeros": self.nonzeros(),
            "views": self.cameras.len(),
            "warmup": self.args.warmup,
            "repeat": self.args.repeat,
            "cpu_repeat": self.args.cpu_repeat,
            "device": self.device.as_ref().map(|d| &d.0),
            "driver": self.device.as_ref().map(|d| &d.1),
            "most_gpu_bytes": self.most_bytes,
            "copy_bytes_per_second": self.speed.map(|s| s.copy),
            "operations_per_second": self.speed.map(|s| s.arithmetic),
            "paths": paths,
            "radiance_model": models,
            "speedups": self.speedups().into_iter().map(|(path, s)| (path, json!({
                "radiance": s[0], "frame": s[1], "frame_limit": s[2],
            }))).collect::<serde_json::Map<String, Value>>(),
            "busy_lanes": busy.map(|[stored, ordered]| json!({ "as_stored": stored, "ordered": ordered })),
        })
    }

    /// Returns three speedups over dense f32 for each sparse path: of the radiance stage, of the frame, and of a frame
    /// whose radiance takes no time.
    fn speedups(&self) -> Vec<(String, [f64; 3])> {
        let Some(dense) = self.find(ShPath::DenseF32) else { return Vec::new() };
        let (frame, radiance) = (dense.frame.median, dense.stage("radiance"));
        self.results
            .iter()
            .filter(|times| times.path.starts_with("sparse") && times.stage("radiance") > 0.0)
            .map(|times| {
                let speedup = [
                    radiance / times.stage("radiance"),
                    frame / times.frame.median,
                    frame / (frame - radiance),
                ];
                (times.path.clone(), speedup)
            })
            .collect()
    }

    fn text(&self) -> Result<String> {
        let mut out = String::new();
        let n = self.scene.len();
        write!(
            out,
            "{}: {} Gaussians, SH degree {}",
            self.name,
            format::count(n as u64),
            self.scene.degree()
        )?;
        if let Some(nonzeros) = self.nonzeros() {
            write!(out, ", {nonzeros:.2} nonzeros each")?;
        }
        let first = self.cameras.first().map_or((0, 0), |c| (c.width, c.height));
        writeln!(out, "\n{} views, the first {} x {}", self.cameras.len(), first.0, first.1)?;
        if let (Some((name, driver)), Some(speed)) = (&self.device, self.speed) {
            writeln!(
                out,
                "{name} ({driver}): copies {:.0} GB/s, {:.2} Tflop/s; at most {} of its memory was used",
                speed.copy / 1e9,
                speed.arithmetic / 1e12,
                format::bytes(self.most_bytes.unwrap_or(0))
            )?;
        }
        let stages = DrawStage::ALL.map(DrawStage::name);
        write!(out, "\n{:<14} {:>9} {:>19} {:>8}", "path", "ms/frame", "10 % - 90 %", "fps")?;
        for stage in stages {
            write!(out, " {stage:>9}")?;
        }
        writeln!(out, " {:>10} {:>11}", "SH memory", "B/Gaussian")?;
        for times in self.results {
            let Spread { median, p10, p90 } = times.frame;
            let range = format!("{p10:.3} - {p90:.3}");
            write!(out, "{:<14} {median:>9.3} {range:>19} {:>8.1}", times.path, times.fps)?;
            for stage in stages {
                match times.stage(stage) {
                    0.0 => write!(out, " {:>9}", "-")?,
                    ms => write!(out, " {ms:>9.3}")?,
                }
            }
            let each = times.sh_bytes as f64 / n.max(1) as f64;
            writeln!(out, " {:>10} {each:>11.1}", format::bytes(times.sh_bytes))?;
        }
        if let Some(times) = self.results.first() {
            writeln!(
                out,
                "\n{:.0} Gaussians shaded per view and {:.0} entries in the lists of tiles, on average; times are medians",
                times.visible, times.entries
            )?;
        }
        for times in self.results.iter().filter(|times| times.shading_bytes_per_frame > 0.0) {
            writeln!(
                out,
                "{:<14} shading moves {:.2} MB per frame; {:.2} MB of geometry are read per frame",
                times.path,
                times.shading_bytes_per_frame / 1e6,
                times.geometry_bytes_per_frame / 1e6
            )?;
        }
        self.model_text(&mut out)?;
        Ok(out)
    }

    fn model_text(&self, out: &mut String) -> Result<()> {
        let Some(speed) = self.speed else { return Ok(()) };
        writeln!(out, "\nradiance        B/Gaussian  flop/Gaussian  model ms  measured ms  of copy rate")?;
        for (times, model) in self.models() {
            let share = times.radiance_bandwidth().map_or(0.0, |rate| 100.0 * rate / speed.copy);
            writeln!(
                out,
                "{:<14} {:>11.1} {:>14.0} {:>9.3} {:>12.3} {share:>11.1} %",
                times.path, model.bytes, model.operations, model.predicted, model.measured
            )?;
        }
        writeln!(
            out,
            "model: the longer of the times for the bytes, at the copy rate, and for the paper's count of operations"
        )?;
        for (path, [radiance, frame, limit]) in self.speedups() {
            writeln!(
                out,
                "{path} is faster than dense-f32: radiance {radiance:.2}x, frame {frame:.3}x (with radiance in no time {limit:.3}x)"
            )?;
        }
        if let Scene::Sparse(model) = self.scene {
            let [stored, ordered] = busy_lanes(model, LANES, ORDER_BLOCK).map(|v| 100.0 * v);
            writeln!(
                out,
                "busy lanes of {LANES} while codes are summed: {stored:.0} % as stored, {ordered:.0} % if ordered by nonzeros in blocks of {ORDER_BLOCK}"
            )?;
        }
        Ok(())
    }
}
