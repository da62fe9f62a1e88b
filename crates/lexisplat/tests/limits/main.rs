//! Every limit, with every reader: what is just at it is read, what is just over is refused before it is
//! allocated, and the error says which file it was and how to raise the limit.

mod files;

use std::cell::Cell;

use crate::allocator::{alone, counted};
use crate::common::copies;
use files::{
    HUGE, LARGE, as_ascii, as_ply, exact, model_bytes, packed, packed_bytes, rich, splats_bytes, two_chunks,
};
use lexisplat::lexi::{self, LexiReader};
use lexisplat::packed::Packed;
use lexisplat::ply::{self, PlySource, ReadOptions};
use lexisplat::{Error, Input, Layout, Limits, Result, Silent, SplatSource, stream};

/// The name of every file here.
const NAME: &str = "a file.ext";
/// Gaussians of a file whose arrays are megabytes.
const MANY: usize = 120_000;
/// Bytes that a reader may allocate before it refuses such a file: scratch for 65,536 Gaussians of four values, as
/// values and as bits, and threads.
const SCRATCH: usize = 3 << 20;

type Reader = fn(&[u8], &Limits) -> Result<()>;

fn ply_whole(bytes: &[u8], limits: &Limits) -> Result<()> {
    ply::read_bytes(NAME, bytes, &ReadOptions::default().with_limits(*limits)).map(drop)
}

fn ply_parts(bytes: &[u8], limits: &Limits) -> Result<()> {
    let options = ReadOptions::default().with_limits(*limits);
    let ply = PlySource::open(NAME, bytes, &options, &Silent)?;
    ply.read(0..ply.len(), &mut ply.empty())
}

fn lexi_whole(bytes: &[u8], limits: &Limits) -> Result<()> {
    lexi::read_bytes(NAME, bytes, limits).map(drop)
}

fn lexi_opened(bytes: &[u8], limits: &Limits) -> Result<()> {
    let reader = LexiReader::open(NAME, bytes, limits)?;
    if reader.packed()?.is_none() { reader.model().map(drop) } else { Ok(()) }
}

fn lexi_parts(bytes: &[u8], limits: &Limits) -> Result<()> {
    LexiReader::open(NAME, bytes, limits)?.each(&mut |_, _| Ok(()))
}

fn lexi_surveyed(bytes: &[u8], limits: &Limits) -> Result<()> {
    stream::survey(&LexiReader::open(NAME, bytes, limits)?, &std::env::temp_dir()).map(drop)
}

fn lexi_decompressed(bytes: &[u8], limits: &Limits) -> Result<()> {
    stream::decompress(&LexiReader::open(NAME, bytes, limits)?, &mut std::io::sink(), &Silent).map(drop)
}

fn dictionary(bytes: &[u8], limits: &Limits) -> Result<()> {
    lexi::read_dictionary_bytes(NAME, bytes, limits).map(drop)
}

const PLY: [(&str, Reader); 2] = [("PLY, whole", ply_whole), ("PLY, in parts", ply_parts)];
const LEXI: [(&str, Reader); 4] = [
    (".lexi, whole", lexi_whole),
    (".lexi, in parts", lexi_parts),
    (".lexi, surveyed", lexi_surveyed),
    (".lexi, decompressed", lexi_decompressed),
];

/// Asserts that `least` is the least of limit `name` with which `read` takes `bytes`.
fn at_least(least: u64, name: &'static str, (what, read): (&str, Reader), bytes: &[u8]) {
    let with = |value| Limits::default().with(name, value).unwrap();
    if let Err(error) = read(bytes, &with(least)) {
        panic!("{what}, {name} {least}: {error}");
    }
    let Err(error) = read(bytes, &with(least - 1)) else { panic!("{what}, {name} {}", least - 1) };
    let said = error.to_string();
    assert!(matches!(&error, Error::Limit { name: Some(n), .. } if *n == name), "{what}, {name}: {said}");
    assert!(said.contains(NAME) && said.contains(" is over the limit of "), "{what}: {said}");
    for value in [0, least / 2] {
        assert!(matches!(read(bytes, &with(value)), Err(Error::Limit { .. })), "{what}, {name} {value}");
    }
}

