//! The program's output, whatever files hold and whatever goes wrong.

use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Output, Stdio};

use crate::folder::{Folder, lexisplat, read};
use lexisplat::{CompressOptions, Silent, compress, lexi};
use serde_json::{Value, json};

/// Clears a terminal, and rings its bell.
const RUDE: &str = "\u{1b}[2J\u{7}";
/// The printed form of [`RUDE`].
const WRITTEN_OUT: &str = r"\u001b[2J\u0007";

fn run(folder: &Folder, arguments: &[&str]) -> Output {
    lexisplat().current_dir(folder.0.path()).args(arguments).output().unwrap()
}

/// Runs a command; asserts that nothing printed acts on a terminal; what is printed.
fn harmless(folder: &Folder, arguments: &[&str]) -> String {
    let output = run(folder, arguments);
    let text = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    let obeyed: Vec<char> = text.chars().filter(|c| c.is_control() && *c != '\n').collect();
    assert!(obeyed.is_empty(), "{arguments:?}: {obeyed:?} in {text}");
    text
}

/// The same; asserts that [`RUDE`] is among it.
fn printed(folder: &Folder, arguments: &[&str]) -> String {
    let text = harmless(folder, arguments);
    assert!(text.contains(WRITTEN_OUT), "{arguments:?}: {text}");
    text
}

#[test]
fn nothing_in_a_scene_acts_on_the_terminal() {
    let folder = Folder::new();
    // Nothing writes such a PLY, but anything may read one.
    let header = "ply\nformat binary_little_endian 1.0\n";
    let mut bytes = std::fs::read(folder.path("scene.ply")).unwrap();
    assert!(bytes.starts_with(header.as_bytes()));
    bytes.splice(header.len()..header.len(), format!("comment {RUDE}\n").into_bytes());
    std::fs::write(folder.path("rude.ply"), bytes).unwrap();
    printed(&folder, &["info", "rude.ply", "--all"]);
    printed(&folder, &["info", "rude.ply", "--json"]);
    for (way, file) in [("--guess", "packed.lexi"), ("--layout=f16", "exact.lexi")] {
        run(&folder, &["compress", "rude.ply", way, "-o", file, "--quiet"]);
        printed(&folder, &["info", file, "--all"]);
    }
    // A .lexi holds comments that no header of a PLY can.
    let mut splats = read(&folder.path("scene.ply"));
    splats.meta.comments.push(format!("{RUDE}\nforged"));
    let (model, _) = compress(splats, &CompressOptions::default(), &Silent).unwrap();
    lexi::write(&folder.path("rude.lexi"), &model).unwrap();
    for command in [&["info", "rude.lexi", "--all"][..], &["info", "rude.lexi", "--json"]] {
        let text = printed(&folder, command);
        assert!(!text.lines().any(|line| line.starts_with("forged")), "{text}");
    }
}

#[test]
fn nothing_in_the_name_of_a_file_or_a_camera_acts_on_the_terminal() {
    let folder = Folder::new();
    let small = ["--width", "32", "--device", "cpu"];
    let cameras = json!([{
        "id": 0, "img_name": format!("{RUDE}\nforged"), "width": 64, "height": 48, "fx": 60.0, "fy": 60.0,
        "position": [0, -0.5, -4.0], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    }]);
    std::fs::write(folder.path("cameras.json"), cameras.to_string()).unwrap();
    std::fs::create_dir(folder.path("sparse")).unwrap();
    std::fs::write(folder.path("sparse/cameras.txt"), "1 PINHOLE 64 48 60 60 32 24\n").unwrap();
    let images = format!("1 1 0 0 0 0 0.5 4 1 {RUDE}.png\n\n");
    std::fs::write(folder.path("sparse/images.txt"), images).unwrap();
    for cameras in ["cameras.json", "sparse"] {
        for command in
            [&["compare", "scene.ply", "scene.ply"][..], &["eval", "scene.ply", "--original", "scene.ply"]]
        {
            let text = printed(&folder, &[command, &["--cameras", cameras], &small].concat());
            assert!(!text.lines().any(|line| line.starts_with("forged")), "{text}");
        }
    }
    let manifest = format!(
        "[[scene]]\nname = {}\nmethod = \"3dgs\"\nmodel = \"scene.ply\"\n",
        json!(RUDE) // TOML writes strings as JSON does.
    );
    std::fs::write(folder.path("scenes.toml"), manifest).unwrap();
    let sweep = ["sweep", "--manifest", "scenes.toml", "--tol", "0.2", "--no-fps", "--orbit", "2"];
    printed(&folder, &[&sweep[..], &small].concat());
    #[cfg(unix)]
    {
        let rude = format!("{RUDE}.ply");
        std::fs::write(folder.path(&rude), "nonsense").unwrap();
        printed(&folder, &["info", &rude]);
        printed(&folder, &["info", &format!("missing {rude}")]);
        printed(&folder, &["info", &rude, "--json"]);
    }
}

