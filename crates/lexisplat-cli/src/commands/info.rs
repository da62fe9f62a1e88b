//! `lexisplat info`.

use std::fmt::Write as _;

use anyhow::Result;
use lexisplat::stats::{Lint, NORM_BINS, lint};
use lexisplat::{Model, Splats, lexi};
use serde_json::json;

use super::compress::error_line;
use crate::args::{Common, Info};
use crate::files::{Input, Loaded, load, print, print_json, warn};
use crate::text;

/// Width of the longest bar of a histogram, in characters.
const BAR: usize = 40;

pub(crate) fn run(args: &Info, common: &Common) -> Result<()> {
    let input = load(&args.file, args.drop_invalid)?;
    input.warn();
    let dense;
    let splats: &Splats = match &input.loaded {
        Loaded::Ply(read) => &read.splats,
        Loaded::Lexi(model) => {
            dense = model.to_splats();
            &dense
        }
    };
    let lint = lint(splats)?;
    if common.json {
        return print_json(&as_json(&input, splats, &lint)?);
    }
    warn(&input.name, &lint.warnings);
    if common.quiet {
        return Ok(());
    }
    print(&as_text(&input, splats, &lint)?)
}

fn nonzero_histogram(model: &Model) -> Vec<u64> {
    let mut histogram = vec![0; model.degree().rest() + 1];
    for &count in model.codes.counts() {
        histogram[usize::from(count)] += 1;
    }
    let escapes = model.codes.escapes().gaussians.len() as u64;
    histogram[0] -= escapes;
    histogram
}

fn as_json(input: &Input, splats: &Splats, lint: &Lint) -> Result<serde_json::Value> {
    let mut value = json!({
        "file": input.name,
        "file_bytes": input.bytes,
        "gaussians": splats.len(),
        "sh_degree": splats.degree.get(),
        "antialiased": splats.meta.antialiased,
        "comments": splats.meta.comments,
        "extras": splats.geometry.extras.iter().map(|e| &e.name).collect::<Vec<_>>(),
        "statistics": lint,
        "norm_bins": NORM_BINS,
    });
    match &input.loaded {
        Loaded::Ply(read) => {
            value["kind"] = "ply".into();
            value["ply"] = serde_json::to_value(&read.source)?;
            value["warnings"] = json!(read.warnings);
        }
        Loaded::Lexi(model) => {
            let record = &model.record;
            value["kind"] = "lexi".into();
            value["lexi"] = json!({
                "version": lexi::VERSION,
                "layout": record.layout.name(),
                "pursuit": record.pursuit.name(),
                "tol": record.tolerance,
                "max_nnz": record.max_nonzeros,
                "seed": record.seed,
                "max_residual": record.max_residual,
                "rms_residual": record.rms_residual,
                "over_tolerance": record.over_tolerance,
                "atoms": model.dictionary.len(),
                "nonzeros": model.codes.nonzeros(),
                "escapes": model.codes.escapes().gaussians.len(),
                "nonzero_histogram": nonzero_histogram(model),
                "attribute_bytes": lexi::attribute_bytes(model)?.into_iter()
                    .map(|(name, bytes)| (name, bytes.into()))
                    .collect::<serde_json::Map<String, serde_json::Value>>(),
                "sh_bytes": lexi::sh_bytes(model)?,
                "checksums": "ok",
            });
        }
    }
    Ok(value)
}

fn as_text(input: &Input, splats: &Splats, lint: &Lint) -> Result<String> {
    let mut out = String::new();
    let count = text::count(splats.len() as u64);
    writeln!(
        out,
        "{}: {}, {count} Gaussians, SH degree {}",
        input.name,
        text::bytes(input.bytes),
        splats.degree
    )?;
    if splats.meta.antialiased {
        writeln!(out, "trained with the anti-aliased dilation, and drawn so")?;
    }
    for comment in &splats.meta.comments {
        writeln!(out, "comment: {comment}")?;
    }
    match &input.loaded {
        Loaded::Ply(read) => {
            let source = &read.source;
            let kind = serde_json::to_value(source.dialect)?;
            let format = serde_json::to_value(source.format)?;
            writeln!(
                out,
                "PLY, {}, layout {}, {} properties, {} bytes a Gaussian",
                format.as_str().unwrap_or_default(),
                kind.as_str().unwrap_or_default(),
                source.properties.len(),
                source.row_bytes
            )?;
        }
        Loaded::Lexi(model) => lexi_text(&mut out, model)?,
    }
    writeln!(out, "\n{:<12} {:>12} {:>12} {:>12}", "attribute", "minimum", "mean", "maximum")?;
    for a in &lint.attributes {
        writeln!(out, "{:<12} {:>12.5} {:>12.5} {:>12.5}", a.name, a.min, a.mean, a.max)?;
    }
    if splats.degree.rest() > 0 {
        writeln!(out, "\nnorm of a Gaussian's SH without DC, mean {:.4}", lint.mean_rest_norm)?;
        let labels = NORM_BINS.iter().map(|from| format!("{from} and up")).collect::<Vec<_>>();
        bars(&mut out, &labels, &lint.rest_norms)?;
    }
    Ok(out)
}

fn lexi_text(out: &mut String, model: &Model) -> Result<()> {
    let record = &model.record;
    writeln!(
        out,
        ".lexi version {}, layout {}, pursuit {}, {} atoms, all checksums right",
        lexi::VERSION,
        record.layout,
        record.pursuit,
        model.dictionary.len()
    )?;
    writeln!(out, "error: {}", error_line(record))?;
    let escapes = model.codes.escapes().gaussians.len();
    let mean = model.codes.nonzeros() as f64 / model.len().max(1) as f64;
    writeln!(out, "codes: {mean:.2} nonzeros a Gaussian, {escapes} stored exactly")?;
    writeln!(out, "\nbytes")?;
    for (name, bytes) in lexi::attribute_bytes(model)? {
        let each = bytes as f64 / model.len().max(1) as f64;
        writeln!(out, "  {name:<18} {:>10}  {each:>8.2} a Gaussian", text::bytes(bytes))?;
    }
    if model.degree().rest() > 0 {
        writeln!(out, "\nGaussians by nonzeros")?;
        let histogram = nonzero_histogram(model);
        let last = histogram.iter().rposition(|&n| n > 0).unwrap_or(0);
        let labels: Vec<String> = (0..=last).map(|n| n.to_string()).collect();
        bars(out, &labels, &histogram[..=last])?;
    }
    Ok(())
}

fn bars(out: &mut String, labels: &[String], counts: &[u64]) -> Result<()> {
    let most = counts.iter().copied().max().unwrap_or(0).max(1);
    for (label, &count) in labels.iter().zip(counts) {
        let length = (u128::from(count) * BAR as u128).div_ceil(u128::from(most));
        let length = usize::try_from(length).unwrap_or(BAR);
        writeln!(out, "  {label:>12} {:>10} {}", text::count(count), "#".repeat(length))?;
    }
    Ok(())
}
