//! COLMAP models, binary and text: refused, or cameras that can be drawn from. The first byte says which kind,
//! the next two how long the file of cameras is.
#![no_main]

use lexisplat_fuzz::allocator::bounded;
use lexisplat_fuzz::made::Bytes;
use lexisplat_render::{read_colmap_binary, read_colmap_text};
use libfuzzer_sys::fuzz_target;

/// An image takes some 200 bytes as it is read and as a camera; its text at least 20.
const PER_BYTE: usize = 64;
/// A line that is kept, an error and its text.
const BASE: usize = 64 << 10;

fuzz_target!(|data: &[u8]| {
    let mut bytes = Bytes(data);
    let text = bytes.byte() % 2 == 1;
    let length = usize::from(u16::from_le_bytes([bytes.byte(), bytes.byte()]));
    let (cameras, images) = bytes.0.split_at(length.min(bytes.0.len()));
    let read = if text { read_colmap_text } else { read_colmap_binary };
    let read = bounded(data, PER_BYTE, BASE, || read("made", cameras, images));
    for camera in read.map(|set| set.cameras).unwrap_or_default() {
        camera.validate().expect("cameras that were read are in range");
    }
});
