//! Things that a machine may lack, and the report of a test that lacks one.

use std::io::Write;
use std::path::{Path, PathBuf};

/// Environment variable with the names of [`Need`] that must not be missing, with commas between them.
pub const REQUIRE: &str = "LEXISPLAT_REQUIRE";
/// Environment variable with the path of the file to which [`missing`] adds a line for each skipped test.
pub const SKIPPED: &str = "LEXISPLAT_SKIPPED";
/// Environment variable with the folder of real models.
const DATA: &str = "LEXISPLAT_DATA";

/// A thing that a test needs and a machine may lack.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// A GPU; one in software counts.
    Gpu,
    /// GPU drivers that an environment variable hides from a process.
    Drivers,
    /// A display for windows, or Xvfb to make one.
    Display,
    /// LaTeX with `booktabs`.
    Latex,
    /// OpenGL; an implementation in software counts.
    OpenGl,
    /// The real models (see [`real_data_folder`]).
    Models,
    /// The right to mount a file system in a namespace of its own (Linux's `unshare -rm`).
    Mounts,
    /// The repository around the crate. A crate that was downloaded alone has no repository.
    Repository,
}

impl Need {
    /// Returns the name of the need in [`REQUIRE`].
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

    /// Returns whether `list`, names with commas between them, has this need.
    fn is_in(self, list: &str) -> bool {
        list.split(',').any(|name| name.trim() == self.name())
    }
}

/// Reports that the running test is skipped because `need` is missing. The test should return after this call.
///
/// # Panics
/// If [`REQUIRE`] names `need`, or the file named by [`SKIPPED`] cannot be written.
pub fn missing(need: Need, why: &str) {
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("a test");
    let line = format!("skipped: {test} ({}): {}\n", need.name(), why.lines().next().unwrap_or_default());
    let required = std::env::var(REQUIRE).unwrap_or_default();
    assert!(!need.is_in(&required), "{REQUIRE} = {required}, but {line}");
    // Unlike the output of `eprintln!`, this line is also shown for tests that pass.
    let _ = std::io::stderr().write_all(line.as_bytes());
    if let Some(list) = std::env::var_os(SKIPPED) {
        let file = std::fs::File::options().create(true).append(true).open(&list);
        let written = file.and_then(|mut file| file.write_all(line.as_bytes()));
        assert!(written.is_ok(), "{SKIPPED} = {}: {written:?}", list.display());
    }
}

/// Returns the folder of real models: `LEXISPLAT_DATA`, or `../shared/data` beside the repository. If it does not exist,
/// reports the running test as skipped and returns `None`.
///
/// # Panics
/// As [`missing`].
#[must_use]
pub fn real_data_folder() -> Option<PathBuf> {
    let folder = std::env::var_os(DATA).map_or_else(|| root().join("../shared/data"), PathBuf::from);
    there(folder, Need::Models)
}

/// Returns the path of `name` in the folder of real models. If it does not exist, reports the running test as skipped and
/// returns `None`.
///
/// # Panics
/// As [`missing`].
#[must_use]
pub fn real_data(name: &str) -> Option<PathBuf> {
    there(real_data_folder()?.join(name), Need::Models)
}

/// Returns the path of a file of the repository. `path` is relative to the root. If the file does not exist, reports the
/// running test as skipped and returns `None`.
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

/// Returns the root of the repository.
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
