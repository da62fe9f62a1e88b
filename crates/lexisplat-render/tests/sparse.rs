//! Drawing from codes against drawing the same scene made dense.

use crate::made;
use lexisplat::ShDegree;
use lexisplat_render::{Radiance, RenderOptions, Scene, render};

#[test]
fn codes_draw_the_bits_of_their_dense_scene() {
    for (degree, atoms, half) in [
        (0, 0, false),
        (1, 12, false),
        (2, 48, true),
        (3, 90, false),
        (3, 90, true),
        (3, 300, true),
        (4, 144, true),
    ] {
        let model = made::model(ShDegree::new(degree).unwrap(), atoms, half);
        let splats = model.clone().into_splats();
        let (sparse, dense) = (Scene::from(&model), Scene::from(&splats));
        assert_eq!((sparse.len(), sparse.degree()), (dense.len(), dense.degree()));
        for seed in 0..3 {
            let camera = made::camera(seed, 150, 110);
            let options = RenderOptions::default();
            let (a, b) =
                (render(&sparse, &camera, &options).unwrap(), render(&dense, &camera, &options).unwrap());
            assert!(a == b, "degree {degree}, {atoms} atoms, half {half}");
        }
    }
}

#[test]
fn colours_agree_gaussian_by_gaussian() {
    let model = made::model(ShDegree::THREE, 90, true);
    let splats = model.clone().into_splats();
    let (sparse, dense) = (Radiance::new(&Scene::from(&model)), Radiance::new(&Scene::from(&splats)));
    let mut random = made::Random::new(4);
    let mut differ = 0;
    for i in 0..splats.len() {
        let d = glam::Vec3::from_array(std::array::from_fn(|_| random.within(-1.0, 1.0))).normalize();
        let (a, b) = (sparse.colour(i, d.to_array()), dense.colour(i, d.to_array()));
        assert_eq!(a, b, "{i}");
        differ += usize::from(a != splats.geometry.dc[i]);
    }
    assert!(differ > 0);
}

#[test]
fn bands_above_the_degree_asked_for_are_left_out() {
    let model = made::model(ShDegree::THREE, 90, true);
    let whole = model.clone().into_splats();
    let (sparse, dense) = (Scene::from(&model), Scene::from(&whole));
    let direction = glam::Vec3::new(0.3, -0.5, 0.8).normalize().to_array();
    for degree in (0..=4).map(|d| ShDegree::new(d).unwrap()) {
        let mut cut = whole.clone();
        for (k, value) in cut.sh_rest.iter_mut().enumerate() {
            if k % 15 >= degree.rest_per_channel() {
                *value = 0.0;
            }
        }
        let cut_scene = Scene::from(&cut);
        let expected = Radiance::new(&cut_scene);
        let radiance = |scene| Radiance::new(scene).up_to(Some(degree));
        let (from_codes, from_dense) = (radiance(&sparse), radiance(&dense));
        for i in 0..whole.len() {
            let expected = expected.colour(i, direction);
            assert_eq!(from_dense.colour(i, direction), expected, "degree {degree}, Gaussian {i}");
            let found = from_codes.colour(i, direction);
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-6), "{degree}, {i}");
        }
    }
    let camera = made::camera(0, 64, 48);
    let all = RenderOptions::default();
    let none = all.with_max_degree(Some(ShDegree::ZERO));
    assert_ne!(render(&sparse, &camera, &all).unwrap(), render(&sparse, &camera, &none).unwrap());
}
