//! Cameras from files and folders of each kind; with the data folder, those of a real COLMAP model.

use std::fs;
use std::path::Path;

use crate::common;
use lexisplat_render::{
    Camera, Error, RenderOptions, Scene, Split, ViewSet, read_cameras, read_colmap, read_views, render,
};

const CAMERAS_TXT: &str = "1 PINHOLE 64 48 60 60 32 24\n";
const IMAGES_TXT: &str = "1 1 0 0 0 0 0 2 1 a.png\n\n";
const TRANSFORMS: &str = r#" {"camera_angle_x": 1, "frames": [{"file_path": "./train/r_0",
    "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]}]}"#;
const CAMERAS_JSON: &str = r#" [{"img_name": "a", "width": 8, "height": 8, "fx": 8, "fy": 8,
    "position": [0, 0, 0], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}]"#;

fn read(path: &Path) -> lexisplat_render::Result<ViewSet> {
    read_views(path, &mut |_| Some((40, 30)))
}

fn put(root: &Path, file: &str, text: &str) {
    let path = root.join(file);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}

#[test]
fn sources_are_told_apart_by_content() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    assert!(matches!(read(&root.join("gone")), Err(Error::Codec(lexisplat::Error::Io { .. }))));
    let nothing = read(root).unwrap_err().to_string();
    assert!(nothing.contains("no cameras here"), "{nothing}");
    // Each of these is preferred to those before it.
    put(root, "cameras.json", CAMERAS_JSON);
    assert_eq!(read(root).unwrap().cameras[0].name, "a");
    put(root, "transforms.json", &TRANSFORMS.replace("./train/r_0", "t"));
    assert_eq!(read(root).unwrap().cameras[0].name, "t");
    put(root, "transforms_train.json", TRANSFORMS);
    put(root, "transforms_test.json", &TRANSFORMS.replace("train", "test"));
    put(root, "transforms_val.json", "damaged");
    let nerf = read(root).unwrap().cameras;
    let splits: Vec<_> = nerf.iter().map(|c| (c.name.as_str(), c.split, c.width)).collect();
    assert_eq!(splits, [("./train/r_0", Some(Split::Train), 40), ("./test/r_0", Some(Split::Test), 40)]);
    for (folder, z) in [("colmap/sparse/0", "9"), ("sparse", "8"), ("sparse/0", "7"), (".", "6")] {
        put(root, &format!("{folder}/cameras.txt"), CAMERAS_TXT);
        put(root, &format!("{folder}/images.txt"), &IMAGES_TXT.replace("0 2 1", &format!("{z} 2 1")));
        assert_eq!(read(root).unwrap().cameras[0].position[1].to_string(), format!("-{z}"));
    }
    assert_eq!(read(&root.join("sparse/images.txt")).unwrap().cameras[0].position[1].to_string(), "-8");
    // Half of a binary model does not count; a whole one is preferred.
    put(root, "images.bin", "");
    assert!(read(root).is_ok());
    put(root, "cameras.bin", "");
    let empty = read(root).unwrap_err().to_string();
    assert!(empty.contains("cameras.bin: number of cameras: the file ends here"), "{empty}");
    // Files by themselves, whatever their names.
    put(root, "any", TRANSFORMS);
    assert_eq!(read(&root.join("any")).unwrap().cameras[0].split, None);
    put(root, "any", CAMERAS_JSON);
    assert_eq!(read(&root.join("any")).unwrap().cameras[0].name, "a");
    put(root, "any", "ply");
    assert!(matches!(read(&root.join("any")), Err(Error::Codec(lexisplat::Error::Format { .. }))));
    let empty = read_colmap(root.join("colmap")).unwrap().cameras.len();
    assert_eq!(empty, 1);
}

/// Bonsai's cameras by COLMAP at the width of its photos, and those of its `cameras.json`, by name.
fn bonsai() -> Option<Vec<(Camera, Camera)>> {
    let set = read_colmap(lexisplat_testing::real_data("bonsai-sparse")?).unwrap();
    assert_eq!(set.warnings, Vec::<String>::new());
    let mut known = read_cameras(lexisplat_testing::real_data("bonsai.cameras.json")?).unwrap();
    known.sort_by(|a, b| a.name.cmp(&b.name));
    let found: Vec<Camera> = set.cameras.iter().map(|camera| camera.with_max_width(400)).collect();
    assert_eq!((found.len(), known.len()), (98, 98));
    Some(found.into_iter().zip(known).collect())
}

#[test]
fn bonsai_has_the_cameras_of_its_file() {
    let Some(pairs) = bonsai() else { return };
    let mut most = 0.0_f32;
    for (found, known) in &pairs {
        assert_eq!((&found.name, found.width, found.height), (&known.name, known.width, known.height));
        // Its trainer scaled both focal lengths by the ratio of the widths; heights are whole pixels.
        assert!((found.fx - known.fx).abs() < 1e-2, "{} {}", found.fx, known.fx);
        assert!((found.fy / known.fy - 1.0).abs() < 2e-3, "{} {}", found.fy, known.fy);
        let off = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        most = most.max(off(&found.position, &known.position));
        most = most.max(off(found.rotation.as_flattened(), known.rotation.as_flattened()));
    }
    println!("largest difference of a pose: {most:e}");
    assert!(most < 1e-4, "{most}");
}

#[test]
fn bonsai_looks_like_its_photos_through_colmaps_cameras() {
    let (Some(splats), Some(pairs)) = (common::load("bonsai-3dgs.ply"), bonsai()) else { return };
    let (mut sum, mut count) = (0.0, 0);
    for (camera, _) in pairs.iter().filter(|(_, known)| known.split == Some(Split::Test)) {
        let image = render(&Scene::from(&splats), camera, &RenderOptions::default()).unwrap();
        let Some(photo) = common::photo("bonsai-photos", &camera.name) else { return };
        sum += common::psnr(&image, &photo, true);
        count += 1;
    }
    let db = sum / f64::from(count);
    println!("bonsai-3dgs through COLMAP's cameras against {count} photos: {db:.3} dB");
    assert!((db - 26.0).abs() <= 0.2, "{db:.3} dB");
}
