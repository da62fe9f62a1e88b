//! Ways to change a packed file that leave its container whole.

use lexisplat_testing::Random;
use serde_json::Value;

use crate::parts::Parts;

/// Changes the bytes of one of these tensors, if it is there.
pub(crate) fn change_tensor(parts: &mut Parts, names: &[&str], random: &mut Random) {
    let Some(bytes) = parts.tensor(names[random.below(names.len())]) else { return };
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

pub(crate) fn change_metadata(parts: &mut Parts, random: &mut Random) {
    let keys = ["gaussians", "degree", "layout", "version", "target", "reached", "tolerance"];
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
