//! Ways to change a packed file that leave its container whole.

use lexisplat_testing::Random;
use serde_json::Value;

use crate::parts::Parts;

const TENSORS: [&str; 5] =
    ["packed.parameters", "packed.lengths", "packed.tables", "packed.data", "packed.order"];

pub(crate) fn change_tensor(parts: &mut Parts, random: &mut Random) {
    let name = TENSORS[random.below(TENSORS.len())];
    let Some(bytes) = parts.tensor(name) else { return };
    let at = random.below(bytes.len().max(1));
    let several = 1 + random.below(16);
    let noise: Vec<u8> = (0..4 * several).map(|_| random.byte()).collect();
    match random.below(9) {
        0..=2 => bytes.iter_mut().skip(at).take(several).for_each(|b| *b = noise[0]),
        3 => bytes.iter_mut().skip(at).take(several).for_each(|b| *b ^= 1 << (noise[0] % 8)),
        4 => bytes.truncate(at),
        5 => bytes.extend_from_slice(&noise),
        6 => drop(bytes.splice(at..(at + several).min(bytes.len()), noise)),
        7 => bytes.fill_with(|| random.byte()),
        _ => bytes.fill(noise[0]),
    }
    if random.below(4) > 0 {
        parts.fit_shapes();
    }
}

/// Steps and predictors become what no encoder fits, one or a few at a time.
pub(crate) fn change_parameters(parts: &mut Parts, random: &mut Random) {
    let values =
        [0.0, -1.0, 1e-45, 1e-30, 1e10, 1e30, -1e30, f32::MAX, f32::MAX, f32::MIN, f32::MIN, f32::NAN];
    let list = parts.tensor("packed.parameters").unwrap().as_chunks_mut().0;
    let (together, first) = (random.below(2) == 0, random.below(list.len()));
    for k in 0..1 + random.below(6) {
        let at = if together { first + k } else { random.below(list.len()) };
        let value = values[random.below(values.len())].to_le_bytes();
        list.iter_mut().skip(at).take(1).for_each(|entry| *entry = value);
    }
}

pub(crate) fn change_metadata(parts: &mut Parts, random: &mut Random) {
    let keys =
        ["gaussians", "atoms", "atom_bits", "degree", "layout", "version", "promise", "reached", "tolerance"];
    let values = ",0,1,2,3,4,5,14,15,59,61,180,256,1024,1025,4000,32769,4294967294,18446744073709551615,-1,nan,\
        inf,0.5,f32,paper,packed,null,{},{\"target\":\"psnr\"}";
    let values: Vec<&str> = values.split(',').map(str::trim).collect();
    let key = keys[random.below(keys.len())];
    let value = values[random.below(values.len())];
    match random.below(4) {
        0 => {
            let old = parts.metadata.get(key).and_then(Value::as_str).unwrap_or_default();
            let cut = old.get(..old.len().saturating_sub(1)).unwrap_or_default().to_owned();
            parts.metadata.insert(key.to_owned(), Value::from(cut));
        }
        1 => drop(parts.metadata.remove(key)),
        _ => drop(parts.metadata.insert(key.to_owned(), Value::from(value))),
    }
}

/// Tables as a reader takes them, of symbols no encoder would count. Those of the dictionary say nothing,
/// so that it takes no data and the chunk is reached.
fn made_up_tables(random: &mut Random) -> Vec<u8> {
    let mut bits: Vec<bool> = Vec::new();
    let mut put = |count: usize, value: usize| bits.extend((0..count).map(|k| value >> k & 1 == 1));
    let most = [1, 2, 5, 31][random.below(4)];
    for stream in 0..18 {
        let dictionary = stream == 17;
        let clusters = if dictionary { 1 } else { 1 + random.below(most) };
        for _ in 0..24 {
            let changes = random.below(2);
            put(1, changes);
            if changes == 1 {
                put(5, random.below(clusters));
            }
        }
        put(5, clusters);
        for _ in 0..clusters {
            let symbols = if dictionary { 1 } else { [1, 2, 2, 3, 17, 135, 136, 137, 1024][random.below(9)] };
            put(11, symbols);
            for k in 0..symbols {
                let last = k + 1 == symbols;
                let length = if last || random.below(8) == 0 { 1 + random.below(15) } else { 0 };
                put(4, length);
                put(length.saturating_sub(1).min(3), random.below(8));
            }
        }
    }
    let byte = |bits: &[bool]| bits.iter().rev().fold(0, |byte, &bit| byte << 1 | u8::from(bit));
    bits.chunks(8).map(byte).collect()
}

/// A file whose symbols are made up, over data that may be nothing but zeros or ones.
pub(crate) fn make_up(parts: &mut Parts, random: &mut Random) {
    *parts.tensor("packed.tables").unwrap() = made_up_tables(random);
    let data = parts.tensor("packed.data").unwrap();
    let symbols = random.below(data.len() / 4 + 1) * 4;
    match random.below(4) {
        0 => data.fill_with(|| random.byte()),
        1 => data.fill(0),
        2 => data.fill(0xff),
        _ => {
            // The largest integers of either sign differ in their lowest bit.
            data.fill(0xff);
            data.iter_mut().skip(symbols).take(1).for_each(|b| *b = 0xfe);
        }
    }
    let lengths = [0, 0, symbols, data.len() - symbols].map(|l| u32::try_from(l).unwrap().to_le_bytes());
    *parts.tensor("packed.lengths").unwrap() = lengths.concat();
    parts.fit_shapes();
}
