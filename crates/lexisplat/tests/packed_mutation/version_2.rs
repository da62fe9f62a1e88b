//! Ways to change a packed file of version 2 that leave its container whole.

use lexisplat_testing::Random;

use crate::parts::Parts;

/// Its tensors.
pub(crate) const TENSORS: [&str; 5] =
    ["packed.parameters", "packed.lengths", "packed.tables", "packed.data", "packed.order"];

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
