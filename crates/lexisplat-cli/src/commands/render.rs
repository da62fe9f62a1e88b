//! `lexisplat render`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Result;
use lexisplat::Progress;
use lexisplat_render::RenderOptions;
use serde_json::json;

use crate::args::{Common, Render};
use crate::device::open_renderer;
use crate::files::{check_free, is_pipe, load_part, make_folder, tell, view_name, warn_of, write_picture};
use crate::progress::Bars;
use crate::stop::{self, Work};

/// Folder for the pictures of standard input.
const STANDARD_INPUT_VIEWS: &str = "stdin-views";

pub(crate) fn run(args: &Render, common: &Common) -> Result<()> {
    let folder = args.output.clone().unwrap_or_else(|| folder_for(&args.file));
    let input = load_part(&args.file, &args.part, common)?;
    warn_of(&input);
    let scene = input.scene();
    let views = &args.views;
    let cameras = super::cameras(views, &scene)?;
    let paths: Vec<PathBuf> =
        cameras.iter().enumerate().map(|(i, c)| folder.join(view_name(i, cameras.len(), &c.name))).collect();
    for path in &paths {
        check_free(path, &[], common.overwrite)?;
    }
    let mut renderer = open_renderer(views.device)?;
    let prepared = renderer.prepare(scene)?;
    stop::while_writing(Work::Files(paths.len()));
    make_folder(&folder)?;
    let options = RenderOptions::default().with_background(views.background);
    let bars = Bars::new(common.quiet);
    bars.start("drawing", "views", cameras.len() as u64);
    let mut done = Vec::new();
    let mut drawing = 0.0;
    for (camera, path) in cameras.iter().zip(&paths) {
        let clock = Instant::now();
        let picture = renderer.render(&prepared, camera, &options)?;
        let seconds = clock.elapsed().as_secs_f64();
        drawing += seconds;
        write_picture(path, &picture, common.overwrite)?;
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
    let (count, folder, device) = (cameras.len(), folder.display(), renderer.name());
    let each = drawing * 1000.0 / count as f64;
    tell(common, json!({ "scene": input.name, "device": device, "views": done }), || {
        Ok(format!("wrote {count} pictures to {folder}, each drawn in {each:.0} ms on average ({device})\n"))
    })
}

/// Returns the default folder for the pictures of the scene `file`.
fn folder_for(file: &Path) -> PathBuf {
    if is_pipe(file) {
        return PathBuf::from(STANDARD_INPUT_VIEWS);
    }
    let mut name = file.file_stem().unwrap_or_default().to_owned();
    name.push("-views");
    file.with_file_name(name)
}
