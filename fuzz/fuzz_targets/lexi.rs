//! .lexi files of exact layouts: refused, or a model whose parts fit and that comes back from its file; read whole
//! and a part at a time.
#![no_main]

use lexisplat::Layout;
use lexisplat::lexi::{Contents, open_bytes};
use lexisplat_fuzz::allocator::bounded;
use lexisplat_fuzz::{container, invariants, limits, one_thread, parts};
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
    let whole = match &opened {
        Ok(Contents::Model(model)) => Ok(model),
        Err(error) => Err(error),
        // The target `packed` has more of these, and allows them more.
        Ok(_) => return,
    };
    let at_once = 1 + data.len() % 5;
    parts::lexi(data, at_once, whole, [PER_BYTE, BASE]);
    if let Ok(model) = whole {
        assert_ne!(model.record.layout, Layout::Packed);
        invariants::model(model);
        invariants::exact_round_trip(model);
    }
});