fn plys() {
    let splats = rich(500, LARGE);
    for bytes in [as_ply(&splats), as_ascii(&splats)] {
        let end = bytes.windows(10).position(|w| w == b"end_header").unwrap();
        // Position, normal, base colour, 9 of SH, opacity, scale, rotation, an extra.
        let properties = 3 + 3 + 3 + 9 + 1 + 3 + 4 + 1;
        let held = splats_bytes(&splats);
        for reader in PLY {
            assert_eq!(held, 500 * (26 * 4 + 2));
            at_least(500, "gaussians", reader, &bytes);
            at_least(held, "bytes", reader, &bytes);
            at_least(held.div_ceil(bytes.len() as u64), "expansion", reader, &bytes);
            at_least(end as u64 + 11, "header_bytes", reader, &bytes);
            at_least(properties, "properties", reader, &bytes);
        }
    }
}

fn exact_layouts() {
    for layout in [Layout::F32, Layout::F16, Layout::Paper] {
        let bytes = exact(&rich(500, HUGE), layout);
        let model = lexi::read_bytes(NAME, &bytes, &Limits::default()).unwrap();
        let (escapes, nonzeros) = (model.codes().escapes().gaussians.len(), model.codes().nonzeros());
        assert!(escapes > 0 && nonzeros > 100, "{layout}: {escapes} escapes, {nonzeros} nonzeros");
        let most = model.codes().counts().iter().copied().max().unwrap();
        let header = u64::from_le_bytes(*bytes.first_chunk().unwrap());
        for reader in LEXI.into_iter().chain([(".lexi, opened", lexi_opened as Reader)]) {
            at_least(500, "gaussians", reader, &bytes);
            at_least(12, "atoms", reader, &bytes);
            at_least(most.into(), "nonzeros", reader, &bytes);
            at_least(model_bytes(&model), "bytes", reader, &bytes);
            at_least(model_bytes(&model).div_ceil(bytes.len() as u64), "expansion", reader, &bytes);
            at_least(header, "header_bytes", reader, &bytes);
        }
        at_least(12, "atoms", ("dictionary of a scene", dictionary), &bytes);
        at_least(header, "header_bytes", ("dictionary of a scene", dictionary), &bytes);
    }
}

fn opened(bytes: &[u8]) -> Packed {
    LexiReader::open(NAME, bytes, &Limits::default()).unwrap().packed().unwrap().unwrap()
}

fn packed_layout(bytes: &[u8]) {
    let opened = opened(bytes);
    let model = opened.unpack().unwrap();
    assert!(!model.codes().escapes().gaussians.is_empty() && model.codes().nonzeros() > model.len() / 2);
    let (n, own, held) = (model.len() as u64, packed_bytes(&opened), model_bytes(&model));
    let most = model.codes().counts().iter().copied().max().unwrap();
    let header = u64::from_le_bytes(*bytes.first_chunk().unwrap());
    for reader in LEXI {
        // A whole scene is held beside what it is made of.
        let (held, of) =
            if reader.0.ends_with("whole") { (own + held, own) } else { (held, bytes.len() as u64) };
        at_least(n, "gaussians", reader, bytes);
        at_least(8, "atoms", reader, bytes);
        at_least(most.into(), "nonzeros", reader, bytes);
        at_least(held, "bytes", reader, bytes);
        at_least(held.div_ceil(of), "expansion", reader, bytes);
        at_least(header, "header_bytes", reader, bytes);
    }
    for reader in [("packed, opened", lexi_opened as Reader), ("dictionary of a packed scene", dictionary)] {
        at_least(n, "gaussians", reader, bytes);
        at_least(8, "atoms", reader, bytes);
        at_least(header, "header_bytes", reader, bytes);
    }
    at_least(own, "bytes", ("packed, opened", lexi_opened), bytes);
}

