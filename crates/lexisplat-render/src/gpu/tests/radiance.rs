//! Colours, Gaussian by Gaussian, for every path.

use lexisplat::{Model, ShDegree};

use super::super::device::Gpu;
use super::super::{GpuRenderer, GpuScene, ShPath};
use super::{gpu, made};
use crate::cpu::RenderOptions;
use crate::error::Error;
use crate::radiance::Radiance;
use crate::scene::Scene;

/// Largest error of a channel for each path. Coefficients are below 1, and up to 72 of them count.
fn tolerance(path: ShPath) -> f32 {
    match path {
        // Rounding of 16-bit coefficients.
        ShPath::DenseF16 => 1e-3,
        // `gpu::table` states 0.006 for one atom; codes add up about eight times at most 0.8 of that.
        ShPath::SparseTable => 0.01,
        _ => 5e-6,
    }
}

/// Compares all colours of a view of `model`; the worst error and how many colours that were not clipped.
fn compare(gpu: &Gpu, model: &Model, path: ShPath, degree: ShDegree) -> (f32, usize) {
    let scene = Scene::from(model);
    let uploaded = GpuScene::new(gpu, &scene, path).unwrap();
    let mut renderer = GpuRenderer::new(gpu).unwrap();
    let camera = made::camera(3, 40, 30);
    let options = RenderOptions { max_degree: Some(degree), ..RenderOptions::default() };
    let (_, stats) = renderer.render(&uploaded, &camera, &options).unwrap();
    let (work, _) = renderer.inside();
    let gaussians: Vec<u32> = gpu.read_back(&work.gaussians);
    let colours: Vec<f32> = gpu.read_back(&work.colours);
    let radiance = Radiance::new(&scene).up_to(Some(degree));
    let (mut worst, mut compared) = (0.0_f32, 0);
    let mut escaped = 0;
    for (&i, found) in gaussians.iter().zip(colours.chunks_exact(3)).take(stats.visible as usize) {
        let i = i as usize;
        let offset: [f32; 3] = std::array::from_fn(|k| model.geometry().positions[i][k] - camera.position[k]);
        let length = offset.iter().map(|v| v * v).sum::<f32>().sqrt();
        let expected = radiance.colour(i, offset.map(|v| v / length));
        for (found, expected) in found.iter().zip(expected) {
            worst = worst.max((found - expected).abs());
            compared += usize::from(expected > 0.0);
        }
        escaped += usize::from(i.is_multiple_of(17));
    }
    assert!(escaped > 5 && stats.visible > 100, "{escaped} escapes of {} Gaussians", stats.visible);
    (worst, compared)
}

#[test]
fn every_path_colours_as_the_processor() {
    let Some(gpu) = gpu() else { return };
    for degree in (0..=4).map(|d| ShDegree::new(d).unwrap()) {
        let dictionaries: &[(usize, bool)] = match degree.get() {
            0 => &[(0, false)],
            1 => &[(12, false), (300, true), (300, false)],
            3 => &[(90, true), (256, true), (257, false)],
            _ => &[(20, true), (20, false)],
        };
        for &(atoms, half) in dictionaries {
            let model = made::model(degree, atoms, half);
            for path in ShPath::ALL {
                if path == ShPath::SparseShared
                    && size_of_val(model.dictionary().as_slice()) + 64
                        > gpu.limits().max_compute_workgroup_storage_size as usize
                {
                    let refused = GpuScene::new(&gpu, &Scene::from(&model), path);
                    assert!(matches!(refused, Err(Error::Parameter { name: "dictionary", .. })));
                    continue;
                }
                let (worst, compared) = compare(&gpu, &model, path, degree);
                let case = format!("{}, degree {degree}, {atoms} atoms, half {half}", path.name());
                assert!(worst <= tolerance(path), "{case}: {worst}");
                assert!(compared > 100, "{case}: {compared}");
                let rounds = matches!(path, ShPath::DenseF16 | ShPath::SparseTable);
                assert!(!rounds || degree.get() == 0 || worst > 1e-5, "{case}: suspiciously exact, {worst}");
            }
        }
    }
}

#[test]
fn bands_above_the_degree_asked_for_are_left_out() {
    let Some(gpu) = gpu() else { return };
    let model = made::model(ShDegree::new(4).unwrap(), 20, true);
    for degree in (0..4).map(|d| ShDegree::new(d).unwrap()) {
        for path in [ShPath::DenseF32, ShPath::DenseF16, ShPath::Sparse, ShPath::SparseShared] {
            let (worst, _) = compare(&gpu, &model, path, degree);
            assert!(worst <= tolerance(path), "{}, degree {degree}: {worst}", path.name());
        }
    }
    // A table holds all bands together.
    let scene = GpuScene::new(&gpu, &Scene::from(&model), ShPath::SparseTable).unwrap();
    let options = RenderOptions { max_degree: Some(ShDegree::ONE), ..RenderOptions::default() };
    let refused = GpuRenderer::new(&gpu).unwrap().render(&scene, &made::camera(3, 40, 30), &options);
    assert!(matches!(refused, Err(Error::Parameter { name: "degree", .. })));
}

#[test]
fn a_dense_scene_has_no_sparse_path() {
    let Some(gpu) = gpu() else { return };
    let splats = made::scene(1, 10, ShDegree::ONE, false);
    for path in ShPath::ALL {
        let made = GpuScene::new(&gpu, &Scene::from(&splats), path);
        match made {
            Ok(scene) => assert!(!path.is_sparse() && scene.path() == path),
            Err(error) => assert!(path.is_sparse() && matches!(error, Error::Parameter { name: "path", .. })),
        }
    }
}
