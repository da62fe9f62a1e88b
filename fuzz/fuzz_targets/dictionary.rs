//! Dictionary files and the dictionaries of scenes: refused, or unit atoms.
#![no_main]

use lexisplat::lexi::read_dictionary_bytes;
use lexisplat_fuzz::allocator::{PACKED_HEAD, PACKED_PER_BYTE, bounded};
use lexisplat_fuzz::{container, limits, one_thread};
use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};

const PER_BYTE: usize = PACKED_PER_BYTE;
/// Tables and a dictionary as they are read, and the container.
const BASE: usize = PACKED_HEAD + (1 << 20);
/// How far from 1 a norm may be, squared.
const NORM_SLACK: f64 = 1e-4;

fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    container::mutate(data, size, max_size, seed, |buffer, len| {
        let room = buffer.len();
        fuzzer_mutate(buffer, len, room)
    })
});

fuzz_target!(init: one_thread(), |data: &[u8]| {
    let read = bounded(data, PER_BYTE, BASE, || read_dictionary_bytes("fuzz.lexi", data, &limits()));
    let Ok(dictionary) = read else { return };
    assert!((1..=lexisplat::MAX_ATOMS).contains(&dictionary.len()));
    assert_eq!(dictionary.dim(), dictionary.degree().rest());
    for atom in dictionary.as_slice().chunks_exact(dictionary.dim()) {
        let norm: f64 = atom.iter().map(|&v| f64::from(v) * f64::from(v)).sum();
        assert!((norm - 1.0).abs() < NORM_SLACK, "an atom of squared norm {norm}");
    }
});
