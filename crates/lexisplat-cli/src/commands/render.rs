//! `lexisplat render`.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::Result;
use lexisplat::Progress;
use lexisplat_eval::png;
use lexisplat_render::RenderOptions;
use serde_json::json;

use crate::args::{Common, Render};
use crate::device::open_renderer;
use crate::files::{
    check_free, is_pipe, load, make_folder, print, print_json, view_name, warn_of, write_bytes,
};
use crate::progress::Bars;
use crate::stop::{self, Work};

pub(crate) fn run(args: &Render, common: &Common) -> Result<()> {
    let folder = args.output.clone().unwrap_or_else(|| {
        let stem = if is_pipe(&args.file) {
            "stdin".into()
        } else {
            args.file.file_stem().unwrap_or_default().to_owned()
        };
        let mut name = stem;
        name.push("-views");
        args.file.with_file_name(name)
    });
    let input = load(&args.file, common)?;
    warn_of(&input);
    let scene = input.scene();
    let views = &args.views;
    let cameras = views.choose(scene.geometry())?;
    let paths: Vec<PathBuf> =
        cameras.iter().enumerate().map(|(i, c)| folder.join(view_name(i, cameras.len(), &c.name))).collect();
    for path in &paths {
        check_free(path, &[], common.overwrite)?;
    }
    let mut renderer = open_renderer(views.device)?;
    let prepared = renderer.prepare(scene)?;
    stop::while_writing(Work::Files(paths.len()));
    make_folder(&folder)?;
    let options = RenderOptions { background: views.background, ..RenderOptions::default() };
    let bars = Bars::new(common.quiet);
    bars.start("drawing", "views", cameras.len() as u64);
    let mut done = Vec::new();
    let mut drawing = 0.0;
    for (camera, path) in cameras.iter().zip(&paths) {
        let clock = Instant::now();
        let picture = renderer.render(&prepared, camera, &options)?;
        let seconds = clock.elapsed().as_secs_f64();
        drawing += seconds;
        write_bytes(path, &png(picture.width, picture.height, &picture.to_8bit())?, common.overwrite)?;
        bars.advance(1);
        done.push(json!({
            "camera": camera.name,
            "file": path.display().to_string(),
            "width": picture.width,
            "height": picture.height,
            "milliseconds": seconds * 1000.0,
        }));
    }
    bars.end();
    if common.json {
        return print_json(&json!({ "scene": input.name, "device": renderer.name(), "views": done }));
    }
    if common.quiet {
        return Ok(());
    }
    let each = drawing * 1000.0 / cameras.len() as f64;
    print(&format!(
        "wrote {} pictures to {}, {each:.0} ms each to draw ({})\n",
        cameras.len(),
        folder.display(),
        renderer.name()
    ))
}
