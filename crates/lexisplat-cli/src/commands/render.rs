//! `lexisplat render`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Result;
use lexisplat::lexi::{FeedOptions, LexiFeed, StreamedScene};
use lexisplat::packed::{Budget, Eye};
use lexisplat::{Error, FormatError, Progress};
use lexisplat_eval::SceneFile;
use lexisplat_render::{Camera, Image, Prepared, RenderOptions, Renderer, Scene};
use lexisplat_sweep::report::jpeg;
use serde_json::{Map, Value, json};

use super::first_view::FirstView;
use crate::args::{Common, Render};
use crate::device::open_renderer;
use crate::files::{
    check_free, input, is_pipe, load_part, make_folder, tell, view_name, warn_of, write_bytes, write_picture,
};
use crate::progress::Bars;
use crate::stop::{self, Work};

/// Width and height of a poster, in pixels.
const POSTER_SIZE: (u32, u32) = (1280, 720);
/// Folder for the pictures of standard input.
const STANDARD_INPUT_VIEWS: &str = "stdin-views";

pub(crate) fn run(args: &Render, common: &Common) -> Result<()> {
    if let Some(splats) = args.budget {
        return run_within(args, splats, common);
    }
    let input = load_part(&args.file, &args.part, common)?;
    warn_of(&input);
    let scene = input.scene();
    if let Some(path) = &args.poster {
        return poster(args, path, &input, common);
    }
    let cameras = super::cameras(&args.views, &scene)?;
    let pictures = Pictures::new(args, common, &input.name, cameras)?;
    let mut renderer = open_renderer(args.views.device)?;
    let prepared = renderer.prepare(scene)?;
    let options = RenderOptions::default().with_background(args.views.background);
    pictures.draw(&mut renderer, &mut |renderer, camera| {
        Ok((timed(renderer, &prepared, camera, &options)?, Map::new()))
    })
}

/// Draws the view from which viewers show the scene first.
fn poster(args: &Render, path: &Path, input: &SceneFile, common: &Common) -> Result<()> {
    check_free(path, &[], common.overwrite)?;
    stop::while_writing(Work::Files(1));
    let scene = input.scene();
    if scene.is_empty() {
        return Err(
            Error::parameter("scene", "no Gaussians", "one or more, or there is nothing to draw").into()
        );
    }
    let [r, g, b] = args.views.background;
    let view = FirstView::new(&scene, &format!("background={r}:{g}:{b}"))?;
    let camera = view.camera(POSTER_SIZE)?.with_max_width(args.views.width).with_near(args.views.near);
    let mut renderer = open_renderer(args.views.device)?;
    let prepared = renderer.prepare(scene)?;
    let (picture, seconds) = timed(&mut renderer, &prepared, &camera, &view.options())?;
    let end = path.extension().unwrap_or_default().to_ascii_lowercase();
    match end == "jpg" || end == "jpeg" {
        true => write_bytes(path, &jpeg(&picture)?, common.overwrite)?,
        false => write_picture(path, &picture, common.overwrite)?,
    }
    let json = json!({
        "scene": input.name,
        "file": path.display().to_string(),
        "width": picture.width,
        "height": picture.height,
        "view": view.pose,
        "stated": scene.first_view().is_some(),
        "milliseconds": seconds * 1000.0,
    });
    tell(common, json, || {
        Ok(format!("wrote {}: {} x {} pixels\n", path.display(), picture.width, picture.height))
    })
}

