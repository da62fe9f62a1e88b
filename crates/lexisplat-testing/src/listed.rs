//! Test files that nobody runs.

use std::path::Path;

/// Asserts that each file of the folder `tests` is a module of one of `roots`, the files of its test binaries. Where
/// `autotests` is off in Cargo.toml, Cargo would not run a file that none of them names, and not say so.
///
/// # Panics
/// If a file is in none of them, or cannot be read.
pub fn assert_every_file_is_listed(tests: &str, roots: &[&str]) {
    let tests = Path::new(tests);
    let read =
        |root: &&str| std::fs::read_to_string(tests.join(root)).unwrap_or_else(|e| panic!("{root}: {e}"));
    let listed: String = roots.iter().map(read).collect();
    for entry in std::fs::read_dir(tests).unwrap_or_else(|e| panic!("{}: {e}", tests.display())).flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let line = match name.strip_suffix(".rs") {
            _ if roots.contains(&name.as_str()) => continue,
            Some(module) => format!("mod {module};"),
            None if entry.path().join("main.rs").exists() => format!("{name}/main.rs"),
            None => continue,
        };
        assert!(listed.contains(&line), "tests/{name} is in none of {roots:?}");
    }
}
