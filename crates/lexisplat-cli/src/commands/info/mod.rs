//! `lexisplat info`.

mod codes;

use std::fmt::Write as _;

use anyhow::Result;
use lexisplat::lexi::LexiChunks;
use lexisplat::ply::{PlyChunks, ReadOptions};
use lexisplat::stats::{Lint, NORM_BINS};
use lexisplat::stream::Survey;
use lexisplat::{Splats, lexi, stream};
use lexisplat_eval::format;
use serde_json::json;

use crate::args::{Common, Info};
use crate::files::{input, print, print_json, warn};
use crate::progress::Bars;

/// Width of the longest bar of a histogram, in characters.
const BAR: usize = 40;

pub(crate) fn run(args: &Info, common: &Common) -> Result<()> {
    let (name, bytes) = input(&args.file, common)?;
    let bars = Bars::new(common.quiet || common.json);
    let (scene, lint) = if lexi::is_lexi(&bytes) {
        let lexi = LexiChunks::open(&name, &bytes, &common.limits()?)?;
        let survey = stream::survey(&lexi, &std::env::temp_dir())?;
        let lint = survey.lint.clone();
        (Scene::Lexi(Box::new(lexi), Box::new(survey)), lint)
    } else {
        let read = ReadOptions { drop_invalid: args.drop_invalid, limits: common.limits()? };
        let ply = PlyChunks::open(&name, &bytes, &read, &bars)?;
        warn(&name, ply.warnings());
        let lint = stream::lint_ply(&ply, &bars)?;
        (Scene::Ply(Box::new(ply)), lint)
    };
    let file = File { name: &name, bytes: bytes.len() as u64, scene };
    if common.json {
        return print_json(&as_json(&file, &lint)?);
    }
    warn(&name, &lint.warnings);
    if common.quiet {
        return Ok(());
    }
    print(&as_text(&file, &lint)?)
}

/// A file to be told of.
struct File<'a> {
    name: &'a str,
    bytes: u64,
    scene: Scene<'a>,
}

enum Scene<'a> {
    Ply(Box<PlyChunks<'a>>),
    Lexi(Box<LexiChunks<'a>>, Box<Survey>),
}

impl Scene<'_> {
    /// A scene like it without Gaussians.
    fn empty(&self) -> Splats {
        match self {
            Self::Ply(ply) => ply.empty(),
            Self::Lexi(lexi, _) => lexi.empty(),
        }
    }
}

fn as_json(file: &File<'_>, lint: &Lint) -> Result<serde_json::Value> {
    let like = file.scene.empty();
    let mut value = json!({
        "file": file.name,
        "file_bytes": file.bytes,
        "gaussians": lint.gaussians,
        "sh_degree": like.degree.get(),
        "antialiased": like.meta.antialiased,
        "comments": like.meta.comments,
        "extras": like.geometry.extras.iter().map(|e| &e.name).collect::<Vec<_>>(),
        "statistics": lint,
        "norm_bins": NORM_BINS,
    });
    match &file.scene {
        Scene::Ply(ply) => {
            value["kind"] = "ply".into();
            value["ply"] = serde_json::to_value(ply.summary())?;
            value["warnings"] = json!(ply.warnings());
        }
        Scene::Lexi(lexi, survey) => {
            value["kind"] = "lexi".into();
            value["lexi"] = codes::as_json(lexi, survey);
        }
    }
    Ok(value)
}

fn as_text(file: &File<'_>, lint: &Lint) -> Result<String> {
    let mut out = String::new();
    let like = file.scene.empty();
    let count = format::count(lint.gaussians);
    writeln!(
        out,
        "{}: {}, {count} Gaussians, SH degree {}",
        file.name,
        format::bytes(file.bytes),
        like.degree
    )?;
    if like.meta.antialiased {
        writeln!(out, "trained with the anti-aliased dilation, and drawn so")?;
    }
    for comment in &like.meta.comments {
        writeln!(out, "comment: {comment}")?;
    }
    match &file.scene {
        Scene::Ply(ply) => {
            let source = ply.summary();
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
        Scene::Lexi(lexi, survey) => codes::as_text(&mut out, lexi, survey)?,
    }
    writeln!(out, "\n{:<12} {:>12} {:>12} {:>12}", "attribute", "minimum", "mean", "maximum")?;
    for a in &lint.attributes {
        writeln!(out, "{:<12} {:>12.5} {:>12.5} {:>12.5}", a.name, a.min, a.mean, a.max)?;
    }
    if like.degree.rest() > 0 {
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
        writeln!(out, "  {label:>12} {:>10} {}", format::count(count), "#".repeat(length))?;
    }
    Ok(())
}
