//! `lexisplat compress` in the packed layout.

use std::cell::Cell;
use std::path::Path;
use std::time::Instant;

use anyhow::Result;
use lexisplat::packed::{PackOptions, PackReport, Packed, Packer, StreamBits};
use lexisplat::ply::{PlyChunks, PlyRead};
use lexisplat::stream::Importance;
use lexisplat::{Error, Progress, Sensitivity, Splats, lexi, stream};
use lexisplat_eval::{Goal, Judge, Pruned, Views, format, pack_to, prune};
use lexisplat_render::{Renderer, read_views};
use serde_json::{Value, json};

use super::compress::error_line;
use crate::args::{Common, Compress};
use crate::files::{tell, warn, write_output};
use crate::progress::Bars;

/// Levels of an 8-bit channel above 0.
const LEVELS: f32 = 255.0;

/// Memory that packing a whole scene takes, for each byte of its PLY: 1.85 was measured.
const MEMORY_PER_BYTE: u64 = 2;

/// Packs `read` and writes it to `output`. `start` is when the command began.
pub(crate) fn run(
    args: &Compress,
    common: &Common,
    output: &Path,
    read: PlyRead,
    start: Instant,
) -> Result<()> {
    let read_seconds = start.elapsed().as_secs_f64();
    let mut splats = read.splats;
    let options = options(args);
    let goal = goal(args, read.source.file_bytes)?;
    let bars = Bars::new(common.quiet);

    let clock = Instant::now();
    let views = match &args.cameras {
        Some(path) => {
            let set = read_views(path, &mut |_| None)?;
            warn("cameras", &set.warnings);
            Views::given(&set.cameras)?
        }
        None => Views::generated(&splats),
    };
    let mut renderer = Renderer::open(args.device)?;
    bars.start("looking", "views", views.len() as u64);
    let mut sensitivity = views.sensitivity(&mut renderer, &splats, &mut || bars.advance(1))?;
    bars.end();
    let pruned = match args.prune {
        Some(levels) if !levels.is_finite() || levels <= 0.0 => {
            return Err(Error::parameter("prune", levels, "a finite number above 0").into());
        }
        Some(levels) => Some(prune(&mut renderer, &mut splats, &mut sensitivity, &views, levels / LEVELS)?),
        None => None,
    };
    let look_seconds = clock.elapsed().as_secs_f64();

    let clock = Instant::now();
    let packer = Packer::new(&splats, &sensitivity, &options)?;
    drop(sensitivity);
    let (mut packed, report) = match goal {
        Some(goal) => pack_to(&packer, &mut Judge::new(&mut renderer, &splats, &views)?, goal, &bars)?,
        None => packer.pack(packer.step_for(args.preset.unwrap_or_default().decibels()), &bars)?,
    };
    drop(packer);
    packed.device = renderer.is_gpu().then(|| renderer.name().to_owned());
    let pack_seconds = clock.elapsed().as_secs_f64();
    let clock = Instant::now();
    let file_bytes = write_output(
        output,
        common.overwrite,
        |path| lexi::write_packed(path, &packed),
        |out| lexi::write_packed_to(out, &packed),
    )?;
    let write_seconds = clock.elapsed().as_secs_f64();
    let outcome = Outcome {
        output,
        packed: &packed,
        streams: if common.quiet && !common.json { Vec::new() } else { packed.stream_bits()? },
        tensors: lexi::packed_tensor_bytes(&packed),
        report: &report,
        pruned,
        looked: true,
        in_parts: false,
        ply_bytes: read.source.file_bytes,
        file_bytes,
        seconds: [read_seconds, look_seconds, pack_seconds, write_seconds, start.elapsed().as_secs_f64()],
    };
    tell(common, output, || Ok(outcome.json(&read.warnings)), || outcome.text())
}

fn options(args: &Compress) -> PackOptions {
    let mut options = PackOptions::default();
    options.tolerance = args.tol;
    options.atoms = args.atoms;
    options.keep_order = args.keep_order;
    options.seed = args.seed;
    options
}

/// Whether to pack a PLY of `bytes` bytes part by part: it takes more memory than there may be, or nothing
/// looks at it.
///
/// # Errors
/// It does, and an option needs all of it.
pub(crate) fn is_large(args: &Compress, bytes: usize) -> Result<bool> {
    if args.guess {
        // What looking needs memory for is not done.
        return Ok(true);
    }
    let needed = (bytes as u64).saturating_mul(MEMORY_PER_BYTE);
    if needed <= args.memory {
        return Ok(false);
    }
    match args.whole_only() {
        None => Ok(true),
        Some(option) => {
            let expected =
                format!("at least {needed} bytes, for {option} needs the whole scene; or --preset");
            Err(Error::parameter("memory", args.memory, expected).into())
        }
    }
}

