//! Packed .lexi files: refused or decoded to finite numbers, within memory, whole and a part at a time, and written
//! again as they were.
#![no_main]

use lexisplat::lexi::{LexiReader, LexiWriter};
use lexisplat::packed::Packed;
use lexisplat::{Error, Silent};
use lexisplat_fuzz::allocator::{PACKED_HEAD, PACKED_PER_BYTE, bounded};
use lexisplat_fuzz::{container, invariants, limits, one_thread, parts};
use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};

const PER_BYTE: usize = PACKED_PER_BYTE;
/// Tables, a dictionary, and what a chunk may hold before it is asked for its bits.
const BASE: usize = PACKED_HEAD + 64 * 16 * 72 * 16;

fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    container::mutate(data, size, max_size, seed, |buffer, len| {
        let room = buffer.len();
        fuzzer_mutate(buffer, len, room)
    })
});

fn read(name: &str, bytes: &[u8]) -> Result<Option<Packed>, Error> {
    LexiReader::open(name, bytes, &limits())?.packed()
}

fn written(packed: &Packed) -> Vec<u8> {
    let mut bytes = Vec::new();
    LexiWriter::packed(packed).write(&mut bytes, &Silent).expect("what was read can be written");
    bytes
}

fuzz_target!(init: one_thread(), |data: &[u8]| {
    let opened = bounded(data, PER_BYTE, BASE, || read("fuzz.lexi", data));
    let packed = match &opened {
        Ok(Some(packed)) => packed,
        Err(error) => return parts::lexi(data, 1, Err(error), [PER_BYTE, BASE]),
        // The target `lexi` makes more exact files.
        Ok(None) => return,
    };
    let bytes = written(packed);
    let again = read("again.lexi", &bytes).expect("what was written can be read").expect("still packed");
    assert!(bytes == written(&again), "written, read and written again differs");

    let dictionary = packed.unpack_dictionary();
    let bits = packed.stream_bits();
    let unpacked = bounded(data, PER_BYTE, BASE, || packed.unpack());
    parts::lexi(data, 1, unpacked.as_ref(), [PER_BYTE, BASE]);
    let Ok(model) = unpacked else { return };
    invariants::model(&model);
    assert_eq!(dictionary.expect("the whole could be decoded"), *model.dictionary());
    match bits {
        Ok(bits) => {
            let total: f64 = bits.iter().map(|s| s.bits).sum();
            assert!(total.is_finite() && total >= 0.0, "{total} bits");
        }
        // Counting reads the interim changes too, which a reader of the whole leaves out.
        Err(error) => assert!(matches!(error, Error::Format { .. }), "{error}"),
    }
});
