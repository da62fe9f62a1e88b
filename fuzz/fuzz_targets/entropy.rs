//! The entropy decoder without a file around it, and coding followed by decoding.
#![no_main]

use lexisplat::packed::fuzzing;
use lexisplat_fuzz::made::Bytes;
use lexisplat_fuzz::one_thread;
use libfuzzer_sys::fuzz_target;

/// The next `N` parts of the input, whose lengths come first, and the rest of it.
fn parts<'a, const N: usize>(mut bytes: Bytes<'a>) -> ([&'a [u8]; N], &'a [u8]) {
    let lengths: [usize; N] =
        std::array::from_fn(|_| usize::from(u16::from_le_bytes([bytes.byte(), bytes.byte()])));
    let mut rest = bytes.0;
    let parts = lengths.map(|length| {
        let (part, tail) = rest.split_at(length.min(rest.len()));
        rest = tail;
        part
    });
    (parts, rest)
}

fuzz_target!(init: one_thread(), |data: &[u8]| {
    let mut bytes = Bytes(data);
    match bytes.byte() % 2 {
        0 => {
            let lanes = bytes.byte();
            let ([tables, range], script) = parts(bytes);
            // Any answer will do: nearly all inputs are no chunk.
            let _ = fuzzing::decode(tables, range, lanes, script);
        }
        _ => {
            let lanes = bytes.byte();
            let mut script = Vec::new();
            while !bytes.0.is_empty() {
                let what: [u8; 3] = std::array::from_fn(|_| bytes.byte());
                let set = u16::from_le_bytes([bytes.byte(), bytes.byte()]);
                let width = bytes.byte() % 9;
                let value = (0..width).fold(0_u64, |v, _| v << 8 | u64::from(bytes.byte()));
                script.push((what, set, value));
            }
            assert!(fuzzing::round_trip(lanes, &script), "what was coded does not come back");
        }
    }
});
