//! Models no trainer should make: each has a defined result wherever it goes. docs/ROBUSTNESS.md is the table of
//! these tests.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use lexisplat::packed::{PackOptions, Packer};
use lexisplat::{
    CompressOptions, Error, FLAT_SCALE, FormatError, Sensitivity, Silent, Splats, compress, stats,
};
use lexisplat_render::{Camera, RenderOptions, Scene, interior_views, object, orbit, render, surround};
use support::{cameras, copies, everything, sample, through_ply};

/// A function that puts a value into one property of a Gaussian.
type Change = fn(&mut Splats, usize, f32);

/// By the name of the property in a PLY and of the array in the library.
const PROPERTIES: [(&str, &str, Change); 7] = [
    ("y", "positions", |s, i, v| s.geometry.positions[i][1] = v),
    ("nz", "normals", |s, i, v| s.geometry.normals[i][2] = v),
    ("f_dc_2", "dc", |s, i, v| s.geometry.dc[i][2] = v),
    ("opacity", "opacities", |s, i, v| s.geometry.opacities[i] = v),
    ("scale_0", "scales", |s, i, v| s.geometry.scales[i][0] = v),
    ("rot_3", "rotations", |s, i, v| s.geometry.rotations[i][3] = v),
    ("f_rest_7", "sh_rest", |s, i, v| s.sh_rest[45 * i + 7] = v),
];

/// Gaussian 7 and 20 get `value`: files are refused or lose the two, the library's functions refuse it, and a
/// scene in memory is drawn without them.
fn refused(value: f32, property: &str, array: &str, change: Change) {
    let mut good = sample(60, 3);
    good.geometry.normals = vec![[0.0, 1.0, 0.0]; 60];
    let mut bad = good.clone();
    for i in [7, 20] {
        change(&mut bad, i, value);
    }
    match through_ply(&bad, false).unwrap_err() {
        Error::Format { problem: FormatError::NotFinite { count, first, property: found }, .. } => {
            assert_eq!((count, first, found.as_str()), (2, 7, property));
        }
        other => panic!("{other}"),
    }
    let read = through_ply(&bad, true).unwrap();
    let keep: Vec<bool> = (0..60).map(|i| i != 7 && i != 20).collect();
    let mut kept = good;
    kept.retain(&keep);
    assert_eq!((read.summary.dropped, &read.splats), (2, &kept));

    let error = compress(bad.clone(), &CompressOptions::default(), &Silent).unwrap_err();
    assert!(matches!(error, Error::Parameter { .. }), "{error}");
    let sensitivity = Sensitivity::guess(&kept.geometry);
    assert_eq!(sensitivity.len(), 58);
    let packer = Packer::new(&bad, &Sensitivity::zeros(60), &PackOptions::default()).map(|_| ());
    // Normals are not packed.
    assert_eq!(packer.is_err(), array != "normals", "{packer:?}");
    for camera in cameras() {
        let options = RenderOptions::default();
        let image = render(&Scene::from(&bad), &camera, &options).unwrap();
        assert!(image.pixels.iter().flatten().all(|v| v.is_finite()));
        // Normals are not drawn, and opacities have a test of their own.
        let left_out = !["normals", "opacities"].contains(&array);
        if left_out || value.is_nan() && array == "opacities" {
            assert!(image == render(&Scene::from(&kept), &camera, &options).unwrap(), "{value} in {array}");
        }
    }
    let found = stats::lint(&bad).unwrap();
    assert_eq!(found.gaussians, 60);
}

#[test]
fn nan_is_refused_by_name_or_dropped() {
    for (property, array, change) in PROPERTIES {
        refused(f32::NAN, property, array, change);
    }
}

#[test]
fn infinity_is_refused_by_name_or_dropped() {
    for (property, array, change) in PROPERTIES.into_iter().filter(|p| p.0 != "opacity") {
        refused(f32::INFINITY, property, array, change);
        if property != "scale_0" {
            refused(f32::NEG_INFINITY, property, array, change);
        }
    }
}

/// Asserts that `finite` has the pictures of `splats`, and stays like them in every step.
fn is_drawn_like(finite: &Splats, splats: &Splats) {
    for camera in cameras() {
        let options = RenderOptions::default();
        let image = render(&Scene::from(finite), &camera, &options).unwrap();
        assert!(image == render(&Scene::from(splats), &camera, &options).unwrap());
    }
    let outcome = everything(finite);
    assert!(outcome.packed_db.unwrap() > 35.0, "{:?}", outcome.packed_db);
}