/// Draws each view from the ranges of the file that it needs, with at most `splats` Gaussians.
fn run_within(args: &Render, splats: u64, common: &Common) -> Result<()> {
    let (name, bytes) = input(&args.file, common)?;
    let feeding = FeedOptions::default().with_sh_parts(args.part.sh_parts.unwrap_or(usize::MAX));
    let mut scene = StreamedScene::new(LexiFeed::new(&name, &feeding, &common.limits()?));
    let budget = Budget::default().with_splats(splats).with_bytes(args.budget_bytes.unwrap_or(u64::MAX));
    let fill = |scene: &mut StreamedScene, eye: &Eye| -> Result<u64> {
        let mut read = 0;
        while let Some(range) = scene.wants(eye, &budget) {
            let span = usize::try_from(range.start)?..usize::try_from(range.end)?;
            let found = bytes.get(span.clone()).or(bytes.get(span.start..)).unwrap_or_default();
            if found.is_empty() {
                let problem = FormatError::Truncated {
                    what: "the file".to_owned(),
                    expected: range.end,
                    found: bytes.len() as u64,
                };
                return Err(Error::format(&name, problem).into());
            }
            scene.feed(range.start, found)?;
            read += found.len() as u64;
        }
        scene.refresh()?;
        Ok(read)
    };
    // The first layer shows where the scene is.
    fill(&mut scene, &Eye::at([0.0; 3]))?;
    let too_small = || Error::parameter("budget", splats, "enough for a chunk; `info` lists the layers");
    let coarse = scene.model()?.ok_or_else(too_small)?;
    let cameras = super::cameras(&args.views, &Scene::from(&coarse))?;
    drop(coarse);
    let pictures = Pictures::new(args, common, &name, cameras)?;
    let mut renderer = open_renderer(args.views.device)?;
    let options = RenderOptions::default().with_background(args.views.background);
    pictures.draw(&mut renderer, &mut |renderer, camera| {
        let read = fill(&mut scene, &camera.eye())?;
        let mut words = Map::new();
        words.insert("bytes_read".to_owned(), read.into());
        words.insert("bytes_held".to_owned(), scene.source().held_bytes().into());
        let model = scene.model()?.ok_or_else(too_small)?;
        words.insert("gaussians".to_owned(), model.len().into());
        let prepared = renderer.prepare(Scene::from(&model))?;
        Ok((timed(renderer, &prepared, camera, &options)?, words))
    })
}

/// A picture, and the seconds of drawing it.
type Timed = (Image, f64);

fn timed(
    renderer: &mut Renderer,
    prepared: &Prepared<'_>,
    camera: &Camera,
    options: &RenderOptions,
) -> Result<Timed> {
    let clock = Instant::now();
    let picture = renderer.render(prepared, camera, options)?;
    Ok((picture, clock.elapsed().as_secs_f64()))
}

/// A function that draws a view. Returns the picture, and members that the report of the view has beside the usual ones.
type DrawView<'a> = dyn FnMut(&mut Renderer, &Camera) -> Result<(Timed, Map<String, Value>)> + 'a;

/// The pictures to make, whose files may be written.
struct Pictures<'a> {
    common: &'a Common,
    scene: &'a str,
    cameras: Vec<Camera>,
    folder: PathBuf,
    paths: Vec<PathBuf>,
}

impl<'a> Pictures<'a> {
    /// Refuses files that are there, before anything is prepared for drawing.
    fn new(args: &Render, common: &'a Common, scene: &'a str, cameras: Vec<Camera>) -> Result<Self> {
        let folder = args.output.clone().unwrap_or_else(|| folder_for(&args.file));
        let name = |(i, camera): (usize, &Camera)| folder.join(view_name(i, cameras.len(), &camera.name));
        let paths: Vec<PathBuf> = cameras.iter().enumerate().map(name).collect();
        for path in &paths {
            check_free(path, &[], common.overwrite)?;
        }
        Ok(Self { common, scene, cameras, folder, paths })
    }

    /// Draws all views, writes them and reports.
    fn draw(self, renderer: &mut Renderer, draw_view: &mut DrawView<'_>) -> Result<()> {
        let Self { common, scene, cameras, folder, paths } = self;
        stop::while_writing(Work::Files(paths.len()));
        make_folder(&folder)?;
        let bars = Bars::new(common.quiet);
        bars.start("drawing", "views", cameras.len() as u64);
        let mut done = Vec::new();
        let mut drawing = 0.0;
        for (camera, path) in cameras.iter().zip(&paths) {
            let ((picture, seconds), more) = draw_view(renderer, camera)?;
            drawing += seconds;
            write_picture(path, &picture, common.overwrite)?;
            bars.advance(1);
            let mut view = json!({
                "camera": camera.name,
                "file": path.display().to_string(),
                "width": picture.width,
                "height": picture.height,
                "milliseconds": seconds * 1000.0,
            });
            if let Value::Object(view) = &mut view {
                view.extend(more);
            }
            done.push(view);
        }
        bars.end();
        let (count, folder, device) = (cameras.len(), folder.display(), renderer.name());
        let each = drawing * 1000.0 / count as f64;
        tell(common, json!({ "scene": scene, "device": device, "views": done }), || {
            Ok(format!(
                "wrote {count} pictures to {folder}, each drawn in {each:.0} ms on average ({device})\n"
            ))
        })
    }
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
