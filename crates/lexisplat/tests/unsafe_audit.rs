//! Every file with `unsafe` in it is in the table of SECURITY.md, which says why and what tests it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use lexisplat_testing::repository_file;

/// Folders of the repository with Rust in them that is built.
const FOLDERS: [&str; 2] = ["crates", "fuzz"];
/// The marks before a block, an implementation, a function or a foreign one; `unsafe_code` is the lint.
const MARKS: [&str; 6] =
    ["unsafe {", "unsafe impl", "unsafe fn", "unsafe extern", "#[unsafe(", "unsafe_code"];

fn root() -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "..", ".."].iter().collect()
}

fn each_source(folder: &Path, see: &mut dyn FnMut(&Path)) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            // Outputs of cargo and of fuzzing are no source.
            if !path.ends_with("target") && !path.ends_with("corpus") {
                each_source(&path, see);
            }
        } else if path.extension().is_some_and(|e| e == "rs") {
            see(&path);
        }
    }
}

/// Whether a line of a source says `unsafe` for the compiler to read.
fn says_unsafe(line: &str) -> bool {
    let code = line.split("//").next().unwrap_or_default();
    MARKS.iter().any(|mark| code.contains(mark))
}

#[test]
fn only_listed_files_hold_unsafe_code() {
    let Some(security) = repository_file("SECURITY.md") else { return };
    let security = std::fs::read_to_string(security).unwrap();
    let rows = security.lines().filter(|line| line.starts_with("| `"));
    let listed: BTreeSet<String> = rows
        .filter_map(|row| Some(row.split('`').nth(1)?.to_owned()))
        .filter(|f| f.ends_with(".rs"))
        .collect();
    let this = Path::new(file!()).file_name().unwrap();
    let mut found = BTreeSet::new();
    for folder in FOLDERS {
        each_source(&root().join(folder), &mut |path| {
            let text = std::fs::read_to_string(path).unwrap();
            if path.file_name() == Some(this) || !text.lines().any(says_unsafe) {
                return;
            }
            assert!(text.contains("// SAFETY: "), "{} does not say why it is safe", path.display());
            let path = path.strip_prefix(root()).unwrap();
            found.insert(
                path.components().map(|c| c.as_os_str().to_str().unwrap()).collect::<Vec<_>>().join("/"),
            );
        });
    }
    assert!(!found.is_empty(), "the search finds nothing");
    assert_eq!(found, listed, "files with unsafe code, and those in the table of SECURITY.md");
}

/// The lint that all this stands on holds for every crate.
#[test]
fn every_crate_denies_unsafe_code() {
    let Some(fuzz) = repository_file("fuzz/Cargo.toml") else { return };
    let workspace = std::fs::read_to_string(root().join("Cargo.toml")).unwrap();
    for lint in [
        "unsafe_code = \"deny\"",
        "undocumented_unsafe_blocks = \"deny\"",
        "unsafe_op_in_unsafe_fn = \"forbid\"",
    ] {
        for text in [&workspace, &std::fs::read_to_string(&fuzz).unwrap()] {
            assert!(text.contains(lint), "{lint}");
        }
    }
    let mut crates = 0;
    for entry in std::fs::read_dir(root().join("crates")).unwrap() {
        let Ok(manifest) = std::fs::read_to_string(entry.unwrap().path().join("Cargo.toml")) else {
            continue;
        };
        assert!(manifest.contains("[lints]\nworkspace = true"), "{manifest}");
        crates += 1;
    }
    assert!(crates >= 5, "{crates} crates");
}

#[test]
fn comments_and_strings_are_no_code() {
    for line in ["    unsafe {", "unsafe impl Send for X {}", "#[expect(unsafe_code, reason = \"x\")]"] {
        assert!(says_unsafe(line), "{line}");
    }
    for line in ["// unsafe {", "//! `unsafe` is denied", "style-src 'unsafe-inline'", "an unsafe function"] {
        assert!(!says_unsafe(line), "{line}");
    }
}
