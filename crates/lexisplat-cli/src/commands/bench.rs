//! `lexisplat bench`.

use std::fmt::Write as _;

use anyhow::Result;
use lexisplat::Model;
use lexisplat_eval::{
    BenchOptions, PathTimes, RadianceModel, Spread, bench_cpu, bench_gpu, busy_lanes, format,
};
use lexisplat_render::gpu::{AdapterSummary, DrawStage, Gpu, ShPath, Speed, measure_speed};
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
    let cameras = super::cameras(views, &scene)?;
    let gpu = open_gpu(views.device)?;
    if cfg!(feature = "gpu") && gpu.is_none() && views.device == Device::Auto {
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
                // If a path has no room for this dictionary, the other paths are still measured.
                Err(lexisplat_compress::Error::Render(error @ lexisplat_render::Error::Parameter { .. }))
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
        let dense =
            if let Scene::Sparse(model) = &scene { Some(Model::clone(model).into_splats()) } else { None };
        let scenes: Vec<Scene<'_>> = [scene].into_iter().chain(dense.as_ref().map(Scene::from)).collect();
        results.extend(bench_cpu(&scenes, &cameras, &options, &bars)?);
    }
    let gpu = gpu.as_ref().zip(speed);
    let report = Report { args, name: &input.name, scene, cameras: &cameras, gpu, results: &results };
    if common.json {
        return print_json(&report.json());
    }
    print(&report.text()?)
}

/// Returns the paths asked for, or else all paths that the scene allows.
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
    /// The GPU and its measured rates.
    gpu: Option<(&'a Gpu, Speed)>,
    results: &'a [PathTimes],
}

impl Report<'_> {
    fn model(&self) -> Option<&Model> {
        if let Scene::Sparse(model) = self.scene { Some(model) } else { None }
    }

    fn nonzeros(&self) -> Option<f64> {
        self.model().map(|model| model.codes().nonzeros() as f64 / model.len().max(1) as f64)
    }

    /// Returns the shares of [`LANES`] that work, with codes in their stored order and with codes ordered by length.
    fn busy(&self) -> Option<[f64; 2]> {
        self.model().map(|model| busy_lanes(model, LANES, ORDER_BLOCK))
    }

    fn find(&self, path: ShPath) -> Option<&PathTimes> {
        self.results.iter().find(|times| times.path == path.name())
    }

    /// Returns the paper's model for every path measured on the GPU.
    fn models(&self) -> Vec<(&PathTimes, RadianceModel)> {
        let Some((_, speed)) = &self.gpu else { return Vec::new() };
        let on_gpu = self.results.iter().filter(|times| !times.path.starts_with("cpu"));
        let model = |times: &PathTimes| {
            let nonzeros = self.nonzeros().filter(|_| times.path.starts_with("sparse"));
            RadianceModel::new(times, nonzeros, speed)
        };
        on_gpu.map(|times| (times, model(times))).collect()
    }

    fn json(&self) -> Value {
        let path = |times: &PathTimes| {
            let mut value = json!(times);
            value["radiance_bytes_per_second"] = json!(times.radiance_bandwidth());
            value
        };
        let models = self.models().into_iter().map(|(times, model)| (times.path.clone(), json!(model)));
        let speedups = self.speedups().into_iter().map(|(path, [radiance, frame, limit])| {
            (path, json!({ "radiance": radiance, "frame": frame, "frame_limit": limit }))
        });
        let gpu = self.gpu.map(|(gpu, _)| gpu);
        let speed = self.gpu.map(|(_, speed)| speed);
        json!({
            "file": self.name,
            "gaussians": self.scene.len(),
            "sh_degree": self.scene.degree().get(),
            "mean_nonzeros": self.nonzeros(),
            "views": self.cameras.len(),
            "warmup": self.args.warmup,
            "repeat": self.args.repeat,
            "cpu_repeat": self.args.cpu_repeat,
            "device": gpu.map(|gpu| &gpu.summary().name),
            "driver": gpu.map(|gpu| &gpu.summary().driver),
            "most_gpu_bytes": gpu.map(Gpu::most_bytes),
            "copy_bytes_per_second": speed.map(|speed| speed.copy),
            "operations_per_second": speed.map(|speed| speed.arithmetic),
            "paths": self.results.iter().map(path).collect::<Value>(),
            "radiance_model": models.collect::<Value>(),
            "speedups": speedups.collect::<Value>(),
            "busy_lanes": self.busy().map(|[stored, ordered]| json!({ "as_stored": stored, "ordered": ordered })),
        })
    }

    /// Returns three speedups relative to dense f32 for each sparse path: of the radiance stage, of the frame, and of a
    /// frame whose radiance takes no time.
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
        if let Some((gpu, speed)) = self.gpu {
            let AdapterSummary { name, driver, .. } = gpu.summary();
            writeln!(
                out,
                "{name} ({driver}): copies {:.0} GB/s, {:.2} Tflop/s; at most {} of its memory was used",
                speed.copy / 1e9,
                speed.arithmetic / 1e12,
                format::bytes(gpu.most_bytes())
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
        let Some((_, speed)) = self.gpu else { return Ok(()) };
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
        if let Some([stored, ordered]) = self.busy().map(|shares| shares.map(|share| 100.0 * share)) {
            writeln!(
                out,
                "busy lanes of {LANES} while codes are summed: {stored:.0} % as stored, {ordered:.0} % if ordered by nonzeros in blocks of {ORDER_BLOCK}"
            )?;
        }
        Ok(())
    }
}
