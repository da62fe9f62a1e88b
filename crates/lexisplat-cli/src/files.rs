//! Files in and out: scenes by content, `-` for pipes, outputs that are never half written.

use std::ffi::OsStr;
use std::io::{BufWriter, ErrorKind, StdoutLock, Write};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use anyhow::Result;
use lexisplat::output::{Existing, Output, OutputGroup};
use lexisplat::ply::ReadOptions;
use lexisplat::{Error, Input};
use lexisplat_eval::SceneFile;

use crate::args::Common;
use crate::exit::OutputExists;

/// What messages call it.
const STANDARD_OUTPUT: &str = "standard output";

/// Writes a line to standard error. A program whose standard error is full goes on.
pub(crate) fn note(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// Prints warnings about `name`.
pub(crate) fn warn(name: &str, warnings: &[String]) {
    for warning in warnings {
        note(&format!("warning: {name}: {warning}"));
    }
}

/// Tells the user what is odd about a scene's file.
pub(crate) fn warn_of(input: &SceneFile) {
    warn(&input.name, input.warnings());
}

/// Whether `path` means standard input or output.
pub(crate) fn is_pipe(path: &Path) -> bool {
    path.as_os_str() == OsStr::new("-")
}

/// What messages call standard input.
const STANDARD_INPUT: &str = "standard input";

/// The bytes of a file, mapped where possible, or of standard input; and what messages call it.
pub(crate) fn input(path: &Path, common: &Common) -> Result<(String, Input)> {
    let limits = common.limits()?;
    if is_pipe(path) {
        let bytes = Input::read(STANDARD_INPUT, std::io::stdin().lock(), &limits)?;
        return Ok((STANDARD_INPUT.to_owned(), bytes));
    }
    Ok((path.display().to_string(), Input::open_within(path, &limits)?))
}

/// Reads a PLY or a .lexi, whichever the bytes say it is.
pub(crate) fn load(path: &Path, common: &Common) -> Result<SceneFile> {
    let limits = common.limits()?;
    let options = ReadOptions::default().with_limits(limits);
    if is_pipe(path) {
        let bytes = Input::read(STANDARD_INPUT, std::io::stdin().lock(), &limits)?;
        return Ok(SceneFile::read_bytes(STANDARD_INPUT, &bytes, &options)?);
    }
    Ok(SceneFile::read(path, &options)?)
}

/// The output: what was asked for, or the input with another extension.
pub(crate) fn output_path(input: &Path, output: Option<&Path>, extension: &str) -> Result<PathBuf> {
    match output {
        Some(path) => Ok(path.to_owned()),
        None if is_pipe(input) => Ok(PathBuf::from("-")),
        None => Ok(input.with_extension(extension)),
    }
}

/// All outputs of the program, which a signal ends together.
pub(crate) fn outputs() -> &'static OutputGroup {
    static OUTPUTS: LazyLock<OutputGroup> = LazyLock::new(OutputGroup::default);
    &OUTPUTS
}

/// The output `path`. An existing file is replaced if `overwrite` is set, else refused.
pub(crate) fn new_output(path: &Path, overwrite: bool) -> Output<'_> {
    let existing = if overwrite { Existing::Replace } else { Existing::Refuse };
    Output::new(path, existing).within(outputs())
}

/// The file that `path` means, however it is written, whether it is there or not.
fn meant(path: &Path) -> Option<PathBuf> {
    let beside = || {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
        Some(folder.join(path.file_name()?))
    };
    path.canonicalize().ok().or_else(beside)
}

/// Refuses outputs that are in the way, or where no file can be made, before any work is done.
/// `others` are the other files of the command.
pub(crate) fn check_output(path: &Path, others: &[&Path], overwrite: bool) -> Result<()> {
    check_free(path, others, overwrite)?;
    if is_pipe(path) { Ok(()) } else { Ok(new_output(path, overwrite).check()?) }
}

/// Refuses outputs that are in the way; their folder need not be there yet.
pub(crate) fn check_free(path: &Path, others: &[&Path], overwrite: bool) -> Result<()> {
    let is_special = |found: std::fs::Metadata| !found.is_file() && !found.is_dir();
    if is_pipe(path) || path.metadata().is_ok_and(is_special) {
        return Ok(());
    }
    let this = meant(path);
    if this.is_some() && others.iter().any(|other| meant(other) == this) {
        let expected = "another file than the input and other outputs; name one with -o";
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
    Ok(std::fs::create_dir_all(path).map_err(|e| match e.kind() {
        // A file has the name: that is not for --overwrite.
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

/// Writes an output: to its file by `save`, or by `stream` to standard output. Returns what they do.
pub(crate) fn write_output<T, E: Into<anyhow::Error>>(
    output: &Path,
    overwrite: bool,
    save: impl FnOnce(Output<'_>) -> Result<T, E>,
    stream: impl FnOnce(&mut BufWriter<StdoutLock<'_>>) -> Result<T, E>,
) -> Result<T> {
    if !is_pipe(output) {
        return save(new_output(output, overwrite)).map_err(Into::into);
    }
    let mut out = BufWriter::new(std::io::stdout().lock());
    let done = stream(&mut out).map_err(|error| match error.into().downcast() {
        Ok(Error::Writer { source }) => Error::io(STANDARD_OUTPUT, source).into(),
        Ok(other) => anyhow::Error::from(other),
        Err(other) => other,
    })?;
    out.flush().map_err(|e| Error::io(STANDARD_OUTPUT, e))?;
    Ok(done)
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
        note(text()?.trim_end());
        Ok(())
    } else {
        print(&text()?)
    }
}

/// Writes text to standard output, where a closed pipe is no reason to panic.
pub(crate) fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())
        .and_then(|()| out.flush())
        .map_err(|e| Error::io(STANDARD_OUTPUT, e).into())
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
