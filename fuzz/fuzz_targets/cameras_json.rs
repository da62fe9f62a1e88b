//! INRIA's cameras.json: refused, or cameras that can be drawn from.
#![no_main]

use lexisplat_fuzz::allocator::bounded;
use lexisplat_render::read_cameras_bytes;
use libfuzzer_sys::fuzz_target;

/// A camera takes some 100 bytes and its text as many; lists grow by doubling.
const PER_BYTE: usize = 64;
/// Bytes of an error and its text.
const BASE: usize = 64 << 10;

fuzz_target!(|data: &[u8]| {
    let read = bounded(data, PER_BYTE, BASE, || read_cameras_bytes("cameras.json", data));
    for camera in read.unwrap_or_default() {
        camera.validate().expect("cameras that were read are in range");
    }
});
