//! `lexisplat info`.

mod codes;

use std::fmt::Write as _;

use anyhow::Result;
use lexisplat::Splats;
use lexisplat::stats::{Lint, NORM_BINS, lint};
use lexisplat_eval::{Loaded, SceneFile, text};
use serde_json::json;

use crate::args::{Common, Info};
use crate::files::{load, print, print_json, warn, warn_of};

/// Width of the longest bar of a histogram, in characters.
const BAR: usize = 40;

pub(crate) fn run(args: &Info, common: &Common) -> Result<()> {
    let input = load(&args.file, args.drop_invalid)?;
    warn_of(&input);
    let dense;
    let splats: &Splats = match &input.loaded {
        Loaded::Ply(read) => &read.splats,
        Loaded::Lexi(model, _) => {
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

fn as_json(input: &SceneFile, splats: &Splats, lint: &Lint) -> Result<serde_json::Value> {
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
        Loaded::Lexi(model, packed) => {
            value["kind"] = "lexi".into();
            value["lexi"] = codes::as_json(model, packed.as_deref())?;
        }
    }
    Ok(value)
}

fn as_text(input: &SceneFile, splats: &Splats, lint: &Lint) -> Result<String> {
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
        Loaded::Lexi(model, packed) => codes::as_text(&mut out, model, packed.as_deref())?,
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

pub(super) fn bars(out: &mut String, labels: &[String], counts: &[u64]) -> Result<()> {
    let most = counts.iter().copied().max().unwrap_or(0).max(1);
    for (label, &count) in labels.iter().zip(counts) {
        let length = (u128::from(count) * BAR as u128).div_ceil(u128::from(most));
        let length = usize::try_from(length).unwrap_or(BAR);
        writeln!(out, "  {label:>12} {:>10} {}", text::count(count), "#".repeat(length))?;
    }
    Ok(())
}
