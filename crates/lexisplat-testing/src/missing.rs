//! What a machine may lack, and how a test says so.

use std::io::Write;
use std::path::{Path, PathBuf};

/// The environment variable that names what must not be missing: names of [`Need`] with commas between them.
pub const REQUIRE: &str = "LEXISPLAT_REQUIRE";
/// The environment variable with the file to which [`missing`] adds a line for each skipped test.
pub const SKIPPED: &str = "LEXISPLAT_SKIPPED";
/// The environment variable with the folder of real models.
const DATA: &str = "LEXISPLAT_DATA";

/// Something that a test needs and a machine may lack.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// A GPU, if only in software.
    Gpu,
    /// GPU drivers that an environment variable hides from a process.
    Drivers,
    /// A display for windows, or Xvfb to make one.
    Display,
    /// LaTeX with `booktabs`.
    Latex,
    /// OpenGL, if only in software.
    OpenGl,
    /// The real models (see [`real_data_folder`]).
    Models,
    /// The right to mount a file system in a namespace of one's own (Linux's `unshare -rm`).
    Mounts,
    /// The repository around the crate. A crate that was downloaded alone lacks it.
    Repository,
}

impl Need {
    /// What [`REQUIRE`] calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Gpu => "gpu",
            Self::Drivers => "drivers",
            Self::Display => "display",
            Self::Latex => "latex",
            Self::OpenGl => "opengl",
            Self::Models => "models",
            Self::Mounts => "mounts",
            Self::Repository => "repository",
        }
    }

    /// Whether a list of names with commas between them has this one.
    fn is_in(self, list: &str) -> bool {
        list.split(',').any(|name| name.trim() == self.name())
    }
}

/// Says that the running test is skipped because `need` is missing. The test should return after this call.
///
/// # Panics
/// If [`REQUIRE`] names `need`, or the file that [`SKIPPED`] names cannot be written.
pub fn missing(need: Need, why: &str) {
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("a test");
    let line = format!("skipped: {test} ({}): {}\n", need.name(), why.lines().next().unwrap_or_default());
    let required = std::env::var(REQUIRE).unwrap_or_default();
    assert!(!need.is_in(&required), "{REQUIRE} = {required}, but {line}");
    // Unlike `eprintln!`, this is shown for tests that pass too.
    let _ = std::io::stderr().write_all(line.as_bytes());
    if let Some(list) = std::env::var_os(SKIPPED) {
        let file = std::fs::File::options().create(true).append(true).open(&list);
        let written = file.and_then(|mut file| file.write_all(line.as_bytes()));
        assert!(written.is_ok(), "{SKIPPED} = {}: {written:?}", list.display());
    }
}

/// The folder of real models: `LEXISPLAT_DATA`, or `../shared/data` beside the repository. `None`, and the running
/// test is skipped, if it is not there.
///
/// # Panics
/// As [`missing`].
#[must_use]
pub fn real_data_folder() -> Option<PathBuf> {
    let folder = std::env::var_os(DATA).map_or_else(|| root().join("../shared/data"), PathBuf::from);
    there(folder, Need::Models)
}

/// `name` in the folder of real models. `None`, and the running test is skipped, if it is not there.
///
/// # Panics
/// As [`missing`].
#[must_use]
pub fn real_data(name: &str) -> Option<PathBuf> {
    there(real_data_folder()?.join(name), Need::Models)
}

/// A file of the repository, by its path from the root. `None`, and the running test is skipped, if it is not there.
///
/// # Panics
/// As [`missing`].
#[must_use]
pub fn repository_file(path: &str) -> Option<PathBuf> {
    there(root().join(path), Need::Repository)
}

fn there(path: PathBuf, need: Need) -> Option<PathBuf> {
    if path.exists() {
        return Some(path);
    }
    missing(need, &format!("{} is not there", path.display()));
    None
}

/// The root of the repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_in_lists() {
        assert!(Need::Gpu.is_in("gpu") && Need::Gpu.is_in("models, gpu"));
        assert!(!Need::Gpu.is_in("") && !Need::Gpu.is_in("models,gpus"));
    }

    #[test]
    fn the_repository_is_there() {
        assert!(root().join("Cargo.toml").is_file());
    }
}
