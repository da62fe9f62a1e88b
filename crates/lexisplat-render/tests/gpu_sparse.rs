//! Drawing from codes on the GPU, made up and compressed for real.

use crate::adapter::gpu;
use crate::{common, made, twins};
use lexisplat::packed::{PackOptions, Packer};
use lexisplat::pursuit::ValueType;
use lexisplat::{CompressOptions, Model, Sensitivity, ShDegree, Silent, compress};
use lexisplat_render::gpu::{Gpu, GpuRenderer, GpuScene, ShPath};
use lexisplat_render::{Camera, RenderOptions, Scene, orbit, render};
use lexisplat_sample::{SampleOptions, scene};

/// Draws `model` by every path that this GPU has and compares with the processor.
fn check(gpu: &Gpu, model: &Model, cameras: &[Camera], case: &str) {
    let mut renderer = GpuRenderer::new(gpu).unwrap();
    let dense = model.clone().into_splats();
    let options = RenderOptions::default().with_background([0.2, 0.5, 1.0]);
    for path in ShPath::ALL {
        let uploaded = match GpuScene::new(gpu, &Scene::from(model), path) {
            Ok(uploaded) => uploaded,
            Err(error) => {
                assert!(
                    path == ShPath::SparseShared && error.to_string().starts_with("dictionary"),
                    "{error}"
                );
                continue;
            }
        };
        for camera in cameras {
            let (found, _) = renderer.render(&uploaded, camera, &options).unwrap();
            let name = format!("{case}, {}, {}", path.name(), camera.name);
            if path == ShPath::SparseTable {
                let db = common::psnr(&found, &render(&Scene::from(model), camera, &options).unwrap(), true);
                assert!(db > TABLE_DB, "{name}: {db:.1} dB");
                continue;
            }
            // The codes, and the same made dense: on the processor, and on the GPU by the path before.
            twins::check(&found, &render(&Scene::from(model), camera, &options).unwrap(), &name);
            twins::check(&found, &render(&Scene::from(&dense), camera, &options).unwrap(), &name);
        }
    }
}

/// Least PSNR of pictures from tables, whose colours are approximate.
const TABLE_DB: f64 = 50.0;

#[test]
fn made_up_codes_look_the_same() {
    let Some(gpu) = gpu() else { return };
    for (degree, atoms, half) in [
        (0, 0, false),
        (1, 12, true),
        (2, 48, true),
        (3, 90, false),
        (3, 90, true),
        (3, 300, true),
        (4, 144, true),
    ] {
        let model = made::model(ShDegree::new(degree).unwrap(), atoms, half);
        let cameras = [made::camera(0, 150, 110), made::camera(1, 33, 70)];
        check(&gpu, &model, &cameras, &format!("degree {degree}, {atoms} atoms, half {half}"));
    }
}

#[test]
fn compressed_scenes_look_the_same() {
    let Some(gpu) = gpu() else { return };
    let splats = scene(&SampleOptions::new(3000, 1));
    let cameras = orbit(&splats.geometry, 2, 120, 80);
    for values in [ValueType::F16, ValueType::F32] {
        let mut options = CompressOptions::default();
        options.values = values;
        options.atoms = Some(60);
        options.sample = 3000;
        let (model, report) = compress(splats.clone(), &options, &Silent).unwrap();
        assert!(report.mean_nonzeros > 0.5, "{report:?}");
        check(&gpu, &model, &cameras, &format!("{values:?}"));
    }
}

#[test]
fn packed_scenes_look_the_same() {
    let Some(gpu) = gpu() else { return };
    let splats = scene(&SampleOptions::new(3000, 2));
    let cameras = orbit(&splats.geometry, 2, 120, 80);
    let sensitivity = Sensitivity::guess(&splats.geometry);
    let packer = Packer::new(&splats, &sensitivity, &PackOptions::default()).unwrap();
    let (packed, _) = packer.pack(1e-5, &Silent).unwrap();
    let model = packed.unpack().unwrap();
    assert!(model.codes().counts().iter().any(|&count| count > 0));
    check(&gpu, &model, &cameras, "packed");
}

#[test]
fn codes_take_as_many_bytes_as_stated() {
    let Some(gpu) = gpu() else { return };
    let model = made::model(ShDegree::THREE, 90, true);
    let codes = model.codes();
    // For every 16 Gaussians 20 bytes, then atom numbers and values, each filled up to words.
    let words: u64 = codes
        .counts()
        .chunks(16)
        .map(|group| group.iter().map(|&c| u64::from(c)).sum::<u64>())
        .map(|n| n.div_ceil(4) + n.div_ceil(2))
        .sum();
    let escapes = codes.escapes().gaussians.len() as u64;
    let n = model.geometry().positions.len() as u64;
    let columns = 20 * n.div_ceil(16) + 4 * escapes;
    // 15 coefficients of three channels are 45 floats, and fill twelve vectors of four.
    let (exact, atoms) = (4 * 45 * escapes, 12 * 16 * 90);
    let scene = GpuScene::new(&gpu, &Scene::from(&model), ShPath::Sparse).unwrap();
    assert_eq!(scene.bytes().sh, 12 * n + columns + 4 * words + exact + atoms);
    // Position and size; shape, opacity and rotation.
    assert_eq!(scene.bytes().geometry, (16 + 32) * n);
    let dense = |path| GpuScene::new(&gpu, &Scene::from(&model), path).unwrap().bytes().sh;
    assert_eq!((dense(ShPath::DenseF32), dense(ShPath::DenseF16)), (48 * 4 * n, 48 * 2 * n));
    // A table stands for the atoms.
    assert_eq!(dense(ShPath::SparseTable) + atoms - scene.bytes().sh, 6 * 32 * 32 * 8 * 90);
}
