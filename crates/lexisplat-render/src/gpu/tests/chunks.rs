//! Scenes larger than a binding.

use lexisplat::ShDegree;

use super::super::constants::GROUP;
use super::super::{Gpu, GpuRenderer, GpuScene, ScenePart, ShPath};
use super::{adapter, bits, gpu, made};
use crate::cpu::RenderOptions;
use crate::error::Error;
use crate::renderer::Device;
use crate::scene::Scene;

/// Bytes of a dense row: 15 coefficients of three channels fill twelve vectors.
const ROW: u64 = 192;

/// A GPU whose kernels see only `binding` bytes at once.
fn narrow(binding: u64) -> Option<Gpu> {
    let reduced = Device::Gpu.open_gpu_with(|limits| limits.max_storage_buffer_binding_size = binding);
    adapter::opened(pollster::block_on(reduced).map(Option::unwrap))
}

#[test]
fn chunks_draw_the_same_picture() {
    let Some(wide) = gpu() else { return };
    let Some(small) = narrow(64 << 10) else { return };
    let splats = made::scene(5, 5000, ShDegree::THREE, false);
    let model = made::model_of(splats, 90, true);
    let scene = Scene::from(&model);
    let options = RenderOptions::default();
    let mut renderers = [GpuRenderer::new(&wide).unwrap(), GpuRenderer::new(&small).unwrap()];
    for path in ShPath::ALL {
        let scenes = [&wide, &small].map(|gpu| GpuScene::new(gpu, &scene, path).unwrap());
        assert!(scenes[0].chunks().count() == 1 && scenes[1].chunks().count() > 2, "{}", path.name());
        for seed in 0..2 {
            let mut camera = made::camera(seed, 60, 45);
            // From where less is in view than such a GPU has slots for.
            camera.position = camera.position.map(|v| v * 0.3);
            let [a, b] = [0, 1].map(|k| renderers[k].render(&scenes[k], &camera, &options).unwrap().0);
            assert!(bits(&a) == bits(&b), "{}, camera {seed}", path.name());
            assert!(a.pixels.iter().any(|p| p != &a.pixels[0]));
        }
    }
}

#[test]
fn chunks_are_whole_blocks_within_the_limit() {
    let block = GROUP as usize;
    let splats = made::scene(5, 5 * block + 7, ShDegree::THREE, false);
    let part = ScenePart::new(&Scene::from(&splats)).unwrap();
    let cuts = |part: &ScenePart<'_>, limit| -> Result<Vec<_>, Error> {
        Ok(part.cuts(limit)?.into_iter().map(|cut| cut.gaussians).collect())
    };
    // 16 coefficients of three channels in 32 bits fill as much.
    let row = ROW * block as u64;
    let len = splats.len();
    assert_eq!(cuts(&part, u64::MAX).unwrap(), vec![0..len]);
    assert_eq!(cuts(&part, 2 * row).unwrap(), [0..2 * block, 2 * block..4 * block, 4 * block..len]);
    assert!(matches!(cuts(&part, row - 1), Err(Error::GpuLimit { found, .. }) if found == row));
    let none = made::scene(5, 0, ShDegree::THREE, false);
    assert!(cuts(&ScenePart::new(&Scene::from(&none)).unwrap(), row).unwrap().is_empty());
}

#[test]
fn a_later_block_that_fits_nowhere_is_refused() {
    let block = GROUP as usize;
    let splats = made::scene(5, 2 * block, ShDegree::THREE, false);
    let (geometry, meta, dictionary, _, record) = made::model_of(splats, 20, true).into_parts();
    // All of the second block escapes.
    let mut escapes = lexisplat::Escapes::default();
    for i in block..2 * block {
        escapes.gaussians.push(u32::try_from(i).unwrap());
        escapes.rows.extend([0.5; 45]);
    }
    let none = (lexisplat::Indices::U8(Vec::new()), lexisplat::Values::F16(Vec::new()));
    let counts = vec![0; 2 * block];
    let codes = lexisplat::SparseCodes::new(&dictionary, counts, none.0, none.1, escapes).unwrap();
    let model = lexisplat::Model::new(geometry, meta, dictionary, codes, record).unwrap();
    let part = ScenePart::new(&Scene::from(&model)).unwrap();
    // 45 floats each.
    let escaped = block as u64 * 180;
    assert_eq!(part.cuts(escaped).unwrap().len(), 1);
    assert!(matches!(part.cuts(escaped - 1), Err(Error::GpuLimit { .. })));
}

#[test]
fn pictures_larger_than_a_binding_are_compared() {
    let Some(small) = narrow(64 << 10) else { return };
    // Two whole pieces of 4096 pixels and a short one.
    let pixels = 10_000;
    let pictures = [0.25_f32, 0.75].map(|level| {
        let picture = vec![[level, level, 2.0, 1.0]; pixels as usize];
        small.block_on(small.upload("picture", &picture)).unwrap()
    });
    let renderer = GpuRenderer::new(&small).unwrap();
    let error = renderer.squared_error(&pictures[0].raw, &pictures[1].raw, pixels).unwrap();
    assert_eq!(error, 0.5 * f64::from(pixels));
}
