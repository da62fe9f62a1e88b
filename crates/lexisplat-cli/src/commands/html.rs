//! `lexisplat html`.

use std::path::{Path, PathBuf};

use anyhow::Result;
use lexisplat::Error;
use lexisplat_eval::{ORBIT_SIZE, SceneFile, format};
use lexisplat_formats::Kind;
use lexisplat_render::{Camera, RenderOptions, Scene, orbit, render};
use lexisplat_sweep::report::jpeg;
use serde_json::json;

use crate::args::{Common, Html};
use crate::files::{check_output, input, is_pipe, output_path, siblings, tell, write_pieces};
use crate::page::{Page, Poster};
use crate::stop::{self, Work};

/// Name of a page without a scene, and of the scene of standard input in its page.
const VIEWER: &str = "viewer.html";
const STANDARD_INPUT_SCENE: &str = "scene.lexi";
/// Views of the orbit whose first one is the still picture, as the viewer begins.
const ORBIT: usize = 24;
/// Largest width of the still picture that is drawn, in pixels.
const POSTER_WIDTH: u32 = 640;
/// The first bytes of a PNG and of a JPEG.
const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";
const JPEG: &[u8] = &[0xff, 0xd8, 0xff];
/// Media type of a JPEG.
pub(super) const JPEG_TYPE: &str = "image/jpeg";

pub(crate) fn run(args: &Html, common: &Common) -> Result<()> {
    let output = match args.files.first() {
        Some(first) => output_path(first, args.output.as_deref(), "html", common)?,
        None => args.output.clone().unwrap_or_else(|| PathBuf::from(VIEWER)),
    };
    let inputs: Vec<&Path> = args.files.iter().chain(&args.poster).map(PathBuf::as_path).collect();
    check_output(&output, &inputs, common.overwrite)?;
    check_words(&args.actions)?;
    stop::while_writing(if is_pipe(&output) { Work::Stream } else { Work::Files(1) });
    let files = args.files.iter().map(|path| input(path, common)).collect::<Result<Vec<_>>>()?;
    let scene = match files.first() {
        Some((name, bytes)) => {
            let options = lexisplat::ply::ReadOptions::default().with_limits(common.limits()?);
            Some(SceneFile::read_files(name, bytes, siblings(name), &options)?)
        }
        None => None,
    };
    // A page that cannot be shown is noticed here, not by who opens it.
    for (name, bytes) in files.iter().skip(1) {
        if Kind::of(name, bytes).is_none() {
            return Err(Error::malformed(name, "the format is not known").into());
        }
    }
    let poster = poster(args, scene.as_ref(), common)?;
    let names: Vec<String> = args.files.iter().map(|path| scene_name(path)).collect();
    let title = match (&args.title, names.first()) {
        (Some(title), _) => title.clone(),
        (None, Some(name)) => Path::new(name).file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        (None, None) => "lexisplat".to_owned(),
    };
    let page = Page {
        title: &title,
        poster: poster.as_ref().map(|(bytes, kind)| Poster { bytes, kind }),
        words: &args.actions,
        scenes: names.iter().map(String::as_str).zip(files.iter().map(|(_, bytes)| &**bytes)).collect(),
    };
    let pieces = page.pieces()?;
    let bytes = write_pieces(&output, &pieces, common.overwrite)?;
    if is_pipe(&output) {
        return Ok(());
    }
    let scene_bytes: u64 = files.iter().map(|(_, bytes)| bytes.len() as u64).sum();
    let name = output.display();
    let json = json!({
        "output": name.to_string(),
        "bytes": bytes,
        "scene_bytes": scene_bytes,
        "poster_bytes": poster.as_ref().map(|(bytes, _)| bytes.len()),
    });
    tell(common, json, || {
        Ok(format!(
            "wrote {name}: {}, of it scenes of {}\n",
            format::bytes(bytes),
            format::bytes(scene_bytes)
        ))
    })
}

/// Refuses words that the viewer would.
#[cfg(feature = "view")]
fn check_words(words: &str) -> Result<()> {
    lexisplat_view::script::parse(words)?;
    Ok(())
}

#[cfg(not(feature = "view"))]
fn check_words(_words: &str) -> Result<()> {
    Ok(())
}

/// The name of a scene in the page, without folders.
fn scene_name(path: &Path) -> String {
    match path.file_name() {
        Some(name) if !is_pipe(path) => name.to_string_lossy().into_owned(),
        _ => STANDARD_INPUT_SCENE.to_owned(),
    }
}

/// The bytes and the media type of the still picture.
fn poster(
    args: &Html,
    scene: Option<&SceneFile>,
    common: &Common,
) -> Result<Option<(Vec<u8>, &'static str)>> {
    if let Some(path) = &args.poster {
        let (name, bytes) = input(path, common)?;
        let kind = match &*bytes {
            bytes if bytes.starts_with(PNG) => "image/png",
            bytes if bytes.starts_with(JPEG) => JPEG_TYPE,
            _ => return Err(Error::malformed(&name, "a poster is a PNG or a JPEG").into()),
        };
        return Ok(Some((bytes.to_vec(), kind)));
    }
    match scene {
        Some(scene) if !args.no_poster && !scene.scene().is_empty() => {
            Ok(Some((still(&scene.scene())?, JPEG_TYPE)))
        }
        _ => Ok(None),
    }
}

/// A picture of `scene` as the viewer shows it first, as a JPEG.
pub(super) fn still(scene: &Scene<'_>) -> Result<Vec<u8>> {
    let cameras = orbit(scene.geometry(), ORBIT, ORBIT_SIZE.0, ORBIT_SIZE.1);
    let camera = cameras.first().map(|camera: &Camera| camera.with_max_width(POSTER_WIDTH));
    let camera = camera.ok_or_else(|| anyhow::anyhow!("there is no view of the scene"))?;
    Ok(jpeg(&render(scene, &camera, &RenderOptions::default())?)?)
}