/// A packed scene remembers the limits of its reader.
fn opened_before(bytes: &[u8]) {
    for (name, enough) in [("gaussians", 500), ("atoms", 8), ("nonzeros", 9), ("bytes", 1 << 20)] {
        let read = |limit| {
            let packed = opened(bytes).with_limits(Limits::default().with(name, limit).unwrap());
            (packed.unpack(), packed.stream_bits().map(drop))
        };
        let (model, bits) = read(enough);
        assert!(model.is_ok() && bits.is_ok(), "{name}");
        let (model, bits) = read(0);
        assert!(model.unwrap_err().to_string().contains(NAME), "{name}");
        assert!(matches!(bits, Err(Error::Limit { .. })), "{name}");
    }
}

/// Arrays of megabytes are not made, only to be refused.
fn refused_before_allocation() {
    let many = copies(MANY);
    let plain = many.len() * 56;
    assert!(plain > 2 * SCRATCH);
    let (ply, exact) = (as_ply(&many), exact(&many, Layout::F16));
    let packed = packed(&many, 1e300, false);
    let readers = PLY.map(|r| (r, &ply)).into_iter();
    let readers = readers.chain(LEXI.into_iter().flat_map(|r| [(r, &exact), (r, &packed)]));
    for ((what, read), bytes) in readers.chain([((".lexi, opened", lexi_opened as Reader), &exact)]) {
        // Parts are shorter than the scene.
        for (name, limit) in [("gaussians", MANY as u64 - 1), ("bytes", 1 << 20), ("expansion", 0)] {
            let limits = Limits::default().with(name, limit).unwrap();
            let (result, used) = counted(|| read(bytes, &limits));
            assert!(matches!(result, Err(Error::Limit { .. })), "{what}, {name}");
            assert!(used < SCRATCH, "{what}, {name}: {used} bytes before it was refused");
        }
    }
    let (result, used) = counted(|| lexi_whole(&exact, &Limits::default()));
    assert!(result.is_ok() && used > plain, "the counter does not count");
}

/// A file that cannot be mapped is read no further than is needed to refuse it.
fn pipes() {
    struct Endless(Cell<usize>);
    impl std::io::Read for &Endless {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            self.0.set(self.0.get() + buffer.len());
            Ok(buffer.len())
        }
    }
    let endless = Endless(Cell::new(0));
    let limits = Limits::default().with_bytes(100_000);
    let (error, used) = counted(|| Input::read(NAME, &endless, &limits).unwrap_err());
    let said = error.to_string();
    assert_eq!(said, "bytes of a file.ext: 100001 is over the limit of 100000");
    assert!(endless.0.get() <= 100_001 && used < 500_000, "{} read, {used} allocated", endless.0.get());
    assert_eq!(Input::read(NAME, &[7; 100_000][..], &limits).unwrap().len(), 100_000);
    #[cfg(unix)]
    {
        let path = std::path::Path::new("/dev/zero");
        let options = ReadOptions::default().with_limits(limits);
        let errors = [
            ply::read(path, &options).unwrap_err(),
            lexi::read(path, &limits).unwrap_err(),
            lexi::read_dictionary(path, &limits).unwrap_err(),
        ];
        for said in errors.map(|e| e.to_string()) {
            assert!(said.starts_with("bytes of /dev/zero: 100001 "), "{said}");
        }
    }
}

#[test]
fn limits_hold_for_every_reader() {
    let _alone = alone();
    // Starts the threads, whose own memory is not a reader's.
    lexi_whole(&exact(&rich(5000, LARGE), Layout::F16), &Limits::default()).unwrap();
    plys();
    exact_layouts();
    let small = packed(&rich(500, LARGE), 1e-6, true);
    packed_layout(&small);
    packed_layout(&packed(&rich(500, LARGE), 1e-6, false));
    packed_layout(&two_chunks());
    opened_before(&small);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("d.lexi");
    lexi::write_dictionary(&path, lexi::read_bytes(NAME, &small, &Limits::default()).unwrap().dictionary())
        .unwrap();
    at_least(8, "atoms", ("dictionary", dictionary), &std::fs::read(&path).unwrap());
    refused_before_allocation();
    pipes();
}