/// As 2DGS' Gaussians are: wherever they go, they look as if their thinnest axis had no size at all.
#[test]
fn sizes_of_zero_are_flat() {
    let mut splats = sample(60, 3);
    splats.geometry.scales.iter_mut().for_each(|scales| scales[2] = f32::NEG_INFINITY);
    splats.geometry.scales[3] = [f32::NEG_INFINITY; 3];
    let read = through_ply(&splats, false).unwrap();
    assert!(
        read.warnings.iter().any(|w| w.starts_with("60 Gaussians have a size of zero")),
        "{:?}",
        read.warnings
    );
    let finite = read.splats;
    assert_eq!(finite.geometry.scales[3], [FLAT_SCALE; 3]);
    is_drawn_like(&finite, &splats);
}

#[test]
fn infinite_opacities_are_opaque_or_invisible() {
    let mut splats = sample(60, 1);
    for i in 0..60 {
        if i % 3 < 2 {
            splats.geometry.opacities[i] = [f32::INFINITY, f32::NEG_INFINITY][i % 3];
        }
    }
    let read = through_ply(&splats, false).unwrap();
    assert!(read.warnings.iter().any(|w| w.starts_with("40 opacities are infinite")), "{:?}", read.warnings);
    let finite = read.splats;
    assert_eq!(finite.geometry.opacities[..2], [100.0, -100.0]);
    is_drawn_like(&finite, &splats);
    // In memory, without a PLY, they are refused like any other infinity.
    let error = compress(splats, &CompressOptions::default(), &Silent).unwrap_err();
    assert!(error.to_string().starts_with("opacities = inf"), "{error}");
}

#[test]
fn opacities_of_any_size_are_opaque_or_invisible() {
    for extreme in [20.0, 1e30, f32::MAX] {
        let mut splats = sample(60, 1);
        for (i, opacity) in splats.geometry.opacities.iter_mut().enumerate().filter(|(i, _)| i % 3 < 2) {
            *opacity = [extreme, -extreme][i % 3];
        }
        let outcome = everything(&splats);
        assert!(outcome.packed_db.unwrap() > 35.0, "{extreme}: {:?}", outcome.packed_db);
        assert!(outcome.lint.never_drawn >= 20);
    }
}

#[test]
fn numbers_below_normal_are_as_good_as_zero() {
    let tiny = 1e-41;
    let mut splats = sample(60, 3);
    for i in 0..30 {
        let g = &mut splats.geometry;
        g.positions[i] = [tiny, -tiny, g.positions[i][2]];
        g.dc[i] = [-tiny; 3];
        g.opacities[i] = tiny;
        g.rotations[i] = [1.0, tiny, -tiny, tiny];
        splats.sh_rest[45 * i..45 * (i + 1)].fill(tiny);
    }
    let outcome = everything(&splats);
    assert!(outcome.exact_db.is_none_or(|db| db > 40.0), "{:?}", outcome.exact_db);
    assert!(outcome.packed_db.unwrap() > 35.0, "{:?}", outcome.packed_db);
}

#[test]
fn zero_quaternions_are_the_identity() {
    let mut splats = sample(60, 1);
    splats.geometry.rotations.fill([0.0; 4]);
    let mut turned = splats.clone();
    turned.geometry.rotations.fill([1.0, 0.0, 0.0, 0.0]);
    for camera in cameras() {
        let options = RenderOptions::default();
        let image = render(&Scene::from(&splats), &camera, &options).unwrap();
        assert!(image == render(&Scene::from(&turned), &camera, &options).unwrap());
    }
    let outcome = everything(&splats);
    assert!(outcome.packed_db.unwrap() > 35.0, "{:?}", outcome.packed_db);
    assert_eq!(outcome.lint.zero_quaternions, 60);
    assert!(outcome.lint.warnings.iter().any(|w| w.contains("rotation of length 0")));
}

/// From where exp leaves f32 on, a Gaussian has no size and is left out of pictures; packing limits it.
#[test]
fn scales_of_any_size_are_kept_and_never_flood_a_picture_with_nan() {
    for extreme in [30.0, 45.0, 88.0, 89.0, 1e10, f32::MAX, -60.0, -104.0, -1e10, f32::MIN] {
        let mut splats = sample(60, 1);
        splats.geometry.scales[3] = [extreme; 3];
        splats.geometry.scales[4][1] = extreme;
        splats.geometry.opacities[3] = 2.0;
        let outcome = everything(&splats);
        assert_eq!(outcome.lint.huge_scales, if extreme > 10.0 { 2 } else { 0 });
        // Packing moves a Gaussian by a share of its size, and so a drawn one of e^30 before or behind others.
        if !(10.0..44.0).contains(&extreme) {
            assert!(outcome.packed_db.is_none_or(|db| db > 25.0), "{extreme}: {:?}", outcome.packed_db);
        }
        // The exact layouts keep geometry: only SH within the tolerance may differ.
        assert!(outcome.exact_db.is_none_or(|db| db > 25.0), "{extreme}: {:?}", outcome.exact_db);
    }
}

