//! Input and output files: scenes recognised by content, `-` for pipes, and outputs that appear whole or not at all.

use std::borrow::Cow;
use std::ffi::OsStr;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use anyhow::Result;
use lexisplat::lexi::LexiReader;
use lexisplat::output::{Existing, Output, OutputGroup};
use lexisplat::packed::RangeKind;
use lexisplat::ply::ReadOptions;
use lexisplat::{Error, Input, Sink};
use lexisplat_eval::{SceneFile, png};
use lexisplat_formats::{Siblings, scene_path};
use lexisplat_render::Image;
use serde::Serialize;

use crate::args::{Common, Part};
use crate::exit::{IsFolder, Misuse, OutputExists};
use crate::terminal::STANDARD_OUTPUT;
pub(crate) use crate::terminal::{note, print, print_json, warn};

/// Name of standard input in messages.
const STANDARD_INPUT: &str = "standard input";
/// Extensions of scene formats. An output of one format with the extension of another would mislead.
const SCENE_EXTENSIONS: [&str; 8] = ["lexi", "ply", "splat", "ksplat", "spz", "sog", "glb", "gltf"];
/// Largest number of entries of a folder that are searched for a scene to suggest.
const MOST_ENTRIES: usize = 1000;
/// Extensions of pictures, because names of cameras often end with one.
const PICTURE_EXTENSIONS: [&str; 9] = ["bmp", "exr", "heic", "jpeg", "jpg", "png", "tif", "tiff", "webp"];
/// Largest number of characters of a camera's name in the name of a picture.
const CAMERA_NAME_LENGTH: usize = 80;

/// Prints the warnings about a scene's file.
pub(crate) fn warn_of(input: &SceneFile) {
    warn(&input.name, input.warnings());
}

/// Returns whether `path` stands for standard input or output.
pub(crate) fn is_pipe(path: &Path) -> bool {
    path.as_os_str() == OsStr::new("-")
}

/// Reads a file, mapped if possible, or standard input. A folder with a `meta.json` stands for that file. Returns the
/// name in messages, and the bytes.
pub(crate) fn input(path: &Path, common: &Common) -> Result<(String, Input)> {
    let limits = common.limits()?;
    if is_pipe(path) {
        let bytes = Input::read(STANDARD_INPUT, std::io::stdin().lock(), &limits)?;
        return Ok((STANDARD_INPUT.to_owned(), bytes));
    }
    let path = &*scene_path(path);
    if path.is_dir() {
        return Err(folder_for_scene(path));
    }
    Ok((path.display().to_string(), Input::open_within(path, &limits)?))
}

/// Returns the files beside the file that [`input`] calls `name`.
pub(crate) fn siblings(name: &str) -> Siblings<'_> {
    if name == STANDARD_INPUT { Siblings::NONE } else { Siblings::of(Path::new(name)) }
}

/// Reads a scene of any format. The format is recognised by content.
pub(crate) fn load(path: &Path, common: &Common) -> Result<SceneFile> {
    let (name, bytes) = input(path, common)?;
    let options = ReadOptions::default().with_limits(common.limits()?);
    Ok(SceneFile::read_files(&name, &bytes, siblings(&name), &options)?)
}

/// Opens the .lexi file `bytes`, which messages call `name`, or the part of it that is asked for.
pub(crate) fn open_lexi<'a>(
    name: &str,
    bytes: &'a [u8],
    part: &Part,
    common: &Common,
) -> Result<LexiReader<'a>> {
    let limits = common.limits()?;
    let lexi = match part.first {
        None => LexiReader::open(name, bytes, &limits)?,
        Some(first) => LexiReader::open_first(name, first.of(bytes), &limits)?,
    };
    if lexi.is_empty() && lexi.whole_len() > 0 {
        let bases = lexi.outline().map(|outline| outline.ranges.iter());
        let bases = bases.into_iter().flatten().filter(|range| range.kind == RangeKind::Base);
        let least = bases.map(|range| range.bytes.end).min().unwrap_or(0);
        let problem = format!("{name}: no Gaussian is whole in the first part that is asked for");
        let help = format!("the first Gaussians need {least} bytes: --first {least}");
        return Err(Misuse { problem, help }.into());
    }
    match part.sh_parts {
        Some(parts) => Ok(lexi.with_sh_parts(parts)?),
        None => Ok(lexi),
    }
}

