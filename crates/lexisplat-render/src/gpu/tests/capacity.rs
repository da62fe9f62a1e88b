//! Views that are fuller than the buffers.

use lexisplat::ShDegree;

use super::super::renderer::CapacityLimits;
use super::super::{FrameStats, Gpu, GpuRenderer, GpuScene, ShPath};
use super::{adapter, bits, gpu, made};
use crate::camera::Camera;
use crate::cpu::RenderOptions;
use crate::error::Error;
use crate::image::Image;
use crate::scene::Scene;

/// More than any of these views needs.
const PLENTY: CapacityLimits = CapacityLimits { slots: 1 << 24, entries: 1 << 24, pixels: 1 << 30 };

fn draw(gpu: &Gpu, limits: CapacityLimits, camera: &Camera) -> Result<(Image, FrameStats), Error> {
    let splats = made::scene(8, 1500, ShDegree::ONE, false);
    let scene = GpuScene::new(gpu, &Scene::from(&splats), ShPath::DenseF32).unwrap();
    GpuRenderer::new(gpu).unwrap().with_limits(limits).render(&scene, camera, &RenderOptions::default())
}

#[test]
fn bands_look_for_their_own_gaussians_where_all_are_too_many() {
    let Some(gpu) = gpu() else { return };
    let camera = made::camera(1, 100, 120);
    let (whole, stats) = draw(&gpu, PLENTY, &camera).unwrap();
    let all = u64::from(stats.visible);
    let exact = CapacityLimits { slots: all, ..PLENTY };
    assert_eq!(draw(&gpu, exact, &camera).unwrap().1.bands, 1);
    let (cut, cut_stats) = draw(&gpu, CapacityLimits { slots: all - 1, ..PLENTY }, &camera).unwrap();
    assert!(cut_stats.bands > 1 && cut_stats.retries > 0, "{cut_stats:?}");
    assert!(u64::from(cut_stats.visible) < all);
    assert_eq!(cut_stats.entries, stats.entries);
    assert!(bits(&cut) == bits(&whole));
    // With lists cut as well.
    let both = CapacityLimits { slots: all - 1, entries: u64::from(stats.entries) / 3, ..PLENTY };
    assert!(bits(&draw(&gpu, both, &camera).unwrap().0) == bits(&whole));
    let Err(Error::GpuLimit { what, found, limit }) =
        draw(&gpu, CapacityLimits { slots: 10, ..PLENTY }, &camera)
    else {
        panic!("drew more Gaussians than there is room for")
    };
    assert_eq!((what.as_str(), limit), ("Gaussians in one row of tiles", 10));
    assert!(found > 10 && found < all);
}

#[test]
fn bands_draw_the_same_picture() {
    let Some(gpu) = gpu() else { return };
    let camera = made::camera(1, 100, 120);
    let (whole, stats) = draw(&gpu, PLENTY, &camera).unwrap();
    assert_eq!((stats.bands, stats.retries), (1, 0));
    let all = u64::from(stats.entries);
    let (cut, cut_stats) = draw(&gpu, CapacityLimits { entries: all / 3, ..PLENTY }, &camera).unwrap();
    assert!(cut_stats.bands > 2 && cut_stats.retries > 0, "{cut_stats:?}");
    assert_eq!(cut_stats.entries, stats.entries);
    assert!(bits(&cut) == bits(&whole));
    // Eight rows of tiles cannot be cut finer.
    let refused = draw(&gpu, CapacityLimits { entries: all / 20, ..PLENTY }, &camera);
    assert!(
        matches!(refused, Err(Error::GpuLimit { limit, found, .. }) if limit == all / 20 && found > limit)
    );
}

#[test]
fn pictures_larger_than_a_binding_are_cut() {
    let Some(gpu) = gpu() else { return };
    let camera = made::camera(1, 100, 120);
    let (whole, _) = draw(&gpu, PLENTY, &camera).unwrap();
    let row = 100 * 16 * 16;
    let (cut, stats) = draw(&gpu, CapacityLimits { pixels: 3 * row, ..PLENTY }, &camera).unwrap();
    assert_eq!((stats.bands, stats.retries), (3, 0));
    assert!(bits(&cut) == bits(&whole));
    let refused = draw(&gpu, CapacityLimits { pixels: row - 1, ..PLENTY }, &camera);
    assert!(matches!(refused, Err(Error::GpuLimit { found, limit, .. }) if (found, limit) == (row, row - 1)));
}

