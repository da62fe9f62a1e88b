//! .lexi files of exact layouts: refused, or a model whose parts fit and that comes back from its file; read whole
//! and a part at a time.
#![no_main]

use lexisplat::lexi::LexiReader;
use lexisplat::{CodeLayout, Error, Layout, Model};
use lexisplat_fuzz::allocator::bounded;
use lexisplat_fuzz::{container, invariants, limits, one_thread, parts};
use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};

/// Tensors are copied and converted; a JSON header takes many times its bytes as it is parsed.
const PER_BYTE: usize = 128;
/// Bytes for rounding up.
const BASE: usize = 1 << 20;

fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    container::mutate(data, size, max_size, seed, |buffer, len| {
        let room = buffer.len();
        fuzzer_mutate(buffer, len, room)
    })
});

/// The model of an exact file and the layout of its codes; `None` for a packed file.
fn read(bytes: &[u8]) -> Result<Option<(Model, CodeLayout)>, Error> {
    let reader = LexiReader::open("fuzz.lexi", bytes, &limits())?;
    if reader.layout() == Layout::Packed {
        return Ok(None);
    }
    Ok(Some((reader.model()?, reader.layout().codes())))
}

fuzz_target!(init: one_thread(), |data: &[u8]| {
    let opened = bounded(data, PER_BYTE, BASE, || read(data));
    let whole = match &opened {
        Ok(Some((model, _))) => Ok(model),
        Err(error) => Err(error),
        // The target `packed` makes more packed files, and allows them more memory.
        Ok(None) => return,
    };
    let at_once = 1 + data.len() % 5;
    parts::lexi(data, at_once, whole, [PER_BYTE, BASE]);
    if let Ok(Some((model, codes))) = &opened {
        invariants::model(model);
        invariants::exact_round_trip(model, *codes);
    }
});
