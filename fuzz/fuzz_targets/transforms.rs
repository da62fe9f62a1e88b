//! transforms.json of nerfstudio, Instant-NGP and NeRF: refused, or cameras that can be drawn from.
#![no_main]

use lexisplat_fuzz::allocator::bounded;
use lexisplat_render::read_transforms_bytes;
use libfuzzer_sys::fuzz_target;

/// A frame takes some 500 bytes and its text at least 60; lists grow by doubling.
const PER_BYTE: usize = 64;
/// Bytes of an error and its text.
const BASE: usize = 64 << 10;

fuzz_target!(|data: &[u8]| {
    let mut size_of = |path: &str| path.len().is_multiple_of(2).then_some((64, 48));
    let read = bounded(data, PER_BYTE, BASE, || read_transforms_bytes("transforms.json", data, &mut size_of));
    for camera in read.map(|set| set.cameras).unwrap_or_default() {
        camera.validate().expect("cameras that were read are in range");
    }
});
