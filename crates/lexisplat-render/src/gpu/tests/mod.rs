//! The GPU's steps against the processor's, one by one. Whole pictures are compared in `tests/gpu_*.rs`.

#![expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    reason = "tests: small numbers, and failing is their way to tell"
)]

#[path = "../../../tests/adapter/mod.rs"]
mod adapter;
mod blended;
mod capacity;
mod chunks;
mod lists;
#[path = "../../../tests/made/mod.rs"]
mod made;
mod projected;
mod radiance;
mod visible;
mod wgsl;

use super::constants::{COUNTERS, Counter, DIGIT_BITS};
use super::plan::Shape;
use super::work::Work;
use super::{Gpu, GpuRenderer, GpuScene, ShPath};
use crate::camera::Camera;
use crate::cpu::RenderOptions;
use crate::image::Image;
use crate::scene::Scene;

pub(super) use adapter::gpu;
pub(super) use made::Random;

/// A drawn view whose buffers can be looked into.
struct View {
    gpu: Gpu,
    renderer: GpuRenderer,
    image: Image,
}

impl View {
    fn new(gpu: &Gpu, scene: &Scene<'_>, camera: &Camera, options: &RenderOptions) -> Self {
        let uploaded = GpuScene::new(gpu, scene, ShPath::of(scene)).unwrap();
        let mut renderer = GpuRenderer::new(gpu).unwrap();
        let (image, _) = renderer.render(&uploaded, camera, options).unwrap();
        Self { gpu: gpu.clone(), renderer, image }
    }

    fn work(&self) -> &Work {
        self.renderer.inside().0
    }

    fn shape(&self) -> Shape {
        self.renderer.inside().1
    }

    fn counter(&self, counter: Counter) -> usize {
        let counters: Vec<u32> = self.gpu.read_back(&self.work().counters);
        assert!(counters.len() >= COUNTERS);
        counters[counter as usize] as usize
    }

    /// The Gaussian of every slot.
    fn gaussians(&self) -> Vec<u32> {
        let mut all: Vec<u32> = self.gpu.read_back(&self.work().gaussians);
        all.truncate(self.counter(Counter::Slots));
        all
    }

    /// The slots by depth.
    fn order(&self) -> Vec<u32> {
        let at = last_buffer(self.shape().depth_bits);
        let mut order: Vec<u32> = self.gpu.read_back(&self.work().slot_values[at]);
        order.truncate(self.counter(Counter::Slots));
        order
    }

    /// The sorted tiles and slots of the last band's entries.
    fn entries(&self) -> Vec<(u32, u32)> {
        let shape = self.shape();
        let tiles = shape.columns * shape.band_rows;
        let at = last_buffer(u32::BITS - tiles.leading_zeros());
        let keys: Vec<u32> = self.gpu.read_back(&self.work().entry_keys[at]);
        let values: Vec<u32> = self.gpu.read_back(&self.work().entry_values[at]);
        keys.into_iter().zip(values).take(self.counter(Counter::Entries)).collect()
    }
}

/// In which of its two buffers a sort of `bits` ends.
fn last_buffer(bits: u32) -> usize {
    (bits.div_ceil(DIGIT_BITS).max(1) % 2) as usize
}

/// The bits of a picture.
fn bits(image: &Image) -> Vec<u32> {
    image.pixels.as_flattened().iter().map(|v| v.to_bits()).collect()
}