/// Reads a scene of any format, or the part of a packed file that is asked for.
pub(crate) fn load_part(path: &Path, part: &Part, common: &Common) -> Result<SceneFile> {
    if !part.is_given() {
        return load(path, common);
    }
    let (name, bytes) = input(path, common)?;
    let lexi = open_lexi(&name, &bytes, part, common)?;
    Ok(SceneFile::of_lexi(&lexi, &name, bytes.len() as u64)?)
}

/// Returns the output of a command that converts the scene `input` to a file with `extension`: `output` if it is given,
/// otherwise the input's name with that extension.
pub(crate) fn output_path(
    input: &Path,
    output: Option<&Path>,
    extension: &str,
    common: &Common,
) -> Result<PathBuf> {
    if common.json && is_pipe(output.unwrap_or(input)) {
        let expected = "a file: with --json standard output carries the report";
        return Err(Error::parameter("output", "-", expected).into());
    }
    let Some(path) = output else {
        let path = if is_pipe(input) { input.to_owned() } else { input.with_extension(extension) };
        return if path == input && !is_pipe(input) { Err(already(input, extension)) } else { Ok(path) };
    };
    if is_folder(path) {
        let name = match input.file_stem() {
            Some(stem) if !is_pipe(input) => stem.to_owned(),
            _ => "scene".into(),
        };
        let file = path.join(name).with_extension(extension);
        return Err(folder_for_file(path, &file));
    }
    match path.extension().and_then(OsStr::to_str).map(str::to_ascii_lowercase) {
        Some(other) if other != extension && SCENE_EXTENSIONS.contains(&other.as_str()) => {
            let problem =
                format!("{}: the output is a .{extension} file, not a .{other} file", path.display());
            let advice = match (extension, other.as_str()) {
                ("lexi", "ply") => "; `lexisplat decompress` makes a PLY of a .lexi",
                ("ply", "lexi") => "; `lexisplat compress` makes a .lexi of a PLY",
                _ => "; `lexisplat convert` makes the other formats",
            };
            let name = path.with_extension(extension);
            Err(Misuse { problem, help: format!("give -o {}{advice}", name.display()) }.into())
        }
        _ => Ok(path.to_owned()),
    }
}

/// Returns the error for an input that, by its extension, already has the format that the command makes.
fn already(input: &Path, extension: &str) -> anyhow::Error {
    let name = input.display();
    let (kind, made, command) =
        if extension == "ply" { ("PLY", "a .lexi", "compress") } else { (".lexi", "a PLY", "decompress") };
    Misuse {
        problem: format!("{name} is already a {kind} file, by its name"),
        help: format!("`lexisplat {command} {name}` makes {made} of it; if the name is wrong, give -o FILE"),
    }
    .into()
}

fn is_folder(path: &Path) -> bool {
    path.is_dir()
        || path.as_os_str().as_encoded_bytes().last().is_some_and(|&b| std::path::is_separator(b.into()))
}

/// Returns the error for the folder `path` where a file such as `file` is needed.
fn folder_for_file(path: &Path, file: &Path) -> anyhow::Error {
    let problem = format!("{}: the output must be a file, not a folder", path.display());
    Misuse { problem, help: format!("name a file in it, such as {}", file.display()) }.into()
}

