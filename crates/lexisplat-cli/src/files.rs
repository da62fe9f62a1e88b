//! Files in and out: scenes by content, `-` for pipes, outputs that are never half written.

use std::ffi::OsStr;
use std::io::{BufWriter, Read, StdoutLock, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use image::ImageEncoder;
use lexisplat::lexi::{self, Contents};
use lexisplat::packed::Packed;
use lexisplat::ply::{self, PlyRead, ReadOptions};
use lexisplat::{Error, Limits, Model};
use lexisplat_render::Scene;

use crate::args::Common;
use crate::exit::OutputExists;

/// Bytes that tell a PLY from a .lexi.
const PEEK: usize = 16;

/// A scene of either kind.
pub(crate) enum Loaded {
    Ply(Box<PlyRead>),
    /// A .lexi, and before it was decoded if it is a packed one.
    Lexi(Box<Model>, Option<Box<Packed>>),
}

impl Loaded {
    fn lexi(contents: Contents, name: &str) -> Result<Self> {
        Ok(match contents {
            Contents::Packed(packed) => {
                Self::Lexi(Box::new(lexi::unpack(name, &packed)?), Some(Box::new(packed)))
            }
            contents => Self::Lexi(Box::new(contents.into_model(name)?), None),
        })
    }
}

/// A scene, its name and its size.
pub(crate) struct Input {
    pub(crate) loaded: Loaded,
    pub(crate) name: String,
    pub(crate) bytes: u64,
}

impl Input {
    pub(crate) fn scene(&self) -> Scene<'_> {
        match &self.loaded {
            Loaded::Ply(read) => Scene::from(&read.splats),
            Loaded::Lexi(model, _) => Scene::from(&**model),
        }
    }

    /// Tells the user what is odd about the file.
    pub(crate) fn warn(&self) {
        if let Loaded::Ply(read) = &self.loaded {
            warn(&self.name, &read.warnings);
        }
    }
}

/// Prints warnings about `name`.
pub(crate) fn warn(name: &str, warnings: &[String]) {
    for warning in warnings {
        eprintln!("warning: {name}: {warning}");
    }
}

/// Whether `path` means standard input or output.
pub(crate) fn is_pipe(path: &Path) -> bool {
    path.as_os_str() == OsStr::new("-")
}

/// All of standard input.
pub(crate) fn standard_input() -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    std::io::stdin().lock().read_to_end(&mut bytes).context("standard input")?;
    Ok(bytes)
}

/// Reads a PLY or a .lexi, whichever the bytes say it is.
pub(crate) fn load(path: &Path, drop_invalid: bool) -> Result<Input> {
    let options = ReadOptions { drop_invalid, ..ReadOptions::default() };
    let limits = Limits::default();
    if is_pipe(path) {
        let bytes = standard_input()?;
        let name = "standard input".to_owned();
        let loaded = if lexi::is_lexi(&bytes) {
            Loaded::lexi(lexi::open_bytes(&name, &bytes, &limits)?, &name)?
        } else {
            Loaded::Ply(Box::new(ply::read_bytes(&name, &bytes, &options)?))
        };
        return Ok(Input { loaded, name, bytes: bytes.len() as u64 });
    }
    let name = path.display().to_string();
    let io = |e| Error::io(path, e);
    let mut start = Vec::with_capacity(PEEK);
    let file = std::fs::File::open(path).map_err(io)?;
    let bytes = file.metadata().map_err(io)?.len();
    file.take(PEEK as u64).read_to_end(&mut start).map_err(io)?;
    let loaded = if lexi::is_lexi(&start) {
        Loaded::lexi(lexi::open(path, &limits)?, &name)?
    } else {
        Loaded::Ply(Box::new(ply::read(path, &options)?))
    };
    Ok(Input { loaded, name, bytes })
}

/// The output: what was asked for, or the input with another extension.
pub(crate) fn output_path(input: &Path, output: Option<&Path>, extension: &str) -> Result<PathBuf> {
    match output {
        Some(path) => Ok(path.to_owned()),
        None if is_pipe(input) => Ok(PathBuf::from("-")),
        None => Ok(input.with_extension(extension)),
    }
}

/// Refuses outputs that are in the way, before any work is done.
pub(crate) fn check_output(path: &Path, inputs: &[&Path], overwrite: bool) -> Result<()> {
    if is_pipe(path) {
        return Ok(());
    }
    let same = |input: &Path| match (path.canonicalize(), input.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    };
    if inputs.iter().any(|input| same(input)) {
        let expected = "another file than the input; name one with -o";
        return Err(Error::parameter("output", path.display(), expected).into());
    }
    if path.is_dir() {
        return Err(Error::parameter("output", path.display(), "a file, not a folder").into());
    }
    if path.exists() && !overwrite {
        return Err(OutputExists(path.display().to_string()).into());
    }
    Ok(())
}

/// Makes the folder `path` if need be.
pub(crate) fn make_folder(path: &Path) -> Result<()> {
    Ok(std::fs::create_dir_all(path).map_err(|e| Error::io(path, e))?)
}

/// An 8-bit RGB picture as PNG bytes.
pub(crate) fn png(width: u32, height: u32, pixels: &[[u8; 3]]) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    encoder.write_image(pixels.as_flattened(), width, height, image::ExtendedColorType::Rgb8)?;
    Ok(bytes)
}

/// Writes `bytes` to `path`, whole or not at all.
pub(crate) fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    Ok(lexisplat::output::write_whole(path, |writer| {
        writer.write_all(bytes).map_err(|e| Error::io(path, e))
    })?)
}

/// Writes an output: to its file by `save`, or by `stream` to standard output. Returns its size in bytes.
pub(crate) fn write_output<E: Into<anyhow::Error>>(
    output: &Path,
    save: impl FnOnce(&Path) -> Result<u64, E>,
    stream: impl FnOnce(&mut BufWriter<StdoutLock<'_>>) -> Result<u64, E>,
) -> Result<u64> {
    if !is_pipe(output) {
        return save(output).map_err(Into::into);
    }
    let mut out = BufWriter::new(std::io::stdout().lock());
    let bytes = stream(&mut out).map_err(Into::into)?;
    out.flush().context("standard output")?;
    Ok(bytes)
}

/// Tells what was done: as JSON or text on standard output, as text on standard error if that carries
/// `output`, or not at all.
pub(crate) fn tell(
    common: &Common,
    output: &Path,
    json: impl FnOnce() -> Result<serde_json::Value>,
    text: impl FnOnce() -> Result<String>,
) -> Result<()> {
    if common.json {
        print_json(&json()?)
    } else if common.quiet {
        Ok(())
    } else if is_pipe(output) {
        eprint!("{}", text()?);
        Ok(())
    } else {
        print(&text()?)
    }
}

/// Writes text to standard output, where a closed pipe is no reason to panic.
pub(crate) fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).context("standard output")
}

/// Prints one JSON object.
pub(crate) fn print_json(value: &serde_json::Value) -> Result<()> {
    print(&format!("{value:#}\n"))
}

/// A file name for picture number `index` of `count`: names sort in the order of the cameras.
pub(crate) fn view_name(index: usize, count: usize, camera: &str) -> String {
    let digits = count.saturating_sub(1).to_string().len().max(3);
    let safe: String = camera
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' })
        .take(80)
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
}
