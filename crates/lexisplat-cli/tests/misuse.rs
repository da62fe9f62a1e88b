//! Commands that cannot be meant so: the message says what is wrong and what to do.

use crate::folder::{Folder, lexisplat};

/// Exit code of an argument out of range.
const RANGE: i32 = 5;
/// Exit code of a file of an unsupported kind.
const FORMAT: i32 = 4;
/// Exit code of a file that cannot be read.
const IO: i32 = 3;
/// Exit code of wrong usage.
const USAGE: i32 = 2;

#[test]
fn an_output_of_another_format_is_refused() {
    let folder = Folder::guessed();
    let before = folder.names();
    for (arguments, advice) in [
        (["compress", "scene.ply", "-o", "a.ply"], "give -o a.lexi; `lexisplat decompress` makes a PLY"),
        (["compress", "scene.ply", "-o", "a.SPZ"], "give -o a.lexi"),
        (["decompress", "scene.lexi", "-o", "a.lexi"], "give -o a.ply; `lexisplat compress` makes a .lexi"),
        (["decompress", "scene.lexi", "-o", "a.splat"], "give -o a.ply"),
    ] {
        let error = folder.fail(&arguments, RANGE);
        assert!(error.contains("the output is a .") && error.contains(advice), "{error}");
    }
    assert_eq!(folder.names(), before);
    // An extension that is no format's is the user's own.
    folder.run(&["compress", "scene.ply", "-o", "a.v2", "--guess", "-q"]);
    folder.run(&["decompress", "a.v2", "-o", "a.LEXI.PLY", "-q"]);
}

#[test]
fn a_folder_is_no_output() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("sub")).unwrap();
    for (arguments, name) in [
        (&["compress", "scene.ply", "-o", "sub"][..], "sub/scene.lexi"),
        (&["compress", "scene.ply", "-o", "missing/"], "missing/scene.lexi"),
        (&["compress", "-", "-o", "sub/"], "sub/scene.lexi"),
        (&["decompress", "x.lexi", "-o", "sub"], "sub/x.ply"),
        (&["eval", "scene.ply", "--original", "scene.ply", "--csv", "sub"], "sub/NAME"),
    ] {
        let error = folder.fail(arguments, RANGE).replace('\\', "/");
        assert!(error.contains("must be a file, not a folder"), "{error}");
        assert!(error.contains(&format!("help: name a file in it, such as {name}\n")), "{error}");
    }
}

#[test]
fn an_input_that_is_done_already_is_named() {
    let folder = Folder::guessed();
    let error = folder.fail(&["compress", "scene.lexi"], RANGE);
    assert!(error.contains("scene.lexi is already a .lexi file"), "{error}");
    assert!(error.contains("help: `lexisplat decompress scene.lexi` makes a PLY"), "{error}");
    let error = folder.fail(&["decompress", "scene.ply", "--overwrite"], RANGE);
    assert!(error.contains("scene.ply is already a PLY file"), "{error}");
    assert!(error.contains("help: `lexisplat compress scene.ply` makes a .lexi"), "{error}");
}

#[test]
fn an_input_of_the_other_kind_is_named_by_its_content() {
    let folder = Folder::guessed();
    for (arguments, kind, help) in [
        (["decompress", "scene.ply", "-o", "other.ply"], "a PLY", "`lexisplat compress` makes a .lexi"),
        (["compress", "scene.lexi", "-o", "other.lexi"], "a .lexi", "`lexisplat decompress` makes a PLY"),
    ] {
        let error = folder.fail(&arguments, FORMAT);
        assert!(error.contains(&format!("this is {kind}, not")) && error.contains(help), "{error}");
        assert!(!error.contains("limit"), "{error}");
    }
}

#[test]
fn a_folder_in_place_of_a_scene_is_called_one() {
    let folder = Folder::new();
    let model = "out/point_cloud/iteration_30000/point_cloud.ply";
    for rounds in ["7000", "30000"] {
        let iteration = folder.path(&format!("out/point_cloud/iteration_{rounds}"));
        std::fs::create_dir_all(&iteration).unwrap();
        std::fs::copy(folder.path("scene.ply"), iteration.join("point_cloud.ply")).unwrap();
    }
    std::fs::create_dir(folder.path("empty")).unwrap();
    for (arguments, example) in [
        (&["compress", "out", "-o", "x.lexi"][..], model),
        (&["info", "."], "./scene.ply"),
        (&["compare", "scene.ply", "empty"], "empty/scene.ply"),
        (&["convert", "empty/", "x.spz"], "empty/scene.ply"),
    ] {
        let error = folder.fail(arguments, IO).replace('\\', "/");
        assert!(error.contains("this is a folder, not a file"), "{error}");
        assert!(error.contains(&format!("help: name a file in it, such as {example}\n")), "{error}");
    }
}

