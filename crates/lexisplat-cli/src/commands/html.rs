//! `lexisplat html`.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use anyhow::Result;
use lexisplat::Error;
use lexisplat_eval::{SceneFile, format};
use lexisplat_formats::{Kind, bundle};
use lexisplat_render::{Renderer, Scene};
use lexisplat_sweep::report::jpeg;
use lexisplat_view::script;
use serde_json::json;

use super::first_view::FirstView;
use crate::args::{Common, Html};
use crate::files::{check_output, input, is_pipe, output_path, siblings, tell, write_pieces};
use crate::page::{Page, Poster};
use crate::stop::{self, Work};

/// File name of a page without a scene, and name of the scene of standard input in its page.
const VIEWER: &str = "viewer.html";
const STANDARD_INPUT_SCENE: &str = "scene.lexi";
/// Name of the archive for a folder without a name.
const BUNDLE: &str = "scene.sog";
/// Width and height of the drawn still picture, in pixels. In wider windows the space to its left and right is empty.
const POSTER_SIZE: (u32, u32) = (640, 360);
/// First bytes of a PNG, and of a JPEG.
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
    script::parse(&args.actions)?;
    stop::while_writing(if is_pipe(&output) { Work::Stream } else { Work::Files(1) });
    let files = args.files.iter().map(|path| input(path, common)).collect::<Result<Vec<_>>>()?;
    let scene = match files.first() {
        Some((name, bytes)) => {
            let options = lexisplat::ply::ReadOptions::default().with_limits(common.limits()?);
            Some(SceneFile::read_files(name, bytes, siblings(name), &options)?)
        }
        None => None,
    };
    // A page that cannot be shown is refused here, not when somebody opens it.
    for (name, bytes) in files.iter().skip(1) {
        if Kind::of(name, bytes).is_none() {
            return Err(Error::malformed(name, "the format is not known").into());
        }
    }
    let view = match &scene {
        Some(scene) if !scene.scene().is_empty() => Some(FirstView::new(&scene.scene(), &args.actions)?),
        _ => None,
    };
    let poster = poster(args, scene.as_ref().zip(view.as_ref()), common)?;
    let mut names = Vec::new();
    let mut contents: Vec<Cow<'_, [u8]>> = Vec::new();
    for (path, (name, bytes)) in args.files.iter().zip(&files) {
        let archive = bundle(name, bytes, siblings(name), &common.limits()?)?;
        names.push(scene_name(path, Path::new(name), archive.is_some()));
        contents.push(archive.map_or(Cow::Borrowed(&**bytes), Cow::Owned));
    }
    let title = match (&args.title, names.first()) {
        (Some(title), _) => title.clone(),
        (None, Some(name)) => Path::new(name).file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        (None, None) => "lexisplat".to_owned(),
    };
    let page = Page {
        title: &title,
        poster: poster.as_ref().map(|(bytes, kind)| Poster { bytes, kind }),
        words: view.as_ref().map_or(&args.actions, |view| &view.words),
        tools: args.tools,
        still: args.still,
        scenes: names.iter().map(String::as_str).zip(contents.iter().map(|bytes| &**bytes)).collect(),
    };
    let pieces = page.pieces()?;
    let bytes = write_pieces(&output, &pieces, common.overwrite)?;
    if is_pipe(&output) {
        return Ok(());
    }
    let scene_bytes: u64 = contents.iter().map(|bytes| bytes.len() as u64).sum();
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

/// Returns the name in the page, without folders, of the scene that was given as `path` and is read from `file`. An
/// archive that was made of the files of a folder has the name of the folder.
fn scene_name(path: &Path, file: &Path, is_bundled: bool) -> String {
    if is_bundled {
        let folder = file.parent().and_then(Path::file_name);
        return folder.map_or(BUNDLE.to_owned(), |folder| format!("{}.sog", folder.to_string_lossy()));
    }
    match path.file_name() {
        Some(name) if !is_pipe(path) => name.to_string_lossy().into_owned(),
        _ => STANDARD_INPUT_SCENE.to_owned(),
    }
}

/// Returns the still picture of `scene` for a page that begins with `view`, as a JPEG.
pub(super) fn still(view: &FirstView, scene: &Scene<'_>) -> Result<Vec<u8>> {
    Ok(jpeg(&view.picture(&mut Renderer::cpu(), scene, POSTER_SIZE)?)?)
}

/// Returns the bytes and the media type of the still picture.
fn poster(
    args: &Html,
    scene: Option<(&SceneFile, &FirstView)>,
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
        Some((scene, view)) if !args.no_poster => Ok(Some((still(view, &scene.scene())?, JPEG_TYPE))),
        _ => Ok(None),
    }
}