/// Packs `ply` part by part and writes it to `output`. `start` is when the command began.
pub(crate) fn run_in_parts(
    args: &Compress,
    common: &Common,
    output: &Path,
    ply: &PlyChunks<'_>,
    bars: &Bars,
    start: Instant,
) -> Result<()> {
    let read_seconds = start.elapsed().as_secs_f64();
    let options = options(args);
    let decibels = args.preset.unwrap_or_default().decibels();
    let clock = Instant::now();
    let mut renderer = if args.guess { Renderer::cpu() } else { Renderer::open(args.device)? };
    let device = renderer.is_gpu().then(|| renderer.name().to_owned());
    let mut look_seconds = 0.0;
    let mut judge = |part: &Splats| -> Result<Sensitivity> {
        let clock = Instant::now();
        let seen = Views::of_part(part).sensitivity(&mut renderer, part, &mut || ());
        look_seconds += clock.elapsed().as_secs_f64();
        Ok(seen?)
    };
    let importance =
        if args.guess { Importance::Heuristic } else { Importance::Judge { judge: &mut judge, device } };
    // Either one or the other writes.
    let importance = Cell::new(Some(importance));
    let once = || importance.take().unwrap_or(Importance::Heuristic);
    let done = write_output(
        output,
        common.overwrite,
        |path| stream::pack_file(ply, once(), &options, decibels, path, bars),
        |out| stream::pack_to(ply, once(), &options, decibels, out, bars),
    )?;
    let file_bytes = done.file_bytes();
    let pack_seconds = clock.elapsed().as_secs_f64() - look_seconds;
    let outcome = Outcome {
        output,
        packed: &done.head,
        streams: done.stream_bits,
        tensors: done.tensor_bytes,
        report: &done.report,
        pruned: None,
        looked: !args.guess,
        in_parts: true,
        ply_bytes: ply.summary().file_bytes,
        file_bytes,
        seconds: [read_seconds, look_seconds, pack_seconds, 0.0, start.elapsed().as_secs_f64()],
    };
    tell(common, output, || Ok(outcome.json(ply.warnings())), || outcome.text())
}

fn goal(args: &Compress, ply_bytes: u64) -> Result<Option<Goal>> {
    if let Some(ratio) = args.ratio {
        if !ratio.is_finite() || ratio <= 1.0 {
            return Err(Error::parameter("ratio", ratio, "a finite number above 1").into());
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the PLY's size")]
        return Ok(Some(Goal::Size((ply_bytes as f64 / ratio) as u64)));
    }
    Ok(args.psnr.map(Goal::MeanPsnr).or(args.min_psnr.map(Goal::MinPsnr)).or(args.size.map(Goal::Size)))
}

/// Bytes of each attribute, of tables, of the header, and of what is lost by rounding streams to whole
/// words; they sum to the file's size.
pub(crate) fn attribute_bytes(tensors: &[(String, u64)], streams: &[StreamBits]) -> Vec<(String, f64)> {
    let mut out: Vec<(String, f64)> = Vec::new();
    for stream in streams {
        match out.iter_mut().find(|a| a.0 == stream.attribute) {
            Some(found) => found.1 += stream.bits / 8.0,
            None => out.push((stream.attribute.to_owned(), stream.bits / 8.0)),
        }
    }
    let coded: f64 = out.iter().map(|a| a.1).sum();
    for (name, bytes) in tensors {
        let bytes = *bytes as f64;
        match name.strip_prefix("packed.") {
            Some("data") => out.push(("rounding".to_owned(), bytes - coded)),
            Some(name) => out.push((name.to_owned(), bytes)),
            None => out.push((name.clone(), bytes)),
        }
    }
    out
}

/// Bytes that stand for SH-rest: dictionary and codes.
pub(crate) fn sh_bytes(streams: &[StreamBits]) -> f64 {
    let is_sh = |s: &&StreamBits| s.attribute == "dictionary" || s.attribute.starts_with("codes.");
    streams.iter().filter(is_sh).map(|s| s.bits / 8.0).sum()
}

/// What was done, to be told in text or JSON.
struct Outcome<'a> {
    output: &'a Path,
    packed: &'a Packed,
    streams: Vec<StreamBits>,
    tensors: Vec<(String, u64)>,
    report: &'a PackReport,
    pruned: Option<Pruned>,
    /// Whether views said what shows, or a guess.
    looked: bool,
    /// Whether the scene was never whole in memory.
    in_parts: bool,
    ply_bytes: u64,
    file_bytes: u64,
    /// Reading, looking, packing, writing, everything.
    seconds: [f64; 5],
}

