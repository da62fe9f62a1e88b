//! `lexisplat compare`.

use std::borrow::Cow;
use std::fmt::Write as _;

use anyhow::Result;
use lexisplat::{Model, Progress, Splats};
use lexisplat_compress::views::marked;
use lexisplat_compress::{DrawOptions, Viewpoints, belong, judging_views, read_beside};
use lexisplat_eval::metrics::Metric;
use lexisplat_eval::{Comparison, Loaded, SceneFile, Whereabouts, compare, format, montage, png};
use lexisplat_render::{Camera, Renderer, Split};
use serde_json::json;

use super::compress::{cameras_not_used, record_line};
use super::scores::ScoreTable;
use crate::args::{Common, Compare, Views};
use crate::device::open_renderer;
use crate::files::{check_free, is_pipe, load, make_folder, note, tell, view_name, warn_of, write_bytes};
use crate::progress::Bars;
use crate::stop::{self, Work};

/// Most cameras beside a scene that pictures are compared from. Each takes as long as two pictures of the scene. Of the 35
/// cameras of room-large, at 1,200 pixels, 18 are drawn; they show 40.50 dB in 6 seconds, all of them 40.59 in 11.
const MOST_BESIDE: usize = 24;

pub(crate) fn run(args: &Compare, common: &Common) -> Result<()> {
    let (a, mut b) = (load(&args.a, common)?, load(&args.b, common)?);
    b.align(&Whereabouts::of(&a.scene()));
    warn_of(&a);
    warn_of(&b);
    let (scene_a, scene_b) = (a.scene(), b.scene());
    let views = &args.views;
    let mut renderer = open_renderer(views.device)?;
    let bars = Bars::new(common.quiet);
    let beside = beside(args, &a, common, &mut renderer, &bars)?;
    let found = beside.is_none() && views.cameras.is_none() && views.viewpoints == Viewpoints::Auto;
    let cameras = match beside {
        Some(cameras) => cameras,
        None if found => photographs(&a, views, &mut renderer, &bars)?,
        None => super::cameras(views, &scene_a)?,
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

/// Returns the cameras that lie beside `a`, if a search for them is allowed and they seem to belong to the scene: the
/// test cameras if the file marks some, and at most [`MOST_BESIDE`]. A note names the file of the cameras.
fn beside(
    args: &Compare,
    a: &SceneFile,
    common: &Common,
    renderer: &mut Renderer,
    progress: &dyn Progress,
) -> Result<Option<Vec<Camera>>> {
    let views = &args.views;
    let chosen = views.cameras.is_some() || views.viewpoints != Viewpoints::Auto || views.orbit.is_some();
    if chosen || args.no_cameras || is_pipe(&args.a) {
        return Ok(None);
    }
    let Some((path, set)) = read_beside(&args.a) else { return Ok(None) };
    let cameras = set.relative_to(a.scene().meta().offset).cameras;
    let used = belong(renderer, &splats(a), &cameras, progress)?;
    let all = cameras.len();
    let cameras = marked(&cameras, Split::Test);
    let step = cameras.len().div_ceil(MOST_BESIDE).max(1);
    let sharp = |camera: &Camera| camera.with_max_width(views.width).with_near(views.near);
    let cameras: Vec<Camera> = cameras.into_iter().step_by(step).map(sharp).collect();
    if !common.quiet {
        note(&match used {
            true => format!(
                "note: drawn from {} of the {all} cameras of {}; --no-cameras looks for views from elsewhere too",
                cameras.len(),
                path.display()
            ),
            false => cameras_not_used(&path),
        });
    }
    Ok(used.then_some(cameras))
}

/// Returns views of `a` that are like photographs. Views of this kind judge the files of `compress`.
fn photographs(
    a: &SceneFile,
    views: &Views,
    renderer: &mut Renderer,
    progress: &dyn Progress,
) -> Result<Vec<Camera>> {
    let found = judging_views(renderer, &splats(a), views.generated().into(), progress)?;
    Ok(found.iter().map(|camera| camera.with_max_width(views.width)).collect())
}

/// Returns the Gaussians of `file` with dense SH.
fn splats(file: &SceneFile) -> Cow<'_, Splats> {
    match &file.loaded {
        Loaded::Ply(read) => Cow::Borrowed(&read.splats),
        Loaded::Other(read) => Cow::Borrowed(&read.splats),
        Loaded::Lexi(model, _) => Cow::Owned(Model::clone(model).into_splats()),
    }
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
