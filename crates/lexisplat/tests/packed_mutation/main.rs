//! Damaged and hostile packed files, read whole and a part at a time: refused or decoded to finite numbers, without
//! panic, within memory.

mod files;
mod mutations;

use crate::allocator::{alone, counted, total};
use crate::common::count_in_parts;
use crate::parts::Parts;
use files::{copies, files};
use lexisplat::packed::CHUNK;
use lexisplat::{Limits, Model, Splats, lexi};
use lexisplat_testing::Random;
use mutations::{change_metadata, change_parameters, change_tensor, make_up};
use serde_json::Value;

/// A reader may hold this many bytes per byte of input. A byte is at most 3 Gaussians, each 57 bytes as it is
/// decoded and again in the source's order, with 16 to sort by: 390. Or it is 8 nonzeros of 4 bytes, once in
/// their chunk, once in the model, and twice while lists grow: 128. And 24 are for the container.
const ALLOWED_PER_BYTE: usize = 542;
/// 18 streams of 31 tables, each with a lookup of 2^12 u16 and 1 KiB for itself and what is rounded up. What
/// grows with its symbols, of which a byte has two, is paid for above.
const ALLOWED_TABLES: usize = 18 * 31 * (9 << 10);
/// A dictionary of 1024 atoms of 72 values as it is read, and the 256 Gaussians of 72 values after which
/// a chunk is asked whether it has bits left, as codes or rows, lists growing.
const ALLOWED_BASE: usize = 1024 * 72 * 4 * 2 + 256 * 72 * 16 + (64 << 10);
/// A reader may allocate this many times what it may hold, what it gives back included: lists that grow are allocated
/// about twice, and parts one after another. A reader that goes over the same bytes again and again allocates more.
const ALLOWED_TIMES: usize = 4;
/// Structured mutations tried.
const MUTATIONS: usize = 10_000;

/// Reads `bytes`; asserts the bounds. Whether they were accepted.
fn accepted(bytes: &[u8]) -> bool {
    let before = total();
    let (result, used) = counted(|| lexi::read_bytes("mutated.lexi", bytes, &Limits::default()));
    let in_all = total() - before;
    let allowed = bytes.len() * ALLOWED_PER_BYTE + ALLOWED_TABLES + ALLOWED_BASE;
    assert!(in_all <= ALLOWED_TIMES * allowed, "{in_all} bytes in all for a file of {}", bytes.len());
    assert!(used <= allowed, "{used} bytes allocated for a file of {}, {allowed} allowed", bytes.len());
    let (in_parts, used) = counted(|| count_in_parts(bytes));
    assert!(used <= allowed, "{used} bytes allocated in parts for {}, {allowed} allowed", bytes.len());
    assert_eq!(in_parts.ok(), result.as_ref().ok().map(Model::len), "in parts and whole");
    match result {
        Ok(model) => {
            let Splats { geometry: g, sh_rest, .. } = model.into_splats();
            let arrays = [
                g.positions.as_flattened(),
                g.dc.as_flattened(),
                &g.opacities,
                g.scales.as_flattened(),
                g.rotations.as_flattened(),
                &sh_rest,
            ];
            assert!(arrays.iter().all(|values| values.iter().all(|v| v.is_finite())), "not finite");
            true
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            false
        }
    }
}

#[test]
fn damage_is_refused_within_bounds() {
    let _alone = alone();
    let files = files();
    for (name, bytes) in &files {
        assert!(accepted(bytes), "{name}");
        assert!(accepted(&Parts::of(bytes).sealed()), "{name} taken apart and put together");
        for len in 0..bytes.len() {
            assert!(!accepted(&bytes[..len]), "{name} truncated to {len}");
        }
        let mut longer = bytes.clone();
        longer.push(0);
        assert!(!accepted(&longer), "{name} with a byte more");
        for bit in 0..bytes.len() * 8 {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(!accepted(&flipped), "{name} with bit {bit} flipped");
        }
    }

    let mut random = Random::new(1);
    let (mut taken, mut refused) = (0, 0);
    for _ in 0..MUTATIONS {
        let (_, bytes) = &files[random.below(files.len())];
        let mut parts = Parts::of(bytes);
        match random.below(8) {
            0 | 1 => change_metadata(&mut parts, &mut random),
            2 | 3 => make_up(&mut parts, &mut random),
            4 => change_parameters(&mut parts, &mut random),
            _ => (0..1 + random.below(2)).for_each(|_| change_tensor(&mut parts, &mut random)),
        }
        if accepted(&parts.sealed()) {
            taken += 1;
        } else {
            refused += 1;
        }
    }
    // Both must happen, or the mutations do not reach what they are for.
    assert!(taken > MUTATIONS / 50 && refused > MUTATIONS / 4, "{taken} taken, {refused} refused");

    // The most that can be made of bytes: Gaussians of which nothing is said but the bits of a rotation.
    let many = copies(200_000);
    assert!(accepted(&many));
    let mut parts = Parts::of(&many);
    for lie in [200_001, 3 * many.len(), 3 * many.len() + 1, 1000 * many.len(), 1 << 31] {
        parts.metadata.insert("gaussians".to_owned(), Value::from(lie.to_string()));
        let lengths = parts.tensor("packed.lengths").unwrap();
        lengths.resize(8 * (lie.min(1000 * many.len()).div_ceil(CHUNK) + 1), 0);
        parts.fit_shapes();
        assert!(!accepted(&parts.sealed()), "{lie} Gaussians");
    }
}
