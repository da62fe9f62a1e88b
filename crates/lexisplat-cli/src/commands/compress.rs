//! `lexisplat compress`.

use std::path::Path;
use std::time::Instant;

use anyhow::Result;
use lexisplat::output::Output;
use lexisplat::ply::{PlyChunks, ReadOptions};
use lexisplat::stream::Compressed;
use lexisplat::{CompressOptions, DEFAULT_TOLERANCE, Error, Layout, lexi, ply, stream};
use serde_json::json;

use lexisplat_eval::format;

use crate::args::{Common, Compress};
use crate::files::{check_output, existing, input, is_pipe, output_path, tell, warn, write_output};
use crate::progress::Bars;
use crate::stop::{self, Work};

/// Bytes of SH-rest a coefficient takes in a PLY.
const COEFFICIENT_BYTES: u64 = 4;

pub(crate) fn run(args: &Compress, common: &Common) -> Result<()> {
    let start = Instant::now();
    let output = output_path(&args.input, args.output.as_deref(), "lexi")?;
    if is_pipe(&output) && common.json {
        let expected = "a file: with --json standard output carries the report";
        return Err(Error::parameter("output", "-", expected).into());
    }
    let mut inputs = vec![args.input.as_path()];
    inputs.extend(args.dictionary.as_deref());
    check_output(&output, &inputs, common.overwrite)?;
    if let Some(path) = &args.save_dictionary {
        inputs.push(&output);
        check_output(path, &inputs, common.overwrite)?;
    }
    stop::while_writing(match &args.save_dictionary {
        _ if is_pipe(&output) => Work::Stream,
        None => Work::Files(1),
        Some(_) => Work::Files(2),
    });
    let layout = args.chosen_layout()?;
    let limits = common.limits()?;
    let mut options = CompressOptions::default();
    options.tolerance = match (args.tol, args.max_nnz) {
        (None, Some(_)) => None,
        (tol, _) => Some(tol.unwrap_or(DEFAULT_TOLERANCE)),
    };
    options.max_nonzeros = args.max_nnz;
    options.atoms = args.atoms;
    options.pursuit = args.pursuit.unwrap_or(options.pursuit);
    options.layout = layout;
    options.sample = args.sample.unwrap_or(options.sample);
    options.seed = args.seed;
    if let Some(path) = &args.dictionary {
        options.dictionary = Some(lexi::read_dictionary(path, &limits)?);
    }

    let (name, bytes) = input(&args.input, common)?;
    let read = ReadOptions { drop_invalid: args.drop_invalid, limits };
    if layout == Layout::Packed && super::pack::is_large(args, bytes.len())? {
        let bars = Bars::new(common.quiet);
        let chunks = PlyChunks::open(&name, &bytes, &read, &bars)?;
        warn(&name, chunks.warnings());
        return super::pack::run_in_parts(args, common, &output, &chunks, &bars, start);
    }
    if layout == Layout::Packed {
        let read = ply::read_bytes(&name, &bytes, &read)?;
        warn(&name, &read.warnings);
        return super::pack::run(args, common, &output, read, start);
    }
    let bars = Bars::new(common.quiet);
    let chunks = PlyChunks::open(&name, &bytes, &read, &bars)?;
    warn(&name, chunks.warnings());
    let read_seconds = start.elapsed().as_secs_f64();
    let done = write_output(
        &output,
        common.overwrite,
        |path| stream::compress_file(&chunks, &options, path, &bars),
        |out| stream::compress_to(&chunks, &options, out, &bars),
    )?;
    if let Some(path) = &args.save_dictionary {
        lexi::write_dictionary(Output::new(path, existing(common.overwrite)), &done.dictionary)?;
    }
    let outcome = Outcome {
        output: &output,
        done: &done,
        ply_bytes: chunks.summary().file_bytes,
        seconds: [read_seconds, start.elapsed().as_secs_f64()],
    };
    tell(common, &output, || Ok(outcome.json(chunks.warnings())), || outcome.text())
}

/// What was done, to be told in text or JSON.
struct Outcome<'a> {
    output: &'a Path,
    done: &'a Compressed,
    ply_bytes: u64,
    /// Reading, everything.
    seconds: [f64; 2],
}