/// Returns the error for the folder `path` where a scene is needed. The error names a scene in the folder, if there is
/// one.
fn folder_for_scene(path: &Path) -> anyhow::Error {
    let is_scene = |file: &PathBuf| {
        let end = file.extension().and_then(OsStr::to_str).map(str::to_ascii_lowercase);
        end.is_some_and(|end| SCENE_EXTENSIONS.contains(&end.as_str())) && file.is_file()
    };
    let entries = |folder: &Path| {
        let all = std::fs::read_dir(folder).into_iter().flatten().take(MOST_ENTRIES).flatten();
        all.map(|entry| entry.path())
    };
    // Trainers leave a model for each number of rounds at which they were told to save.
    let rounds = |model: &PathBuf| -> Option<u64> {
        model.parent()?.file_name()?.to_str()?.strip_prefix("iteration_")?.parse().ok()
    };
    let models = entries(&path.join("point_cloud")).map(|folder| folder.join("point_cloud.ply"));
    let trained = models.filter(|model| model.is_file()).max_by_key(rounds);
    let scene = trained.or_else(|| entries(path).filter(is_scene).min());
    let scene = scene.unwrap_or_else(|| path.join("scene.ply"));
    IsFolder { folder: path.display().to_string(), example: scene.display().to_string() }.into()
}

/// Returns the group of all outputs of the program. A signal ends them together.
pub(crate) fn outputs() -> &'static OutputGroup {
    static OUTPUTS: LazyLock<OutputGroup> = LazyLock::new(OutputGroup::default);
    &OUTPUTS
}

/// Returns the output `path`. An existing file is replaced if `overwrite` is set, otherwise refused.
pub(crate) fn new_output(path: &Path, overwrite: bool) -> Output<'_> {
    let existing = if overwrite { Existing::Replace } else { Existing::Refuse };
    Output::new(path, existing).within(outputs())
}

/// Returns the resolved path of the file that `path` leads to. The file need not exist.
pub(crate) fn resolved(path: &Path) -> Option<PathBuf> {
    let beside = || {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
        Some(folder.join(path.file_name()?))
    };
    path.canonicalize().ok().or_else(beside)
}

/// Returns an error, before any work is done, for an output that exists or cannot be made. `others` are the other files
/// of the command.
pub(crate) fn check_output(path: &Path, others: &[&Path], overwrite: bool) -> Result<()> {
    check_free(path, others, overwrite)?;
    if is_pipe(path) { Ok(()) } else { Ok(new_output(path, overwrite).check()?) }
}

/// Returns an error for an output that exists and must not be replaced. The output's folder need not exist.
pub(crate) fn check_free(path: &Path, others: &[&Path], overwrite: bool) -> Result<()> {
    let is_special = |found: std::fs::Metadata| !found.is_file() && !found.is_dir();
    if is_pipe(path) || path.metadata().is_ok_and(is_special) {
        return Ok(());
    }
    let this = resolved(path);
    if this.is_some() && others.iter().any(|other| resolved(other) == this) {
        let expected = "another file than the input and other outputs; name one with -o";
        return Err(Error::parameter("output", path.display(), expected).into());
    }
    if is_folder(path) {
        return Err(folder_for_file(path, &path.join("NAME")));
    }
    if path.exists() && !overwrite {
        return Err(OutputExists(path.display().to_string()).into());
    }
    Ok(())
}

/// Makes the folder `path` if it does not exist.
pub(crate) fn make_folder(path: &Path) -> Result<()> {
    Ok(std::fs::create_dir_all(path).map_err(|e| match e.kind() {
        // A file has this name. --overwrite would not help.
        ErrorKind::AlreadyExists => Error::io(path, ErrorKind::NotADirectory.into()),
        _ => Error::io(path, e),
    })?)
}

/// Writes `bytes` to `path`, whole or not at all.
pub(crate) fn write_bytes(path: &Path, bytes: &[u8], overwrite: bool) -> Result<()> {
    Ok(lexisplat::output::write_whole(new_output(path, overwrite), |writer| {
        writer.write_all(bytes).map_err(|e| Error::io(path, e))
    })?)
}

