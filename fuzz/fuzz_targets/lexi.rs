//! .lexi files of any layout: refused, or a model whose parts fit and that comes back from its file.
#![no_main]

use lexisplat::Layout;
use lexisplat::lexi::{Contents, open_bytes};
use lexisplat_fuzz::allocator::bounded;
use lexisplat_fuzz::{container, invariants, limits, one_thread};
use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};

/// Tensors are copied and converted; a JSON header takes many times its bytes as it is parsed.
const PER_BYTE: usize = 128;
/// What is rounded up.
const BASE: usize = 1 << 20;

fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    container::mutate(data, size, max_size, seed, |buffer, len| {
        let room = buffer.len();
        fuzzer_mutate(buffer, len, room)
    })
});

fuzz_target!(init: one_thread(), |data: &[u8]| {
    let opened = bounded(data, PER_BYTE, BASE, || open_bytes("fuzz.lexi", data, &limits()));
    if let Ok(Contents::Model(model)) = opened {
        assert_ne!(model.record.layout, Layout::Packed);
        invariants::model(&model);
        invariants::exact_round_trip(&model);
    }
});