impl Outcome<'_> {
    fn dense_sh_bytes(&self) -> u64 {
        (self.done.gaussians * self.done.dictionary.dim()) as u64 * COEFFICIENT_BYTES
    }

    fn json(&self, warnings: &[String]) -> serde_json::Value {
        let (done, report, record) = (self.done, &self.done.report, &self.done.record);
        let attributes: serde_json::Map<String, serde_json::Value> =
            done.attribute_bytes.iter().map(|(name, bytes)| (name.clone(), (*bytes).into())).collect();
        json!({
            "output": self.output.display().to_string(),
            "gaussians": done.gaussians,
            "sh_degree": done.dictionary.degree().get(),
            "atoms": done.dictionary.len(),
            "pursuit": record.pursuit.name(),
            "layout": record.layout.name(),
            "tol": record.tolerance,
            "max_nnz": record.max_nonzeros,
            "seed": record.seed,
            "mean_nonzeros": report.mean_nonzeros,
            "coefficient_ratio": report.coefficient_ratio(),
            "nonzero_histogram": report.nonzero_histogram,
            "escapes": report.escapes,
            "over_tolerance": record.over_tolerance,
            "max_residual": record.max_residual,
            "rms_residual": record.rms_residual,
            "ply_bytes": self.ply_bytes,
            "file_bytes": done.file_bytes(),
            "sh_bytes": done.sh_bytes(),
            "dense_sh_bytes": self.dense_sh_bytes(),
            "attribute_bytes": attributes,
            "learn_rounds": report.learned.as_ref().map(|l| l.rounds),
            "learn_sample": report.learned.as_ref().map(|l| l.sample),
            "held_out_nonzeros": report.learned.as_ref().map(|l| l.held_out_nonzeros),
            "read_seconds": self.seconds[0],
            "learn_seconds": report.learn_seconds,
            "code_seconds": report.code_seconds,
            "write_seconds": done.write_seconds,
            "total_seconds": self.seconds[1],
            "warnings": warnings,
        })
    }

    fn text(&self) -> Result<String> {
        use std::fmt::Write as _;
        let (done, report, record) = (self.done, &self.done.report, &self.done.record);
        let dim = done.dictionary.dim();
        let mut out = String::new();
        let mut line = |label: &str, text: String| writeln!(out, "{label:<12} {text}");
        let gaussians = format::count(done.gaussians as u64);
        line(
            "wrote",
            format!(
                "{}: {gaussians} Gaussians, SH degree {}",
                self.output.display(),
                done.dictionary.degree()
            ),
        )?;
        match &report.learned {
            Some(l) if dim > 0 => {
                let sample = format::count(l.sample as u64);
                let atoms = done.dictionary.len();
                line(
                    "dictionary",
                    format!(
                        "{atoms} atoms from {sample} Gaussians in {} rounds, {:.1} s",
                        l.rounds, report.learn_seconds
                    ),
                )?;
            }
            Some(_) => line("dictionary", "none: no view-dependent colour".to_owned())?,
            None => line("dictionary", format!("{} atoms, given", done.dictionary.len()))?,
        }
        if let Some(ratio) = report.coefficient_ratio() {
            let rate = done.gaussians as f64 / report.code_seconds.max(1e-9);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a rate to look at")]
            let rate = format::count(rate as u64);
            line(
                "codes",
                format!(
                    "{:.2} of {dim} nonzeros a Gaussian: {ratio:.2}x fewer coefficients (the paper's ratio), {:.1} s, {rate} a second",
                    report.mean_nonzeros, report.code_seconds
                ),
            )?;
        }
        line("error", error_line(record))?;
        if report.escapes > 0 {
            line("escapes", format!("{} Gaussians stored exactly", format::count(report.escapes)))?;
        }
        let sh = done.sh_bytes();
        if dim > 0 {
            let dense = self.dense_sh_bytes();
            line(
                "SH bytes",
                format!(
                    "{} of {}: {} smaller (dictionary, codes, escapes; against dense f32)",
                    format::bytes(sh),
                    format::bytes(dense),
                    format::ratio(dense, sh)
                ),
            )?;
        }
        line(
            "file bytes",
            format!(
                "{} of {}: {} smaller (whole file against the PLY)",
                format::bytes(done.file_bytes()),
                format::bytes(self.ply_bytes),
                format::ratio(self.ply_bytes, done.file_bytes())
            ),
        )?;
        let parts: Vec<String> = done
            .attribute_bytes
            .iter()
            .map(|(name, bytes)| format!("{name} {}", format::bytes(*bytes)))
            .collect();
        line("of which", parts.join(", "))?;
        Ok(out)
    }
}

/// The realised error beside what was promised.
pub(crate) fn error_line(record: &lexisplat::Record) -> String {
    let realised = format!("maximum {:.6}, RMS {:.6}", record.max_residual, record.rms_residual);
    match (record.tolerance, record.max_nonzeros) {
        (Some(tol), None) => format!("{realised}; promised: at most {tol} for every Gaussian"),
        (Some(tol), Some(cap)) => format!(
            "{realised}; {} Gaussians are over {tol} (at most {cap} nonzeros were allowed, so nothing is promised)",
            format::count(record.over_tolerance)
        ),
        (None, _) => format!("{realised}; nothing is promised without --tol"),
    }
}