#[test]
fn a_failure_under_json_is_an_object() {
    let folder = Folder::new();
    std::fs::write(folder.path("text.ply"), "hello").unwrap();
    std::fs::write(folder.path("taken.lexi"), "precious").unwrap();
    for (arguments, code, kind, help) in [
        (&["info"][..], 2, "usage", true),
        (&["compress", "scene.ply", "--pursuit", "magic"], 2, "usage", true),
        (&["info", "missing.ply"], 3, "io", false),
        (&["info", "text.ply"], 4, "format", false),
        (&["compress", "scene.ply", "--tol", "0"], 5, "parameter", false),
        (&["decompress", "scene.ply"], 5, "parameter", true),
        (&["info", "scene.ply", "--limit", "bytes=1"], 6, "limit", false),
        (&["compress", "scene.ply", "-o", "taken.lexi"], 7, "exists", true),
    ] {
        let plain = run(&folder, arguments);
        assert!(plain.stdout.is_empty(), "{arguments:?}");
        let plain = String::from_utf8(plain.stderr).unwrap();
        // Before and after the command.
        for all in [[&["--json"], arguments].concat(), [arguments, &["--json"]].concat()] {
            let output = run(&folder, &all);
            assert_eq!((output.status.code(), output.stderr.len()), (Some(code), 0), "{all:?}");
            let object: Value = serde_json::from_slice(&output.stdout).unwrap();
            assert!(object["schema_version"].as_u64().unwrap() > 0, "{object}");
            let error = &object["error"];
            assert_eq!((&error["code"], &error["kind"]), (&json!(code), &json!(kind)), "{object}");
            let message = error["message"].as_str().unwrap();
            // The same as in words, without the line breaks and columns of those.
            let words: Vec<&str> = plain.split_whitespace().collect();
            assert!(words.join(" ").contains(message) && !message.starts_with("error"), "{message}: {plain}");
            assert!(error["help"].is_string() || !help, "{object}");
        }
    }
    // Behind `--` it is the name of a file.
    let output = run(&folder, &["info", "--", "--json", "too many"]);
    assert!(output.stdout.is_empty() && !output.stderr.is_empty());
}

#[test]
fn every_object_has_a_schema_version() {
    let folder = Folder::few();
    let small = &["--orbit", "1", "--width", "32", "--device", "cpu"][..];
    let commands: [&[&str]; 9] = [
        &["compress", "scene.ply"],
        &["compress", "scene.ply", "--layout", "f16", "-o", "exact.lexi"],
        &["decompress", "scene.lexi", "-o", "back.ply"],
        &["info", "scene.lexi"],
        &["devices"],
        &[&["render", "scene.lexi"], small].concat(),
        &[&["compare", "scene.ply", "scene.lexi"], small].concat(),
        &[&["eval", "scene.lexi", "--original", "scene.ply"], small].concat(),
        &[&["bench", "scene.ply", "--cpu-repeat", "1"], small].concat(),
    ];
    for command in commands {
        assert_eq!(folder.json(command)["schema_version"], 1, "{command:?}");
    }
}

/// The first lines come after ten seconds, in which both runs wait for their input.
#[test]
fn long_work_shows_signs_of_life_unless_it_shall_be_quiet() {
    let folder = Folder::new();
    let start = |options: &[&str]| {
        let mut command = Command::new(lexisplat().get_program());
        command.current_dir(folder.0.path()).args(["info", "-"]).args(options);
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
    };
    // The quiet one starts first, so that it has waited for as long when the other prints.
    let (mut quiet, mut loud) = (start(&["--quiet"]), start(&[]));
    let mut line = String::new();
    BufReader::new(loud.stderr.take().unwrap()).read_line(&mut line).unwrap();
    assert!(line.starts_with("progress: working, ") && line.ends_with(" s since the start\n"), "{line}");
    let scene = std::fs::read(folder.path("scene.ply")).unwrap();
    for child in [&mut quiet, &mut loud] {
        child.stdin.take().unwrap().write_all(&scene).unwrap();
    }
    let quiet = quiet.wait_with_output().unwrap();
    assert!(loud.wait().unwrap().success() && quiet.status.success());
    assert_eq!(String::from_utf8(quiet.stderr).unwrap(), "");
}
