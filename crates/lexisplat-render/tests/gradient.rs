//! The gradient of a picture's squared errors beside differences of its naive f64 twin.

use lexisplat::Splats;
use lexisplat::sh::rest_basis;
use lexisplat_render::{
    Camera, Differentiator, GaussianGradient, Image, RenderOptions, Scene, orbit, render,
};
use lexisplat_sample::{SampleOptions, scene};
use rayon::prelude::*;

use crate::naive;

/// Number of values of a Gaussian.
const VALUES: usize = 14 + 45;
/// Step of differences.
const STEP: f32 = 1.0 / 1024.0;
/// Largest error of the derivatives by one kind of value, as a share of their length.
const MOST: f64 = 0.01;

fn value(splats: &mut Splats, i: usize, k: usize) -> &mut f32 {
    let g = &mut splats.geometry;
    match k {
        0..3 => &mut g.positions[i][k],
        3..6 => &mut g.scales[i][k - 3],
        6..10 => &mut g.rotations[i][k - 6],
        10 => &mut g.opacities[i],
        11..14 => &mut g.dc[i][k - 11],
        _ => &mut splats.sh_rest[i * 45 + k - 14],
    }
}

fn derivative(splats: &Splats, row: &GaussianGradient, k: usize) -> f32 {
    match k {
        0..3 => row.position[k],
        3..6 => row.scales[k - 3],
        6..10 => row.rotation[k - 6],
        10 => row.opacity,
        11..14 => row.dc[k - 11],
        _ => row.colour[(k - 14) / 15] * rest_basis(splats.degree, row.direction)[(k - 14) % 15],
    }
}

/// A few Gaussians of several sizes, some of them across the border of pictures, and targets that are darker.
fn sample(antialiased: bool) -> (Splats, Vec<(Camera, Image)>) {
    let mut splats = scene(&SampleOptions::new(12, 3));
    splats.meta.antialiased = antialiased;
    for i in 0..splats.len() {
        let g = &mut splats.geometry;
        let k = i as f32;
        g.positions[i] = [0.5 * (1.7 * k).sin(), 0.5 * (2.9 * k).cos(), 0.4 * (0.9 * k).sin()];
        g.scales[i] = [-1.4 - 0.1 * k, -2.1 + 0.3 * k.sin(), -2.9 + 0.2 * k.cos()];
        g.opacities[i] = 1.0 + 0.6 * (1.3 * k).sin();
        g.dc[i] = g.dc[i].map(|v| 0.3 * v.tanh());
    }
    splats.sh_rest.iter_mut().for_each(|v| *v = 0.1 * v.tanh());
    let target = |camera: Camera| {
        let mut image = render(&Scene::from(&splats), &camera, &RenderOptions::default()).unwrap();
        for (k, pixel) in image.pixels.iter_mut().enumerate() {
            let (x, y) = ((k % 70) as f32 / 70.0, (k / 70) as f32 / 50.0);
            *pixel = pixel.map(|v| v * (0.1 + 0.4 * x + 0.4 * y));
        }
        (camera, image)
    };
    let mut cameras = orbit(&splats.geometry, 2, 70, 50);
    cameras[1].background = Some([0.9, 0.2, 0.6]);
    let views = cameras.into_iter().map(target).collect();
    (splats, views)
}

/// What begins to show at 1/255 has no derivative, so the twin holds what shows.
#[test]
fn the_gradient_is_the_slope_of_the_twin() {
    for antialiased in [false, true] {
        let (splats, views) = sample(antialiased);
        for (camera, target) in &views {
            let shown = naive::shown(&splats, camera);
            let found = Differentiator::default().gradient(&splats, camera, target).unwrap();
            let expected = naive::loss(&splats, camera, &shown, target);
            assert!((found.loss / expected - 1.0).abs() < 1e-4, "{} {expected}", found.loss);
            assert_eq!(found.gaussians.len(), splats.len());
            (0..VALUES).into_par_iter().for_each(|k| {
                let (mut squares, mut off) = (0.0_f64, 0.0_f64);
                for (i, row) in found.rows.iter().enumerate() {
                    let [more, less] = [STEP, -STEP].map(|step| {
                        let mut moved = splats.clone();
                        *value(&mut moved, i, k) += step;
                        naive::loss(&moved, camera, &shown, target)
                    });
                    let slope = (more - less) / f64::from(2.0 * STEP);
                    squares += slope * slope;
                    off += (slope - f64::from(derivative(&splats, row, k))).powi(2);
                }
                assert!(off.sqrt() <= MOST * squares.sqrt(), "{k}: {} of {}", off.sqrt(), squares.sqrt());
            });
        }
    }
}

#[test]
fn a_picture_like_its_target_has_no_gradient_and_sizes_must_agree() {
    let (splats, views) = sample(false);
    let (camera, _) = &views[0];
    let own = render(&Scene::from(&splats), camera, &RenderOptions::default()).unwrap();
    let mut differentiator = Differentiator::default();
    let found = differentiator.gradient(&splats, camera, &own).unwrap();
    assert_eq!((found.loss, found.gaussians.len()), (0.0, 0));
    let small = Image { width: 10, height: 10, pixels: vec![[0.0; 3]; 100] };
    assert!(differentiator.gradient(&splats, camera, &small).is_err());
    // Memory of one picture does not show in the next.
    let (camera, target) = &views[1];
    let fresh = Differentiator::default().gradient(&splats, camera, target).unwrap();
    assert_eq!(differentiator.gradient(&splats, camera, target).unwrap(), fresh);
}
