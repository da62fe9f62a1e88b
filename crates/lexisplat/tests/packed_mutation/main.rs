//! Damaged and hostile packed files, read whole and a part at a time: refused or decoded to finite numbers, without
//! panic, within memory.

mod files;
mod index;
mod made_up;
mod mutations;

use crate::allocator::{alone, counted, total};
use crate::common::count_in_parts;
use crate::parts::Parts;
use files::{copies, files, layered, rows};
use index::{FORMS, Form, Index, TENSORS};
use lexisplat::lexi::LexiReader;
use lexisplat::{Limits, MAX_ATOMS, Model, Splats, lexi};
use lexisplat_testing::Random;
use mutations::{change_metadata, change_tensor};
use serde_json::Value;

/// A reader may hold this many bytes per byte of input. A byte is at most 3 Gaussians, each 57 bytes as it is
/// decoded and again in the source's order, with 16 to sort by: 390. Or it is 8 nonzeros of 4 bytes, once in
/// their chunk, once in the model, and twice while lists grow: 128. And 24 are for the container.
const ALLOWED_PER_BYTE: usize = 542;
/// 61 sets of contexts with up to 24 tables, each with a lookup of 2^10 u32, or 2^12 for three of them, in a list that
/// grows, and 256 symbols of 16 bytes. A table may take 2 bytes of a file. The dictionary is read when the list has
/// grown, and takes less than that had taken. [`a_head_takes_its_bytes`] has all of them.
const ALLOWED_HEAD: usize = (58 * 24 * (4 << 10) + 3 * 24 * (16 << 10)) * 2 + 61 * 24 * (256 * 16 + 64);
/// Bytes for rounding up, and for the container of a short file.
const ALLOWED_BASE: usize = 64 << 10;
/// Of each thread the 64 Gaussians of 72 values of 16 lanes after which a chunk is asked whether it has bits left, as codes
/// or rows, lists growing.
const ALLOWED_BLOCK: usize = 64 * 16 * 72 * 16;
/// A reader may allocate this many times what it may hold, what it gives back included: lists that grow are allocated
/// about twice, and parts one after another. A reader that goes over the same bytes again and again allocates more.
const ALLOWED_TIMES: usize = 4;
/// Structured mutations tried: of small files, and of a larger one of two layers. They are 10,000 in all.
const MUTATIONS: usize = 9600;
const LAYERED: usize = 400;
/// Of a file that takes long only every so many bytes and bits are tried. It is a prime, so that bits of all kinds are.
const PRIME: usize = 1999;

