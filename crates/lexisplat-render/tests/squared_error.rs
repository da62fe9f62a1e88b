//! Comparing pictures on the GPU and on the processor.

use crate::adapter::gpu;
use crate::made;
use lexisplat_render::gpu::{Gpu, GpuRenderer, wgpu};
use lexisplat_render::{Error, Image, squared_error};
use wgpu::util::DeviceExt;

fn upload(gpu: &Gpu, image: &Image) -> wgpu::Buffer {
    let contents: Vec<u8> =
        image.pixels.iter().flat_map(|&[r, g, b]| [r, g, b, 1.0]).flat_map(f32::to_le_bytes).collect();
    let usage = wgpu::BufferUsages::STORAGE;
    let descriptor = wgpu::util::BufferInitDescriptor { label: None, contents: &contents, usage };
    gpu.device().create_buffer_init(&descriptor)
}

fn picture(seed: u64, width: u32) -> Image {
    let mut random = made::Random::new(seed);
    let pixels = (0..width).map(|_| std::array::from_fn(|_| random.within(-0.5, 1.5))).collect();
    Image { width, height: 1, pixels }
}

#[test]
fn the_processor_sums_clipped_differences() {
    let flat = |level| Image { width: 3, height: 1, pixels: vec![[level; 3]; 3] };
    assert_eq!(squared_error(&flat(0.25), &flat(0.75)).unwrap(), 9.0 * 0.25);
    assert_eq!(squared_error(&flat(-7.0), &flat(9.0)).unwrap(), 9.0);
    assert_eq!(squared_error(&flat(f32::NAN), &flat(0.5)).unwrap(), 9.0 * 0.25);
    let refused = squared_error(&flat(0.0), &picture(0, 2));
    assert!(matches!(refused, Err(Error::Parameter { name: "picture", .. })));
}

#[test]
fn the_gpu_sums_the_same() {
    let Some(gpu) = gpu() else { return };
    let renderer = GpuRenderer::new(&gpu).unwrap();
    for width in [1, 255, 4096, 4097, 100_003] {
        let mut pictures = [1, 2].map(|seed| picture(seed, width));
        pictures[0].pixels[0] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
        pictures[1].pixels[width as usize - 1] = [0.0, 1.0, 0.5];
        let [a, b] = pictures.each_ref().map(|picture| upload(&gpu, picture));
        let found = renderer.squared_error(&a, &b, width).unwrap();
        let expected = squared_error(&pictures[0], &pictures[1]).unwrap();
        assert!((found / expected - 1.0).abs() < 1e-6, "{width} pixels: {found}, expected {expected}");
        assert_eq!(renderer.squared_error(&a, &b, width).unwrap(), found);
        assert_eq!(renderer.squared_error(&a, &a, width).unwrap(), 0.0);
        // The last pixel counts, and those after the given number do not.
        let fewer = renderer.squared_error(&a, &b, width - 1).unwrap();
        assert!(width == 1 && fewer == 0.0 || fewer > 0.0 && fewer <= found);
        assert!(matches!(renderer.squared_error(&a, &b, width + 1), Err(Error::Parameter { .. })));
    }
}
