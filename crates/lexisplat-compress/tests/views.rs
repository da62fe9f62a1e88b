//! Where packing looks at a scene from.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use glam::{DQuat, DVec3};
use lexisplat::lexi::LexiReader;
use lexisplat::packed::Preset;
use lexisplat::{Limits, ShDegree, Silent, Splats, lexi};
use lexisplat_compress::{Compression, CompressionReport, Judge, Packing, PackingViews, Target, Viewpoints};
use lexisplat_render::{Camera, Renderer, Scene, orbit};
use lexisplat_sample::{SampleOptions, scene};

fn sample() -> Splats {
    scene(&SampleOptions::new(800, 0))
}

/// A scene of which views are looked for sooner.
fn small() -> Splats {
    scene(&SampleOptions::new(300, 0))
}

fn run(packing: Packing, splats: &Splats) -> (Vec<u8>, CompressionReport) {
    let mut file = Vec::new();
    let report = Compression::from(packing).run(splats, &mut file, &Silent).unwrap();
    (file, report)
}

#[test]
fn the_kind_of_scene_says_where_views_are() {
    let splats = small();
    let views =
        |viewpoints| PackingViews::generated(viewpoints, &mut Renderer::cpu(), &splats, &Silent).unwrap();
    let [object, room] = [Viewpoints::Object, Viewpoints::Room].map(views);
    let names = |views: &[Camera]| views.iter().map(|view| view.name.clone()).collect::<Vec<_>>();
    let from = |views: &[Camera], name: &str| names(views).iter().filter(|n| n.starts_with(name)).count();
    assert_eq!(from(object.judging(), "orbit"), object.judging().len());
    assert_eq!(from(room.judging(), "room"), room.judging().len());
    assert_eq!(2 * from(room.measuring(), "room"), room.measuring().len());
    assert_eq!(2 * from(room.measuring(), "surround"), room.measuring().len());
    let found = PackingViews::found(&mut Renderer::cpu(), &splats, &Silent).unwrap();
    assert_eq!(views(Viewpoints::Auto).judging(), found.judging());
    let (file, report) = run(Packing::new(Preset::Small).with_viewpoints(Viewpoints::Room), &splats);
    let reached = report.reached.unwrap();
    assert!(!reached.cameras && reached.judged_psnr > 30.0, "{reached:?}");
    let reader = LexiReader::open("scene.lexi", &file, &Limits::default()).unwrap();
    assert_eq!(reader.packed_head().unwrap().reached, Some(reached));
}

#[test]
fn views_from_beside_given_cameras_measure_and_do_not_judge() {
    let splats = sample();
    let cameras = orbit(&splats.geometry, 60, 96, 64);
    // Cameras on one side.
    let views = PackingViews::given(&cameras[..12]).unwrap();
    let alone = Renderer::cpu().sensitivity(&Scene::from(&splats), views.measuring(), &Silent).unwrap();
    let measured = views.sensitivity(&mut Renderer::cpu(), &splats, &Silent).unwrap();
    // Some Gaussians show more in others.
    let pairs: Vec<(f32, f32)> = measured.removal.into_iter().zip(alone.removal).collect();
    assert!(pairs.iter().all(|(all, given)| all >= given) && pairs.iter().any(|(all, given)| all > given));
    assert!(views.judging().iter().all(|judge| cameras.contains(&judge.clone().with_background(None))));
    // The fitted views are given or from all around.
    let fitted = views.fitting(&splats);
    let around = fitted.iter().filter(|camera| camera.name.starts_with("surround")).count();
    assert_eq!((fitted.len(), around), (6 + 8, 8));
    assert!(fitted.iter().all(|camera| !views.judging().contains(camera)));
    // Of many cameras more are fitted to, every third in half its size, and of large pictures some squares.
    let cameras = orbit(&splats.geometry, 70, 1200, 800);
    let fitted = PackingViews::given(&cameras).unwrap().fitting(&splats);
    let given: Vec<&Camera> = fitted.iter().filter(|camera| camera.name.starts_with("orbit")).collect();
    assert!((25..=40).contains(&given.len()), "{}", given.len());
    let sizes =
        given.iter().enumerate().all(|(k, camera)| camera.width == if k % 3 == 1 { 600 } else { 1200 });
    assert!(sizes && given.iter().all(|camera| camera.tiles.is_some()));
    let share = |camera: &&Camera| camera.drawn_pixels() as f64 / f64::from(camera.width * camera.height);
    let shares: f64 = given.iter().map(share).sum();
    assert!((0.2..0.7).contains(&(shares / given.len() as f64)), "{shares}");
}

/// A turn of 0.9 radians about an axis that is none of the world's, and a scale and a shift.
#[test]
fn a_scene_that_is_turned_scaled_and_moved_keeps_its_quality() {
    let splats = sample().with_degree_cut(ShDegree::ZERO);
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.9);
    let (scale, shift) = (3.0, DVec3::new(7.0, -20.0, 4.0));
    let moved = |p: DVec3| turn * p * scale + shift;
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
    let single = |v: f64| v as f32;
    let mut turned = splats.clone();
    for position in &mut turned.geometry.positions {
        *position = moved(DVec3::from_array(position.map(f64::from))).to_array().map(single);
    }
    for scales in &mut turned.geometry.scales {
        *scales = scales.map(|s| s + single(scale.ln()));
    }
    for rotation in &mut turned.geometry.rotations {
        let [w, x, y, z] = rotation.map(f64::from);
        let q = turn * DQuat::from_xyzw(x, y, z, w).normalize();
        *rotation = [q.w, q.x, q.y, q.z].map(single);
    }
    let cameras = orbit(&splats.geometry, 12, 192, 128);
    let moved: Vec<Camera> = cameras
        .iter()
        .map(|camera| {
            let mut camera = camera.clone();
            camera.position = moved(DVec3::from_array(camera.position.map(f64::from))).to_array().map(single);
            let columns =
                [0, 1, 2].map(|k| turn * DVec3::from_array(camera.rotation.map(|row| f64::from(row[k]))));
            camera.rotation = std::array::from_fn(|row| columns.map(|column| single(column[row])));
            camera
        })
        .collect();
    let quality = |splats: &Splats, cameras: &[Camera]| {
        let (file, _) = run(Packing::new(Target::MeanPsnr(40.0)), splats);
        let model = lexi::read_bytes("scene.lexi", &file, &Limits::default()).unwrap();
        let mut judge = Judge::new(Renderer::cpu(), splats, cameras, true, &Silent).unwrap();
        judge.score(&model, &Silent).unwrap().mean
    };
    let (here, there) = (quality(&splats, &cameras), quality(&turned, &moved));
    assert!((here - there).abs() < 0.5, "{here} and {there} dB");
}
