//! `--limit` with every command that reads a model.

use crate::folder::{Folder, GAUSSIANS, lexisplat};

/// Exit code of a size over a limit.
const LIMIT: i32 = 6;

#[test]
fn every_command_keeps_to_the_limits_given() {
    let folder = Folder::new();
    folder.run(&["compress", "scene.ply", "--tol", "0.1", "--save-dictionary", "d.lexi", "-o", "exact.lexi"]);
    folder.run(&["compress", "scene.ply", "--guess", "--keep-all", "-o", "packed.lexi"]);
    let before = folder.names();
    let (enough, less) = (format!("gaussians={GAUSSIANS}"), format!("gaussians={}", GAUSSIANS - 1));
    let small: &[&str] = &["--orbit", "1", "--width", "16", "--device", "cpu"];
    let commands: [(&str, &[&str]); 10] = [
        ("scene.ply", &["info", "scene.ply"]),
        ("exact.lexi", &["info", "exact.lexi"]),
        ("packed.lexi", &["info", "packed.lexi"]),
        ("scene.ply", &["compress", "scene.ply", "--tol", "0.1", "-o", "out.lexi"]),
        ("scene.ply", &["compress", "scene.ply", "--preset", "small", "-o", "out.lexi"]),
        ("exact.lexi", &["decompress", "exact.lexi", "-o", "out.ply"]),
        ("packed.lexi", &["decompress", "packed.lexi", "-o", "out.ply"]),
        ("packed.lexi", &[&["render", "packed.lexi", "-o", "out"], small].concat()),
        ("exact.lexi", &[&["compare", "scene.ply", "exact.lexi"], small].concat()),
        ("packed.lexi", &[&["eval", "packed.lexi", "--original", "packed.lexi"], small].concat()),
    ];
    for (file, command) in commands {
        let over = folder.fail(&[command, &["--limit", &less]].concat(), LIMIT);
        // `compare` reads the other file first.
        let file = if command[0] == "compare" { "scene.ply" } else { file };
        let said = format!("Gaussians in {file}: {GAUSSIANS} is over the limit of {}", GAUSSIANS - 1);
        assert!(over.contains(&said) && over.contains("--limit gaussians=N"), "{command:?}: {over}");
        let over = folder.fail(&[command, &["--limit", "bytes=1kB", "--limit", &enough]].concat(), LIMIT);
        assert!(over.contains("over the limit of 1000") && over.contains(file), "{command:?}: {over}");
        // Nothing is left behind.
        assert_eq!(folder.names(), before, "{command:?}");
    }
    folder.run(&["info", "packed.lexi", "--limit", &enough, "--limit", "bytes=1MB", "--quiet"]);

    let over = folder.fail(
        &["compress", "scene.ply", "--dictionary", "d.lexi", "-o", "out.lexi", "--limit", "atoms=1"],
        LIMIT,
    );
    assert!(over.contains("dictionary of d.lexi: 90 is over the limit of 1\nhelp: "), "{over}");
    let wrong = folder.fail(&["info", "scene.ply", "--limit", "splats=5"], 2);
    assert!(wrong.contains("gaussians, atoms, nonzeros"), "{wrong}");
}

/// A pipe may never end, so the program must not read all of it before it checks the limit.
#[test]
#[cfg(unix)]
fn a_pipe_is_read_no_further_than_its_limit() {
    for command in
        [&["info", "-"][..], &["compress", "-", "-o", "x.lexi"], &["decompress", "-", "-o", "x.ply"]]
    {
        let endless = std::fs::File::open("/dev/zero").unwrap();
        let mut run = std::process::Command::new(lexisplat().get_program());
        let output = run.args(command).args(["--limit", "bytes=1MiB"]).stdin(endless).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(LIMIT), "{command:?}: {said}");
        assert!(said.contains("bytes of standard input: 1048577 is over the limit of 1048576"), "{said}");
    }
}

/// The limit on files of cameras is not one of the GPU's limits, for which the advice is to draw without a GPU.
#[test]
fn cameras_over_their_limit_are_said_without_a_word_on_gpus() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("model")).unwrap();
    for name in ["cameras.bin", "images.bin"] {
        // Without a byte on the disk.
        let file = std::fs::File::create(folder.path("model").join(name)).unwrap();
        file.set_len(lexisplat_render::MAX_COLMAP_BYTES + 1).unwrap();
    }
    let over =
        folder.fail(&["render", "scene.ply", "--cameras", "model", "-o", "out", "--device", "cpu"], LIMIT);
    assert!(over.contains("cameras.bin: bytes: ") && !over.contains("GPU"), "{over}");
}