impl Outcome<'_> {
    fn json(&self, warnings: &[String]) -> Value {
        let (packed, report, record) = (self.packed, self.report, &self.packed.record);
        let streams = &self.streams;
        let whole = |bytes: f64| (bytes * 8.0).round() / 8.0;
        let attributes: serde_json::Map<String, Value> = attribute_bytes(&self.tensors, streams)
            .into_iter()
            .map(|(name, bytes)| (name, json!(whole(bytes))))
            .collect();
        let dim = packed.degree.rest();
        let nonzeros = report.mean_nonzeros;
        json!({
            "output": self.output.display().to_string(),
            "gaussians": packed.gaussians,
            "sh_degree": packed.degree.get(),
            "atoms": packed.atoms,
            "layout": record.layout.name(),
            "tol": record.tolerance,
            "seed": record.seed,
            "mean_nonzeros": nonzeros,
            "coefficient_ratio": (nonzeros > 0.0).then(|| dim as f64 / nonzeros),
            "nonzero_histogram": report.nonzero_histogram,
            "escapes": report.escapes,
            "over_tolerance": record.over_tolerance,
            "max_residual": record.max_residual,
            "rms_residual": record.rms_residual,
            "ply_bytes": self.ply_bytes,
            "file_bytes": self.file_bytes,
            "sh_bytes": whole(sh_bytes(streams)),
            "dense_sh_bytes": packed.gaussians * dim * 4,
            "attribute_bytes": attributes,
            "promise": packed.target,
            "importance": if self.looked { "views" } else { "guess" },
            "device": self.packed.device.as_deref().unwrap_or("cpu"),
            "pruned": self.pruned.map(|p| json!({
                "gaussians": p.removed,
                "largest_change": p.largest_change,
                "views": p.views,
            })),
            "read_seconds": self.seconds[0],
            "look_seconds": self.seconds[1],
            "learn_seconds": report.learn_seconds,
            "code_seconds": report.code_seconds,
            "pack_seconds": self.seconds[2],
            "write_seconds": self.seconds[3],
            "total_seconds": self.seconds[4],
            "warnings": warnings,
        })
    }

    fn text(&self) -> Result<String> {
        use std::fmt::Write as _;
        let (packed, report) = (self.packed, self.report);
        let mut out = String::new();
        let mut line = |label: &str, text: String| writeln!(out, "{label:<12} {text}");
        let gaussians = format::count(packed.gaussians as u64);
        line(
            "wrote",
            format!("{}: {gaussians} Gaussians, SH degree {}", self.output.display(), packed.degree),
        )?;
        line(
            "file bytes",
            format!(
                "{} of {}: {} smaller (whole file against the PLY), {:.2} bytes a Gaussian",
                format::bytes(self.file_bytes),
                format::bytes(self.ply_bytes),
                format::ratio(self.ply_bytes, self.file_bytes),
                self.file_bytes as f64 / packed.gaussians.max(1) as f64
            ),
        )?;
        if let Some(p) = self.pruned {
            line(
                "pruned",
                format!(
                    "{} Gaussians; no pixel of {} views changes by more than {:.2} of 255 levels for it",
                    format::count(p.removed as u64),
                    p.views,
                    p.largest_change * LEVELS
                ),
            )?;
        }
        if let Some(p) = &packed.target {
            line("pictures", promise_line(p))?;
        }
        if packed.degree.rest() > 0 {
            line(
                "codes",
                format!("{:.2} nonzeros a Gaussian over {} atoms", report.mean_nonzeros, packed.atoms),
            )?;
        }
        if packed.record.tolerance.is_some() {
            line("error", error_line(&packed.record))?;
            if report.escapes > 0 {
                line("escapes", format!("{} Gaussians' SH stored exactly", format::count(report.escapes)))?;
            }
        }
        let bits = |(name, bytes): &(String, f64)| {
            format!("{name} {:.1}", 8.0 * bytes / packed.gaussians.max(1) as f64)
        };
        let attributes = attribute_bytes(&self.tensors, &self.streams);
        let parts: Vec<String> = attributes.iter().map(bits).collect();
        line("bits each", parts.join(", "))?;
        match (self.looked, self.in_parts) {
            (false, _) => line("scene", "what shows was guessed".to_owned())?,
            (true, true) => {
                line("scene", "larger than --memory, so looked at and packed part by part".to_owned())?;
            }
            (true, false) => {}
        }
        let [read, look, pack, write, all] = self.seconds;
        line(
            "seconds",
            format!("{all:.1}: reading {read:.1}, looking {look:.1}, packing {pack:.1}, writing {write:.1}"),
        )?;
        Ok(out)
    }
}

/// What a file of a given quality or size reached.
pub(crate) fn promise_line(p: &lexisplat::packed::TargetRecord) -> String {
    let kind = if p.cameras { "given cameras" } else { "generated views" };
    format!("{:.2} dB on average, {:.2} dB at worst, over {} {kind}", p.mean_psnr, p.min_psnr, p.views)
}