#[test]
fn a_fuller_view_is_tried_again_once() {
    let Some(gpu) = gpu() else { return };
    // 1500 Gaussians that cover 40 x 30 tiles: far more than the first room.
    let mut splats = made::scene(8, 1500, ShDegree::ZERO, false);
    splats.geometry.scales.fill([0.5; 3]);
    splats.geometry.opacities.fill(0.0);
    let scene = GpuScene::new(&gpu, &Scene::from(&splats), ShPath::DenseF32).unwrap();
    let mut renderer = GpuRenderer::new(&gpu).unwrap();
    let camera = Camera { fx: 600.0, fy: 600.0, ..made::camera(1, 640, 480) };
    let options = RenderOptions::default();
    let (first, stats) = renderer.render(&scene, &camera, &options).unwrap();
    assert_eq!((stats.retries, stats.bands), (1, 1), "{stats:?}");
    let (second, again) = renderer.render(&scene, &camera, &options).unwrap();
    assert_eq!((again.retries, again.entries), (0, stats.entries));
    assert!(bits(&first) == bits(&second));
}

#[test]
fn bytes_are_counted_and_given_back() {
    let Some(gpu) = adapter::opened(adapter::best()) else { return };
    assert_eq!((gpu.bytes(), gpu.most_bytes()), (0, 0));
    let model = made::model(ShDegree::THREE, 90, true);
    for path in ShPath::ALL {
        let scene = GpuScene::new(&gpu, &Scene::from(&model), path).unwrap();
        let own = scene.bytes().geometry + scene.bytes().sh;
        // Besides, two small buffers.
        assert!((own..own + 1024).contains(&gpu.bytes()), "{}: {} of {own}", path.name(), gpu.bytes());
        let most = gpu.most_bytes();
        let mut renderer = GpuRenderer::new(&gpu).unwrap();
        renderer.render(&scene, &made::camera(1, 64, 48), &RenderOptions::default()).unwrap();
        assert!(gpu.most_bytes() > most.max(gpu.bytes()) || path != ShPath::ALL[0], "{}", path.name());
        drop(scene);
        drop(renderer);
        assert_eq!(gpu.bytes(), 0, "{}", path.name());
    }
    assert!(gpu.most_bytes() > 0);
}

#[test]
fn scenes_in_turn_are_drawn_without_trying_again() {
    let Some(gpu) = gpu() else { return };
    let camera = made::camera(1, 100, 120);
    let options = RenderOptions::default();
    let (_, stats) = draw(&gpu, PLENTY, &camera).unwrap();
    let limits = CapacityLimits { entries: u64::from(stats.entries) / 3, ..PLENTY };
    let mut renderer = GpuRenderer::new(&gpu).unwrap().with_limits(limits);
    let scenes = [8, 9].map(|seed| {
        let splats = made::scene(seed, 1500, ShDegree::ONE, false);
        GpuScene::new(&gpu, &Scene::from(&splats), ShPath::DenseF32).unwrap()
    });
    let first = scenes.each_ref().map(|scene| renderer.render(scene, &camera, &options).unwrap());
    assert!(first.iter().all(|(_, stats)| stats.retries > 0 && stats.bands > 1));
    for (scene, (picture, _)) in scenes.iter().zip(&first) {
        let (again, stats) = renderer.render(scene, &camera, &options).unwrap();
        assert_eq!(stats.retries, 0);
        assert!(bits(&again) == bits(picture));
    }
    // The buffers kept for a scene go with it.
    let [one, other] = scenes;
    assert!(renderer.plans.iter().any(|plan| plan.scene == one.id));
    let gone = one.id;
    drop(one);
    renderer.render(&other, &camera, &options).unwrap();
    assert!(renderer.plans.iter().all(|plan| plan.scene != gone));
}
