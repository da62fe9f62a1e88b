//! The front door, beside the steps below it.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use lexisplat::packed::Preset;
use lexisplat::{Silent, ply};
use lexisplat_compress::{Compression, Error, Packing, compress};
use lexisplat_render::{Camera, orbit};
use lexisplat_sample::{SampleOptions, scene};

/// INRIA's list of `cameras`.
fn cameras_json(cameras: &[Camera]) -> String {
    let of = |camera: &Camera| {
        let Camera { name, width, height, fx, fy, position, rotation, .. } = camera;
        format!(
            r#"{{"img_name": "{name}", "width": {width}, "height": {height}, "fx": {fx}, "fy": {fy},
            "position": {position:?}, "rotation": {rotation:?}}}"#
        )
    };
    format!("[{}]", cameras.iter().map(of).collect::<Vec<_>>().join(","))
}

#[test]
fn a_file_has_the_cameras_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let [scene_path, cameras_path, out] =
        ["scene.ply", "cameras.json", "scene.lexi"].map(|name| folder.path().join(name));
    let splats = scene(&SampleOptions::new(100, 0));
    ply::write(&scene_path, &splats).unwrap();
    let cameras = orbit(&splats.geometry, 6, 96, 64);
    std::fs::write(&cameras_path, cameras_json(&cameras)).unwrap();
    let made = |packing: Packing| {
        let mut file = Vec::new();
        Compression::from(packing).run(&splats, &mut file, &Silent).unwrap();
        file
    };
    let preset = || Packing::new(Preset::Small);

    let report = compress(&*scene_path).preset(Preset::Small).write(&out).unwrap();
    assert!(report.reached.unwrap().cameras);
    let beside = lexisplat_compress::read_beside(&scene_path).unwrap();
    assert_eq!(beside.0, cameras_path);
    assert!(std::fs::read(&out).unwrap() == made(preset().with_cameras(beside.1.cameras)));

    let found = compress(&*scene_path).preset(Preset::Small).no_cameras();
    assert!(found.to_bytes().unwrap().0 == made(preset()));
}

#[test]
fn files_that_cannot_be_compressed_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.lexi");
    let missing = compress(&*path).write(folder.path().join("out.lexi")).unwrap_err();
    assert!(missing.to_string().contains("scene.lexi"), "{missing}");
    compress(&scene(&SampleOptions::new(100, 0))).preset(Preset::Small).write(&path).unwrap();
    let again = compress(&*path).to_bytes().unwrap_err();
    assert!(matches!(again, Error::Format { .. }) && again.to_string().contains("already"), "{again}");
    let wrong = compress(&*path).psnr(f64::NAN).to_bytes();
    assert!(wrong.is_err());
}
