//! Rules for files of other programs' formats, whatever their bytes.

use std::sync::Mutex;

use lexisplat::ply::ReadOptions;
use lexisplat::{Input, Limits, Result, Silent, SplatSource, Splats};
use lexisplat_formats::{Kind, Opened, Siblings, WriteOptions, open, write};

use crate::allocator::bounded;
use crate::{invariants, limits, parts};

/// Bytes that reading may hold for each byte of the file: what it is unpacked to and the scene that is made of it, each up
/// to [`Limits::expansion`] times the file; of a SOG also one file of the archive.
const PER_BYTE: usize = 3 * 256;
/// Windows of unpackers, tables of decoders, and what is rounded up.
const BASE: usize = 24 << 20;
/// Gaussians up to which a scene is written again: more says nothing new and takes long.
const SMALL: usize = 4096;

/// Reads `data` as the file `name`, whole and in parts, and writes what was read and reads it again.
///
/// # Panics
/// If something is not as it must be.
pub fn check(name: &str, data: &[u8], siblings: &Siblings<'_>) {
    check_sized(name, data, data, siblings);
}

/// As [`check`] for a file whose siblings and itself are made of `input`.
fn check_sized(name: &str, data: &[u8], input: &[u8], siblings: &Siblings<'_>) {
    let options = ReadOptions::default().with_drop_invalid(input.len() % 2 == 1).with_limits(limits());
    let read = bounded(input, PER_BYTE, BASE, || -> Result<(Kind, Option<Splats>)> {
        let opened = open(name, data, *siblings, &options, true, &Silent)?;
        // Reading the PLY of trainers has a target of its own, and that of .lexi too.
        let Opened::Other(kind, source) = opened else { return Ok((opened.kind(), None)) };
        let whole = source.whole()?.into_owned();
        parts::source(data, &*source, &whole);
        Ok((kind, Some(whole)))
    });
    let Ok((kind, Some(splats))) = read else { return };
    invariants::splats(&splats);
    if splats.is_empty() || splats.len() > SMALL || !Kind::WRITTEN.contains(&kind) {
        return;
    }
    let written = |splats: &Splats| {
        let mut bytes = Vec::new();
        write(kind, splats, &WriteOptions::default(), &mut bytes, &Silent)
            .expect("what was read can be written");
        bytes
    };
    let first = written(&splats);
    let options = ReadOptions::default();
    let again =
        open("again", &first, Siblings::NONE, &options, true, &Silent).expect("what was written opens");
    assert_eq!(again.kind(), kind);
    let again = again.source().whole().expect("what was written can be read").into_owned();
    assert_eq!((again.len(), again.degree), (splats.len(), splats.degree));
    invariants::splats(&again);
    // The lists of values of a SOG are learnt, and a .splat has scales whose logarithms are rounded.
    let is_same = matches!(kind, Kind::Sog | Kind::Splat) || written(&again) == first;
    assert!(is_same, "written, read and written again differs");
}

/// As [`check`] for a file whose others are pieces of `input` too, each after its length in 16 bits, in the order in which
/// they are asked for; the first piece is the file itself.
///
/// # Panics
/// If something is not as it must be.
pub fn check_pieces(name: &str, input: &[u8]) {
    let (data, rest) = piece(input);
    let left = Mutex::new(rest);
    let next = |_: &str, _: &Limits| {
        let mut left = left.lock().expect("one thread");
        let (bytes, rest) = piece(&left);
        *left = rest;
        Ok(Input::from(bytes.to_vec()))
    };
    check_sized(name, data, input, &Siblings::given(&next));
}

/// The first piece of `input`, and what comes after it.
fn piece(input: &[u8]) -> (&[u8], &[u8]) {
    let Some((length, rest)) = input.split_first_chunk() else { return (&[], &[]) };
    rest.split_at(usize::from(u16::from_le_bytes(*length)).min(rest.len()))
}
