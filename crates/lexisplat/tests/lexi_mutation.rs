//! Damaged and hostile .lexi files, read whole and a part at a time: refused, without panic, within memory.

use crate::allocator::{alone, counted};
use crate::common::{count_in_parts, models, reseal, written};
use lexisplat::{Limits, Model, lexi};
use lexisplat_testing::Random;
use serde_json::Value;

/// A reader may hold this many bytes per byte of input, plus [`ALLOWED_BASE`]: the tensors once, and the
/// header as text, twice parsed.
const ALLOWED_PER_BYTE: usize = 24;
/// Bytes that error messages and empty maps may take.
const ALLOWED_BASE: usize = 64 << 10;
/// Structured mutations tried.
const MUTATIONS: usize = 10_000;

/// Reads `bytes`; asserts the memory bound. Whether they were accepted.
fn accepted(bytes: &[u8]) -> bool {
    let (result, used) = counted(|| lexi::read_bytes("mutated.lexi", bytes, &Limits::default()));
    let allowed = bytes.len() * ALLOWED_PER_BYTE + ALLOWED_BASE;
    assert!(used <= allowed, "{used} bytes allocated for a file of {}, {allowed} allowed", bytes.len());
    let (in_parts, used) = counted(|| count_in_parts(bytes));
    assert!(used <= allowed, "{used} bytes allocated in parts for {}, {allowed} allowed", bytes.len());
    assert_eq!(in_parts.ok(), result.as_ref().ok().map(Model::len), "in parts and whole");
    match result {
        Ok(model) => {
            // An accepted file is a model like any other.
            assert_eq!(model.dense_rest().len(), model.len() * model.degree().rest());
            true
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            false
        }
    }
}

/// Changes one thing of the header.
fn change_header(header: &mut Value, random: &mut Random) {
    let names: Vec<String> = header.as_object().unwrap().keys().cloned().collect();
    let name = &names[random.below(names.len())];
    let numbers =
        [0_u64, 1, 2, 4, 5, 6, 8, 20, 60, 255, 256, 65_536, u64::from(u32::MAX), 1 << 40, 1 << 62, u64::MAX];
    let number = Value::from(numbers[random.below(numbers.len())]);
    let texts = [
        "", "0", "1", "2", "4", "5", "-1", "nan", "inf", "1e400", "f16", "f32", "paper", "true", "[]", "{}",
        "lexi",
    ];
    let text = Value::from(texts[random.below(texts.len())]);
    let dtypes = ["F32", "F16", "U8", "U16", "U32", "I32", "F64", "BOOL", "I64", "F8_E4M3", "?"];
    if name == "__metadata__" {
        let metadata = header["__metadata__"].as_object_mut().unwrap();
        let keys: Vec<String> = metadata.keys().cloned().collect();
        let key = &keys[random.below(keys.len())];
        match random.below(3) {
            0 => drop(metadata.remove(key)),
            1 => drop(metadata.insert("new".to_owned(), text)),
            _ => drop(metadata.insert(key.clone(), text)),
        }
        return;
    }
    let entry = &mut header[name];
    match random.below(6) {
        0 => entry["dtype"] = Value::from(dtypes[random.below(dtypes.len())]),
        1 => entry["data_offsets"][random.below(2)] = number,
        2 => {
            if let Some(shape) = entry["shape"].as_array_mut() {
                let at = random.below(shape.len().max(1));
                match shape.get_mut(at) {
                    Some(slot) => *slot = number,
                    None => shape.push(number),
                }
            }
        }
        3 => drop(entry["shape"].as_array_mut().map(|shape| shape.push(number))),
        4 => drop(header.as_object_mut().unwrap().remove(name)),
        _ => {
            let moved = header.as_object_mut().unwrap().remove(name).unwrap();
            header[["x-unknown", "unknown", "extra.more", "normal", "codes.counts"][random.below(5)]] = moved;
        }
    }
}

#[test]
fn damage_is_refused_within_memory() {
    let _alone = alone();
    let files: Vec<(&str, Vec<u8>)> =
        models().into_iter().map(|(name, codes, m)| (name, written(&m, codes))).collect();
    for (name, bytes) in &files {
        assert!(accepted(bytes), "{name}");
        for len in 0..bytes.len() {
            assert!(!accepted(&bytes[..len]), "{name} truncated to {len}");
        }
        let mut longer = bytes.clone();
        longer.push(0);
        assert!(!accepted(&longer), "{name} with a byte more");
        // All bits of short files, some of long ones.
        let step = 1 + bytes.len() * 8 / 20_000;
        for bit in (0..bytes.len() * 8).step_by(step) {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(!accepted(&flipped), "{name} with bit {bit} flipped");
        }
    }

    let mut random = Random::new(1);
    let (mut taken, mut refused) = (0, 0);
    for _ in 0..MUTATIONS {
        let (_, bytes) = &files[random.below(files.len())];
        let length = usize::try_from(u64::from_le_bytes(*bytes.first_chunk().unwrap())).unwrap();
        let mut header: Value = serde_json::from_slice(&bytes[8..8 + length]).unwrap();
        let mut data = bytes[8 + length..].to_vec();
        if random.below(2) == 0 {
            change_header(&mut header, &mut random);
        }
        for _ in 0..random.below(4) {
            let at = random.below(data.len());
            data[at] = [0, 1, 0x7f, 0x80, 0xff, 0x7c][random.below(6)];
        }
        if accepted(&reseal(&mut header, &mut data)) {
            taken += 1;
        } else {
            refused += 1;
        }
    }
    // Both must happen, or the mutations do not reach what they are for.
    assert!(taken > MUTATIONS / 50 && refused > MUTATIONS / 4, "{taken} taken, {refused} refused");

    for length in [0, 1, 7, 8, u64::MAX, u64::MAX - 7, 1 << 40, 5 << 20] {
        let mut bytes = length.to_le_bytes().to_vec();
        bytes.extend_from_slice(b"{\"a\":{}}");
        assert!(!accepted(&bytes), "header length {length}");
    }
}
