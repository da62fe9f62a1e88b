//! Packed .lexi files: refused or decoded to finite numbers, within memory, whole and a part at a time, and written
//! again as they were.
#![no_main]

use lexisplat::lexi::{Contents, open_bytes, unpack, write_packed};
use lexisplat_fuzz::allocator::bounded;
use lexisplat_fuzz::{container, invariants, limits, one_thread, parts};
use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};

/// As derived in `crates/lexisplat/tests/packed_mutation/main.rs`.
const PER_BYTE: usize = 542;
/// Tables, a dictionary and what a chunk may hold before it is asked for its bits: as there.
const BASE: usize = 18 * 31 * (9 << 10) + 1024 * 72 * 4 * 2 + 256 * 72 * 16 + (64 << 10);

fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    container::mutate(data, size, max_size, seed, |buffer, len| {
        let room = buffer.len();
        fuzzer_mutate(buffer, len, room)
    })
});

fuzz_target!(init: one_thread(), |data: &[u8]| {
    let opened = bounded(data, PER_BYTE, BASE, || open_bytes("fuzz.lexi", data, &limits()));
    let packed = match &opened {
        Ok(Contents::Packed(packed)) => packed,
        Err(error) => return parts::lexi(data, 1, Err(error), [PER_BYTE, BASE]),
        // The target `lexi` has more of these.
        Ok(_) => return,
    };
    let mut bytes = Vec::new();
    write_packed(&mut bytes, packed).expect("what was read can be written");
    let again = open_bytes("again.lexi", &bytes, &limits()).expect("what was written can be read");
    let mut second = Vec::new();
    let Contents::Packed(again) = again else { panic!("no longer packed") };
    write_packed(&mut second, &again).expect("written again");
    assert!(bytes == second, "written, read and written again differs");

    let dictionary = packed.unpack_dictionary();
    let bits = packed.stream_bits();
    let unpacked = bounded(data, PER_BYTE, BASE, || unpack("fuzz.lexi", packed));
    parts::lexi(data, 1, unpacked.as_ref(), [PER_BYTE, BASE]);
    let Ok(model) = unpacked else { return };
    invariants::model(&model);
    assert_eq!(dictionary.expect("the whole could be decoded"), model.dictionary);
    let total: f64 = bits.expect("the whole could be decoded").iter().map(|s| s.bits).sum();
    assert!(total.is_finite() && total >= 0.0, "{total} bits");
});