#[test]
fn several_inputs_without_an_output_are_told_of_it() {
    let folder = Folder::new();
    std::fs::copy(folder.path("scene.ply"), folder.path("b.ply")).unwrap();
    let error = folder.fail(&["compress", "scene.ply", "b.ply"], RANGE);
    assert!(error.contains("2 inputs and no output") && error.contains("-o scene.lexi"), "{error}");
    let error = folder.fail(&["compress", "scene.ply", "out.lexi"], RANGE);
    assert!(
        error.contains("help: the output is named by -o: lexisplat compress scene.ply -o out.lexi"),
        "{error}"
    );
    let error = folder.fail(&["decompress", "a.lexi", "b.ply"], USAGE);
    assert!(error.contains("tip: if this is the output, write -o b.ply"), "{error}");
}

#[test]
fn numbers_that_are_none_are_told_the_option_and_the_form() {
    let folder = Folder::new();
    for (arguments, option, form) in [
        (&["compress", "scene.ply", "--tol", "0,1"][..], "--tol <T>", "a number such as 0.1"),
        (&["compress", "scene.ply", "--psnr", "4O"], "--psnr <DB>", "a number such as 40"),
        (&["compress", "scene.ply", "--min-psnr", "x"], "--min-psnr <DB>", "a number such as 40"),
        (&["compress", "scene.ply", "--ratio", "20x"], "--ratio <R>", "a number such as 20"),
        (&["compress", "scene.ply", "--size", "2 apples"], "--size <BYTES>", "a size such as 800kB"),
        (&["sweep", "scene.ply", "--tol", "0.1,x"], "--tol <LIST>", "a number such as 0.1"),
        (&["convert", "scene.ply", "x.spz", "--scale", "1,5"], "--scale <FACTOR>", "a number such as 0.5"),
        (&["convert", "scene.ply", "x.spz", "--translate", "1,2"], "--translate <X,Y,Z>", "3 numbers"),
        (&["render", "scene.ply", "--orbit", "many"], "--orbit <N>", "a whole number from 1 to 65535"),
    ] {
        let error = folder.fail(arguments, USAGE);
        assert!(error.contains(option) && error.contains(&format!("expected {form}")), "{error}");
    }
}

#[test]
fn info_does_not_advise_itself() {
    let folder = Folder::new();
    std::fs::write(folder.path("text"), "hello").unwrap();
    for file in ["text", "."] {
        let output = lexisplat().current_dir(folder.0.path()).args(["info", file]).output().unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success() && !error.contains("lexisplat info"), "{error}");
    }
}

#[test]
fn negative_numbers_are_out_of_range_not_unknown_options() {
    let folder = Folder::new();
    for (option, code, range) in [
        ("--tol", RANGE, "above 0"),
        ("--psnr", RANGE, "above 0"),
        ("--ratio", RANGE, "above 1"),
        ("--size", USAGE, "a size such as"),
        ("--memory", USAGE, "a size such as"),
        ("--atoms", USAGE, "a whole number, at least 0"),
        ("--max-nonzeros", USAGE, "a whole number from 0 to 255"),
        ("--threads", USAGE, "a whole number, at least 0"),
    ] {
        let error = folder.fail(&["compress", "scene.ply", option, "-5"], code);
        assert!(error.contains("-5") && error.contains(range), "{option}: {error}");
        assert!(!error.contains("-- -5") && !error.contains("unexpected"), "{option}: {error}");
    }
    let error = folder.fail(&["render", "scene.ply", "--orbit", "-5"], USAGE);
    assert!(error.contains("a whole number from 1 to 65535"), "{error}");
    assert_eq!(folder.names(), ["scene.ply"]);
}

/// The machine must bear what was asked for, so the program waits for its input while its threads are counted.
#[test]
#[cfg(target_os = "linux")]
fn more_threads_than_a_few_for_each_core_are_not_started() {
    use std::io::{BufRead, BufReader, Write};
    use std::process::{Command, Stdio};

    let folder = Folder::new();
    let mut command = Command::new(lexisplat().get_program());
    command.args(["info", "-", "--threads", "100000"]);
    command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stderr.take().unwrap()).read_line(&mut line).unwrap();
    let most = 4 * std::thread::available_parallelism().unwrap().get();
    assert!(
        line.starts_with(&format!("warning: --threads 100000: only {most} threads are started")),
        "{line}"
    );
    let mut stdin = child.stdin.take().unwrap();
    // The pipe holds less than the scene: once this is written the program reads, and has started its threads.
    stdin.write_all(&std::fs::read(folder.path("scene.ply")).unwrap()).unwrap();
    let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap();
    let threads = status.lines().find_map(|line| line.strip_prefix("Threads:")).unwrap();
    let threads: usize = threads.trim().parse().unwrap();
    // Beside the workers: the main thread, that of signals and that of progress.
    assert!((most..=most + 3).contains(&threads), "{threads} threads");
    drop(stdin);
    assert!(child.wait().unwrap().success());
}