/// Writes `image` as a PNG file.
pub(crate) fn write_picture(path: &Path, image: &Image, overwrite: bool) -> Result<()> {
    write_bytes(path, &png(image.width, image.height, &image.to_8bit())?, overwrite)
}

/// Calls `write` with an output: a file, or standard output. Returns the result of `write`.
pub(crate) fn write_output<T, E: Into<anyhow::Error>>(
    output: &Path,
    overwrite: bool,
    write: impl FnOnce(Sink<'_>) -> Result<T, E>,
) -> Result<T> {
    if !is_pipe(output) {
        return write(new_output(output, overwrite).into()).map_err(Into::into);
    }
    let mut out = BufWriter::new(std::io::stdout().lock());
    let done = write(Sink::from(&mut out)).map_err(|error| match error.into().downcast() {
        Ok(Error::Writer { source }) => Error::io(STANDARD_OUTPUT, source).into(),
        Ok(other) => anyhow::Error::from(other),
        Err(other) => other,
    })?;
    out.flush().map_err(|e| Error::io(STANDARD_OUTPUT, e))?;
    Ok(done)
}

/// Writes `pieces` one after another to `path` or standard output. Returns the number of bytes.
pub(crate) fn write_pieces(path: &Path, pieces: &[Cow<'_, str>], overwrite: bool) -> Result<u64> {
    let bytes = pieces.iter().map(|piece| piece.len() as u64).sum();
    if is_pipe(path) {
        let mut out = BufWriter::new(std::io::stdout().lock());
        let written = pieces.iter().try_for_each(|piece| out.write_all(piece.as_bytes()));
        written.and_then(|()| out.flush()).map_err(|e| Error::io(STANDARD_OUTPUT, e))?;
        return Ok(bytes);
    }
    lexisplat::output::write_whole(new_output(path, overwrite), |writer| {
        pieces.iter().try_for_each(|piece| writer.write_all(piece.as_bytes())).map_err(|e| Error::io(path, e))
    })?;
    Ok(bytes)
}

/// Prints the result of a command, as JSON or as text on standard output, or not at all.
pub(crate) fn tell(
    common: &Common,
    json: impl Serialize,
    text: impl FnOnce() -> Result<String>,
) -> Result<()> {
    if common.json {
        print_json(&serde_json::to_value(json)?)
    } else if common.quiet {
        Ok(())
    } else {
        print(&text()?)
    }
}

/// Returns the file name of picture number `index` of `count`, seen from `camera`. The alphabetical order of the names is
/// the order of the cameras, and the numbers make the names unique.
pub(crate) fn view_name(index: usize, count: usize, camera: &str) -> String {
    let digits = count.saturating_sub(1).to_string().len().max(3);
    let name = match camera.rsplit_once('.') {
        Some((name, end)) if PICTURE_EXTENSIONS.contains(&end.to_ascii_lowercase().as_str()) => name,
        _ => camera,
    };
    let safe: String = name
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' })
        .take(CAMERA_NAME_LENGTH)
        .collect();
    format!("{index:0digits$}_{safe}.png")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_sort_as_cameras_do() {
        let names: Vec<String> = (0..1200).map(|i| view_name(i, 1200, "a/../b c")).collect();
        assert!(names.is_sorted());
        assert_eq!(names[7], "0007_a_.._b_c.png");
        assert_eq!(view_name(7, 8, "x"), "007_x.png");
    }

    #[test]
    fn names_of_photos_lose_their_extension() {
        assert_eq!(view_name(0, 8, "frame_00001.jpg"), "000_frame_00001.png");
        assert_eq!(view_name(1, 8, "frame_00001.JPEG"), "001_frame_00001.png");
        assert_eq!(view_name(2, 8, "v1.5"), "002_v1.5.png");
    }
}
