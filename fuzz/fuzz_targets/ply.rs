//! The PLY reader: any bytes are refused or give a scene that can be written and read again, within memory; whole
//! and a part at a time.
#![no_main]

use lexisplat::ply::{ReadOptions, read_bytes, write};
use lexisplat_fuzz::allocator::bounded;
use lexisplat_fuzz::{invariants, limits, one_thread, parts};
use libfuzzer_sys::fuzz_target;

/// A byte of an ASCII file is at most half a value; a text header names things of some 100 bytes.
const PER_BYTE: usize = 128;
/// A chunk of ASCII rows as binary ones, and what is rounded up.
const BASE: usize = 16 << 20;

fuzz_target!(init: one_thread(), |data: &[u8]| {
    let options = ReadOptions::default().with_drop_invalid(data.len() % 2 == 1).with_limits(limits());
    let read = bounded(data, PER_BYTE, BASE, || read_bytes("fuzz.ply", data, &options));
    parts::ply(data, &options, read.as_ref(), [PER_BYTE, BASE]);
    let Ok(read) = read else { return };
    invariants::splats(&read.splats);
    let mut bytes = Vec::new();
    if let Err(error) = write(&mut bytes, &read.splats) {
        panic!("what was read cannot be written: {error}");
    }
    let again = read_bytes("again.ply", &bytes, &options).expect("what was written can be read");
    assert_eq!(again.splats.len(), read.splats.len());
    let mut second = Vec::new();
    write(&mut second, &again.splats).expect("written again");
    assert!(bytes == second, "written, read and written again differs");
});