#[test]
fn sh_of_norm_a_million_are_stored_exactly() {
    let norm = 1e6 / 45.0_f32.sqrt();
    let mut one = sample(60, 3);
    one.sh_rest[45 * 7..45 * 8].fill(norm);
    let outcome = everything(&one);
    assert_eq!(outcome.escapes, 1);
    let error = row_error(&one, &outcome.packed.unwrap(), 7);
    assert!(error <= 65_504.0, "{error}");

    let mut all = sample(60, 3);
    for (k, value) in all.sh_rest.iter_mut().enumerate() {
        *value = if (k * 7) % 5 < 2 { norm } else { -norm };
    }
    let outcome = everything(&all);
    assert!(outcome.escapes > 0, "{}", outcome.escapes);
    assert!(outcome.lint.mean_rest_norm > 9e5);
}

fn row_error(a: &Splats, b: &Splats, i: usize) -> f64 {
    let squares = a.rest(i).iter().zip(b.rest(i)).map(|(x, y)| (f64::from(*x) - f64::from(*y)).powi(2));
    squares.sum::<f64>().sqrt()
}

#[test]
fn no_view_dependence_is_said_and_costs_no_codes() {
    let mut splats = sample(60, 3);
    splats.sh_rest.fill(0.0);
    let outcome = everything(&splats);
    assert_eq!((outcome.escapes, outcome.exact_db), (0, None));
    assert!(outcome.packed.unwrap().sh_rest.iter().all(|&v| v == 0.0));
    assert!(outcome.lint.warnings.iter().any(|w| w.contains("no view dependence")));
}

#[test]
fn one_gaussian_of_every_degree() {
    for degree in 0..=4 {
        let outcome = everything(&sample(1, degree));
        assert!(outcome.packed_db.is_none_or(|db| db > 35.0), "{degree}: {:?}", outcome.packed_db);
    }
}

#[test]
fn no_gaussians_are_background_at_every_degree() {
    for degree in 0..=4 {
        let mut splats = sample(1, degree);
        splats.retain(&[false]);
        let outcome = everything(&splats);
        assert_eq!((outcome.drawn, outcome.exact_db, outcome.packed_db), (0, None, None));
        assert_eq!(outcome.lint.warnings, ["The scene holds no Gaussians."]);
    }
}

#[test]
fn identical_gaussians_look_the_same() {
    for degree in [0, 3] {
        let splats = copies(&sample(1, degree), 300);
        let outcome = everything(&splats);
        assert!(outcome.drawn > 0);
        assert!(outcome.packed_db.is_none_or(|db| db > 30.0), "{degree}: {:?}", outcome.packed_db);
    }
}

#[test]
fn every_degree_goes_everywhere() {
    for degree in 0..=4 {
        let outcome = everything(&sample(100, degree));
        assert!(outcome.packed_db.unwrap() > 40.0, "{degree}: {:?}", outcome.packed_db);
        assert_eq!(outcome.packed.unwrap().degree.get(), degree);
    }
}

#[test]
fn stray_gaussians_move_no_others() {
    for far in [1e10, 1e30, f32::MAX] {
        let mut splats = sample(60, 1);
        splats.geometry.positions[5] = [far, -far, far];
        let outcome = everything(&splats);
        assert!(outcome.drawn > 0);
        // Sums over squares of such distances leave f32.
        assert_eq!(outcome.packed.is_some(), far < f32::MAX, "{far}");
        for camera in generated(&splats) {
            camera.validate().unwrap();
        }
    }
}

/// A scene as wide as f32 itself: views that would have to stand beyond it are refused by name, not drawn.
#[test]
fn scenes_as_wide_as_numbers_have_a_result() {
    for far in [1e18, 1e30, f32::MAX] {
        let mut splats = sample(60, 1);
        for (i, position) in splats.geometry.positions.iter_mut().enumerate() {
            *position = std::array::from_fn(|k| if (i / (k + 1)) % 2 == 0 { far } else { -far });
        }
        let outcome = everything(&splats);
        assert_eq!(outcome.packed.is_some(), far < f32::MAX, "{far}");
        for camera in generated(&splats) {
            match camera.validate() {
                Ok(()) => {
                    let image = render(&Scene::from(&splats), &camera, &RenderOptions::default()).unwrap();
                    assert!(image.pixels.iter().flatten().all(|v| v.is_finite()));
                }
                Err(error) => assert!(error.to_string().starts_with("position = "), "{error}"),
            }
        }
    }
}

/// Views of every kind that are made up for scenes without cameras.
fn generated(splats: &Splats) -> Vec<Camera> {
    let g = &splats.geometry;
    [
        orbit(g, 2, 48, 32),
        object(g, 2, 48, 32),
        interior_views(g, 2, 48, 32),
        surround(g, 2, [48, 32], [2.0, 10.0]),
    ]
    .concat()
}
