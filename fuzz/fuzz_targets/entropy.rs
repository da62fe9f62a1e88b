//! The entropy decoders without a file around them, and coding followed by decoding.
#![no_main]

use lexisplat::packed::fuzzing::{decode, round_trip};
use lexisplat_fuzz::made::Bytes;
use lexisplat_fuzz::one_thread;
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: one_thread(), |data: &[u8]| {
    let mut bytes = Bytes(data);
    if bytes.byte() % 2 == 0 {
        let lengths: [usize; 3] =
            std::array::from_fn(|_| usize::from(u16::from_le_bytes([bytes.byte(), bytes.byte()])));
        let mut rest = bytes.0;
        let parts = lengths.map(|length| {
            let (part, tail) = rest.split_at(length.min(rest.len()));
            rest = tail;
            part
        });
        // Any answer will do: nearly all inputs are no chunk.
        let _ = decode(parts[0], parts[1], parts[2], rest);
    } else {
        let mut values = Vec::new();
        while !bytes.0.is_empty() {
            let (stream, context, width) = (bytes.byte(), bytes.byte(), bytes.byte() % 9);
            let value = (0..width).fold(0_u64, |v, _| v << 8 | u64::from(bytes.byte()));
            values.push((stream, context, value));
        }
        assert!(round_trip(&values), "what was coded does not come back");
    }
});