/// Reads `bytes`; asserts the bounds. Whether they were accepted.
fn accepted(bytes: &[u8]) -> bool {
    let before = total();
    let (result, used) = counted(|| lexi::read_bytes("mutated.lexi", bytes, &Limits::default()));
    let in_all = total() - before;
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let allowed = bytes.len() * ALLOWED_PER_BYTE + ALLOWED_HEAD + ALLOWED_BASE + threads * ALLOWED_BLOCK;
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

/// Asserts that `bytes` are taken, and refused if they are cut or changed; only every `stride`th byte is tried.
fn damaged(name: &str, bytes: &[u8], stride: usize) {
    assert!(accepted(bytes), "{name}");
    for len in (0..bytes.len()).step_by(stride).chain([bytes.len() - 1]) {
        assert!(!accepted(&bytes[..len]), "{name} truncated to {len}");
    }
    let mut longer = bytes.to_vec();
    longer.push(0);
    assert!(!accepted(&longer), "{name} with a byte more");
    for bit in (0..bytes.len() * 8).step_by(stride) {
        let mut flipped = bytes.to_vec();
        flipped[bit / 8] ^= 1 << (bit % 8);
        assert!(!accepted(&flipped), "{name} with bit {bit} flipped");
    }
}

/// Tries `count` mutations of these files, of which `change` makes one. Both must happen, or they do not reach what they
/// are for: that a file is still taken, and that it is refused.
fn mutated(seed: u64, files: &[(&str, Vec<u8>)], count: usize, change: impl Fn(&mut Parts, &mut Random)) {
    let mut random = Random::new(seed);
    let taken = (0..count).filter(|_| {
        let (_, bytes) = &files[random.below(files.len())];
        let mut parts = Parts::of(bytes);
        change(&mut parts, &mut random);
        accepted(&parts.sealed())
    });
    let taken = taken.count();
    assert!(taken > count / 50 && taken < count * 3 / 4, "{taken} of {count} taken");
}

#[test]
fn damage_is_refused_within_bounds() {
    let _alone = alone();
    let files = files();
    for (name, bytes) in &files {
        damaged(name, bytes, 1);
    }
    let layered = vec![("layered", layered())];
    damaged("layered", &layered[0].1, PRIME);
    for (files, count) in [(&files, MUTATIONS), (&layered, LAYERED)] {
        for (name, bytes) in files {
            assert!(accepted(&Parts::of(bytes).sealed()), "{name} taken apart and put together");
        }
        mutated(1, files, count, |parts, random| {
            let index = Index::of(parts);
            match random.below(8) {
                0 => change_metadata(parts, random),
                1 => change_tensor(parts, &TENSORS, random),
                2 | 3 => index.change_head(parts, random),
                4 | 5 => index.change_index(parts, random),
                _ => Index::change_data(parts, random),
            }
            Index::seal(parts);
        });
    }
}

/// The most that can be made of bytes: Gaussians of which nothing is said but the bits of a rotation.
#[test]
fn many_gaussians_take_their_bytes() {
    let _alone = alone();
    let many = copies(200_000);
    assert!(accepted(&many));
    let mut parts = Parts::of(&many);
    let index = Index::of(&mut parts);
    for lie in [1, 32_767, 32_769, 65_536, 65_537, 1 << 31] {
        let mut parts = parts.clone();
        index.clone().claim(&mut parts, lie);
        assert!(!accepted(&parts.sealed()), "{lie} Gaussians a chunk");
    }
    for lie in [200_001, 3 * many.len(), 3 * many.len() + 1, 1000 * many.len(), 1 << 31] {
        parts.metadata.insert("gaussians".to_owned(), Value::from(lie.to_string()));
        assert!(!accepted(&parts.sealed()), "{lie} Gaussians");
    }
}

/// Rows that are said to be stored exactly, of which a file does not hold a bit.
#[test]
fn rows_that_are_not_there_are_refused_within_bounds() {
    let _alone = alone();
    let many = rows(40_000);
    assert!(accepted(&many));
    for most in [64, 1000, 100_000] {
        let mut parts = Parts::of(&many);
        // Layers have levels of refinement before the parts of their nonzeros.
        let mut index = Index::of(&mut parts);
        for kind in 2..6 {
            index.shorten(&mut parts, kind, most);
        }
        assert!(!accepted(&parts.sealed()), "{most} bytes of a range");
    }
}

/// Numbers of 7 bits a byte that are not written as short as they can be, or are too large.
#[test]
fn numbers_have_one_form() {
    let _alone = alone();
    for (name, bytes) in files() {
        let parts = Parts::of(&bytes);
        let index = Index::of(&mut parts.clone());
        for (k, number) in index.numbers.iter().enumerate() {
            // The cell of a lone chunk may be any.
            for form in FORMS.into_iter().filter(|&form| form != Form::Above || !number.is_long) {
                let mut parts = parts.clone();
                number.rewrite(&mut parts, form);
                assert!(!accepted(&parts.sealed()), "{name}, number {k}, {form:?}");
            }
        }
    }
}

/// An index that says that its ranges are sorted though they are not, or the other way round. The ids of sorted ranges
/// may be listed too.
#[test]
fn the_mark_of_sorted_ranges_is_checked() {
    let _alone = alone();
    for (name, bytes) in files().into_iter().chain([("layered", layered())]) {
        for with_ids in [false, true] {
            let mut parts = Parts::of(&bytes);
            let mut index = Index::of(&mut parts);
            let lists_all = index.is_sorted && with_ids;
            index.invert_mark(&mut parts, with_ids);
            Index::seal(&mut parts);
            assert_eq!(accepted(&parts.sealed()), lists_all, "{name}, {with_ids}");
        }
    }
}

/// The most that a short head can ask for: all tables of all symbols, and all atoms.
#[test]
fn a_head_takes_its_bytes() {
    let _alone = alone();
    let one = rows(1);
    accepted(&one);
    let mut parts = Parts::of(&one);
    Index::of(&mut parts).with_atoms(
        &mut parts,
        &made_up::all_tables(),
        MAX_ATOMS,
        &made_up::atoms(MAX_ATOMS),
    );
    let bytes = parts.sealed();
    let open = || LexiReader::open("made up.lexi", &bytes, &Limits::default());
    assert!(open().is_ok(), "{:?}", open().err());
    let (read, used) = counted(|| lexi::read_dictionary_bytes("made up.lexi", &bytes, &Limits::default()));
    assert_eq!(read.unwrap().len(), MAX_ATOMS);
    // Most of what is allowed is needed, and is there while the head is read.
    for used in [used, counted(|| drop(open())).1] {
        let allowed = ALLOWED_HEAD + ALLOWED_BASE;
        assert!(used <= allowed, "{used} bytes allocated for a head, {allowed} allowed");
        assert!(used > ALLOWED_HEAD / 4 * 3, "{used} bytes are not the most, or {ALLOWED_HEAD} are too many");
    }
    // Its data are those of other tables.
    assert!(!accepted(&bytes));
}
