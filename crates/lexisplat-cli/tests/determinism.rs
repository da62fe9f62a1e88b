//! The same input, options and seed give the same bytes on any number of threads and with every set of vector
//! instructions that this CPU has, by everything that a user runs: exact and packed files, pictures that judge
//! quality, scenes packed part by part, decompressed scenes, drawn ones.

use std::collections::BTreeMap;

use crate::folder::{Folder, cameras, lexisplat};
use assert_cmd::Command;
use lexisplat::simd::Simd;
use lexisplat::{ShDegree, ply};
use lexisplat_sample::{SampleOptions, scene};

/// The environment variable that chooses vector instructions.
const VARIABLE: &str = "LEXISPLAT_SIMD";
/// Numbers of threads, one for each run of all commands.
const THREADS: [&str; 3] = ["1", "2", "7"];
/// Gaussians of the larger scene: three units of work, so that threads share them.
const MANY: usize = 5000;
/// Gaussians of a scene that is packed in parts: more than one bucket.
const LARGE: usize = 270_000;
/// Gaussians of the scene whose pictures are drawn again and again.
const FEW: usize = 300;

/// The commands that run, in this order, in a folder with `many.ply`, `large.ply`, `few.ply` and a few small cameras.
const COMMANDS: [&str; 13] = [
    "compress many.ply -o f16.lexi --tol 0.08 --sample 1000 --atoms 40 --save-dictionary dictionary.lexi",
    "compress many.ply -o f32.lexi --layout f32 --tol 0.1 --pursuit omp --dictionary dictionary.lexi",
    "compress many.ply -o paper.lexi --layout paper --max-nonzeros 6 --dictionary dictionary.lexi",
    "compress few.ply -o preset.lexi --preset high --keep-order",
    "compress few.ply -o aimed.lexi --psnr 30 --cameras cameras.json",
    "compress few.ply -o sized.lexi --size 9kB --keep-all --cameras cameras.json",
    "compress few.ply -o promised.lexi --layout packed --tol 0.1 --cameras cameras.json",
    "compress many.ply -o little.lexi --preset balanced --memory 1MB",
    "compress large.ply -o parts.lexi --guess",
    "decompress f16.lexi -o f16.ply",
    "decompress preset.lexi -o preset.ply",
    "render few.ply -o dense --orbit 2 --width 96 --device cpu",
    "render preset.lexi -o sparse --orbit 2 --width 96 --device cpu",
];

/// A folder with the scenes and the cameras that the commands read.
fn given() -> Folder {
    let folder = Folder(tempfile::tempdir().unwrap());
    ply::write(&folder.path("many.ply"), &scene(&SampleOptions::new(MANY, 1))).unwrap();
    let large = scene(&SampleOptions::new(LARGE, 3)).with_degree_cut(ShDegree::ONE);
    ply::write(&folder.path("large.ply"), &large).unwrap();
    let few = scene(&SampleOptions::new(FEW, 2));
    ply::write(&folder.path("few.ply"), &few).unwrap();
    std::fs::write(folder.path("cameras.json"), cameras(&few, 4)).unwrap();
    folder
}

/// Every file that the commands make of those that are given, by its name. The given ones are among them.
fn made(given: &Folder, simd: &str, threads: &str) -> BTreeMap<String, Vec<u8>> {
    let folder = Folder(tempfile::tempdir().unwrap());
    for name in given.names() {
        std::fs::copy(given.path(&name), folder.path(&name)).unwrap();
    }
    for command in COMMANDS {
        let mut run: Command = lexisplat();
        run.current_dir(folder.0.path()).env(VARIABLE, simd).args(command.split(' '));
        let output = run.args(["--threads", threads, "--quiet"]).output().unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{simd}, {threads} threads, {command}: {error}");
    }
    folder.files()
}

#[test]
fn threads_and_vector_instructions_do_not_show_in_any_file() {
    let sets: Vec<&str> = Simd::available().into_iter().map(Simd::name).collect();
    eprintln!("this CPU has: {}", sets.join(", "));
    assert_eq!(sets[0], "plain");
    #[cfg(target_arch = "x86_64")]
    for (name, has) in [
        ("avx2", std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("fma")),
        ("avx512", std::is_x86_feature_detected!("avx512f") && std::is_x86_feature_detected!("avx512vl")),
    ] {
        assert!(!has || sets.contains(&name), "this CPU has {name}, which cannot be chosen");
    }
    // Each run differs from the first in its threads, and as far as there are sets in its instructions too. So every
    // number of threads and every set is compared, without running each with each.
    let runs: Vec<(&str, &str)> =
        (0..THREADS.len()).map(|k| (sets[k.min(sets.len() - 1)], THREADS[k])).collect();
    assert!(sets.iter().all(|set| runs.iter().any(|run| run.0 == *set)), "{sets:?} are not all run");
    let given = given();
    let first = made(&given, runs[0].0, runs[0].1);
    // 9 compressed scenes, 2 decompressed, a dictionary, 3 given scenes with cameras, 4 pictures.
    assert_eq!(first.len(), 9 + 2 + 1 + 4 + 4, "{:?}", first.keys());
    for (simd, threads) in &runs[1..] {
        let again = made(&given, simd, threads);
        assert!(again.keys().eq(first.keys()), "{simd}, {threads} threads");
        for (name, bytes) in &first {
            assert!(again[name] == *bytes, "{name} is another with {simd} and {threads} threads");
        }
    }
}

/// A choice that is not kept is worse than none.
#[test]
fn the_choice_of_instructions_is_kept_or_refused() {
    let folder = Folder::new();
    for simd in Simd::available() {
        let mut run = lexisplat();
        let output = run.current_dir(folder.0.path()).env(VARIABLE, simd.name()).args(["devices", "--json"]);
        let value: serde_json::Value = serde_json::from_slice(&output.output().unwrap().stdout).unwrap();
        assert_eq!(value["processor"]["simd"], simd.name());
    }
    let mut run = lexisplat();
    let output = run.current_dir(folder.0.path()).env(VARIABLE, "mmx").args(["info", "scene.ply"]);
    let output = output.output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(5), "{said}");
    assert!(said.contains("LEXISPLAT_SIMD = mmx: plain"), "{said}");
}
