//! Finds test files that no test binary includes.

use std::path::Path;

/// Asserts that each file of the folder `tests` is a module of one of `roots`, which are the main files of the test
/// binaries. If `autotests` is off in Cargo.toml, Cargo silently ignores a file that no root names.
///
/// # Panics
/// If no root names a file, or a file cannot be read.
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
