//! `lexisplat compare`.

use std::fmt::Write as _;

use anyhow::Result;
use lexisplat::{Model, Progress};
use lexisplat_compress::{DrawOptions, Viewpoints, judging_views};
use lexisplat_eval::metrics::Metric;
use lexisplat_eval::{Comparison, Loaded, SceneFile, Whereabouts, compare, format, montage, png};
use lexisplat_render::{Camera, Renderer};
use serde_json::json;

use super::compress::record_line;
use super::scores::ScoreTable;
use crate::args::{Common, Compare, Views};
use crate::device::open_renderer;
use crate::files::{check_free, load, make_folder, tell, view_name, warn_of, write_bytes};
use crate::progress::Bars;
use crate::stop::{self, Work};

pub(crate) fn run(args: &Compare, common: &Common) -> Result<()> {
    let (a, mut b) = (load(&args.a, common)?, load(&args.b, common)?);
    b.align(&Whereabouts::of(&a.scene()));
    warn_of(&a);
    warn_of(&b);
    let (scene_a, scene_b) = (a.scene(), b.scene());
    let views = &args.views;
    let mut renderer = open_renderer(views.device)?;
    let bars = Bars::new(common.quiet);
    let found = views.cameras.is_none() && views.viewpoints == Viewpoints::Auto;
    let cameras = match found {
        true => photographs(&a, views, &mut renderer, &bars)?,
        false => super::cameras(views, &scene_a)?,
    };
    let mut saved = Vec::new();
    if let Some(folder) = &args.save_views {
        for (i, camera) in cameras.iter().enumerate() {
            let path = folder.join(view_name(i, cameras.len(), &camera.name));
            check_free(&path, &[], common.overwrite)?;
            saved.push(path);
        }
        // The scores are printed after all pictures are written.
        stop::while_writing(Work::Files(usize::MAX));
        make_folder(folder)?;
    }
    let mut paths = saved.iter();
    let options = DrawOptions::new(views.background, args.eight_bit);
    let comparison =
        compare(&mut renderer, &scene_a, &scene_b, &cameras, &options, &bars, |_, image_a, image_b| {
            let Some(path) = paths.next() else { return Ok(()) };
            let (width, height, pixels) = montage::montage(image_a, image_b);
            write_bytes(path, &png(width, height, &pixels)?, common.overwrite)
        })?;
    let json = json!({
        "a": { "file": a.name, "bytes": a.bytes, "gaussians": scene_a.len() },
        "b": { "file": b.name, "bytes": b.bytes, "gaussians": scene_b.len() },
        "ratio": if b.bytes > 0 { Some(a.bytes as f64 / b.bytes as f64) } else { None },
        "device": renderer.name(),
        "eight_bit": args.eight_bit,
        "identical": comparison.identical,
        "psnr": comparison.psnr,
        "ssim": comparison.ssim,
        "views": comparison.views,
        "found_views": found,
        "recorded": b.packed_head().and_then(|head| head.reached),
        "saved": saved.iter().map(|p| p.display().to_string()).collect::<Vec<_>>(),
    });
    tell(common, json, || table(&a, &b, &comparison, args, renderer.name()))
}

/// Returns views of `a` that are like photographs. Views of this kind judge the files of `compress`.
fn photographs(
    a: &SceneFile,
    views: &Views,
    renderer: &mut Renderer,
    progress: &dyn Progress,
) -> Result<Vec<Camera>> {
    let count = usize::from(views.orbit);
    let found = match &a.loaded {
        Loaded::Ply(read) => judging_views(renderer, &read.splats, count, progress)?,
        Loaded::Other(read) => judging_views(renderer, &read.splats, count, progress)?,
        Loaded::Lexi(model, _) => {
            judging_views(renderer, &Model::clone(model).into_splats(), count, progress)?
        }
    };
    Ok(found.iter().map(|camera| camera.with_max_width(views.width)).collect())
}

fn table(
    a: &SceneFile,
    b: &SceneFile,
    comparison: &Comparison,
    args: &Compare,
    device: &str,
) -> Result<String> {
    let mut out = String::new();
    let scores = ScoreTable::new(
        comparison,
        |metric| if metric == Metric::Psnr { 10 } else { 8 },
        |metric, value| match metric {
            Metric::Psnr => format::decibels(value),
            _ => format!("{:.5}", value.unwrap_or(1.0)),
        },
    );
    scores.views(&mut out)?;
    if comparison.identical {
        writeln!(out, "all views are identical")?;
    } else {
        scores.summary(&mut out)?;
    }
    for input in [a, b] {
        writeln!(out, "{:>10}  {}", format::bytes(input.bytes), input.name)?;
    }
    writeln!(out, "{:>10}  first file over second, whole files", format::ratio(a.bytes, b.bytes))?;
    writeln!(out, "{:>10}  {device}", "drawn on")?;
    if let Some(line) =
        b.packed_head().and_then(|head| record_line(head.reached.as_ref(), head.target.as_ref()))
    {
        writeln!(out, "{:>10}  {line}, says the second file", "recorded")?;
    }
    if let Some(folder) = &args.save_views {
        let times = montage::AMPLIFICATION;
        writeln!(out, "saved to {}: first, second, difference times {times}", folder.display())?;
    }
    Ok(out)
}
