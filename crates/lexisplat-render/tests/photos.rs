//! Real models against the photos they were trained on, and against the twin. Skipped without the data
//! folder.

use crate::{common, naive};
use lexisplat_render::{Camera, RenderOptions, Scene, Split, read_cameras, render};

fn test_cameras(name: &str) -> Option<Vec<Camera>> {
    let cameras = read_cameras(lexisplat_testing::real_data(name)?).unwrap();
    Some(cameras.into_iter().filter(|camera| camera.split == Some(Split::Test)).collect())
}

/// Mean PSNR of `scene` over its test cameras; a wrong convention costs several dB.
fn mean_against_photos(scene: &str, cameras: &str, photos: &str) -> Option<f64> {
    let (splats, cameras) = (common::load(scene)?, test_cameras(cameras)?);
    let mut sum = 0.0;
    for camera in &cameras {
        let image = render(&Scene::from(&splats), camera, &RenderOptions::default()).unwrap();
        sum += common::psnr(&image, &common::photo(photos, &camera.name)?, true);
    }
    Some(sum / cameras.len() as f64)
}

#[test]
fn bonsai_looks_like_its_photos() {
    if let Some(db) = mean_against_photos("bonsai-3dgs.ply", "bonsai.cameras.json", "bonsai-photos") {
        println!("bonsai-3dgs against photos: {db:.3} dB");
        assert!((db - 26.0).abs() <= 0.2, "{db:.3} dB");
    }
}

#[test]
fn snowmiku_looks_like_its_photos() {
    if let Some(db) = mean_against_photos("snowmiku-mcmc.ply", "snowmiku.cameras.json", "snowmiku-photos") {
        println!("snowmiku-mcmc against photos: {db:.3} dB");
        assert!((db - 28.6).abs() <= 0.2, "{db:.3} dB");
    }
}

#[test]
fn bonsai_agrees_with_the_twin() {
    let (Some(mut splats), Some(cameras)) =
        (common::load("bonsai-3dgs.ply"), test_cameras("bonsai.cameras.json"))
    else {
        return;
    };
    for (k, camera) in cameras.iter().enumerate() {
        splats.meta.antialiased = k == 0;
        let found = render(&Scene::from(&splats), camera, &RenderOptions::default()).unwrap();
        let db = common::psnr(&found, &naive::render(&splats, camera, [0.0; 3]), false);
        println!("{}: {db:.1} dB", camera.name);
        assert!(db >= 70.0, "{}: {db:.1} dB", camera.name);
    }
}
