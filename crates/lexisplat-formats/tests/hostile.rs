//! Damaged files of every format that is written: refused, or read as finite scenes whose arrays fit, without panic.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use lexisplat::ply::ReadOptions;
use lexisplat::{Error, Limits, Result, Silent, Splats};
use lexisplat_formats::{Kind, Siblings, WriteOptions, open, write};
use lexisplat_sample::{SampleOptions, scene};
use lexisplat_testing::Random;

/// Gaussians of the files: a few, so that headers are a large part.
const GAUSSIANS: usize = 20;
/// Damaged files of each format, beside all that are cut off.
const MUTATIONS: usize = 10_000;

fn files() -> Vec<(Kind, Vec<u8>)> {
    let splats = scene(&SampleOptions::new(GAUSSIANS, 1));
    let kinds = Kind::WRITTEN.into_iter().filter(|&kind| kind != Kind::Ply).map(|kind| (kind, false));
    let written = kinds.chain([(Kind::Gltf, true)]).map(|(kind, glb_spz)| {
        let mut options = WriteOptions::default();
        options.glb_spz = glb_spz;
        let mut bytes = Vec::new();
        write(kind, &splats, &options, &mut bytes, &Silent).unwrap();
        (kind, bytes)
    });
    written.collect()
}

fn read(bytes: &[u8]) -> Result<Splats> {
    let mut limits = Limits::default();
    limits.gaussians = 1 << 20;
    let options = ReadOptions::default().with_limits(limits);
    let opened = open("damaged", bytes, Siblings::NONE, &options, true, &Silent)?;
    Ok(opened.source().whole()?.into_owned())
}

fn check(kind: Kind, bytes: &[u8]) -> bool {
    match read(bytes) {
        Ok(splats) => {
            splats.validate().unwrap();
            let g = &splats.geometry;
            assert!(
                g.positions.as_flattened().iter().chain(&splats.sh_rest).all(|v| v.is_finite()),
                "{kind}"
            );
            true
        }
        Err(Error::Format { .. } | Error::Limit { .. }) => false,
        Err(error) => panic!("{kind}: {error}"),
    }
}

#[test]
fn cut_off_files_are_refused_or_finite() {
    for (kind, bytes) in files() {
        assert!(check(kind, &bytes), "{kind} as it was written");
        let taken = (0..bytes.len()).filter(|&end| check(kind, &bytes[..end])).count();
        // A .splat ends where a row does, and SPZ in gzip may lack the end of its container.
        assert!(taken <= GAUSSIANS, "{kind}: {taken} of {} are taken", bytes.len());
    }
}

#[test]
fn damaged_files_are_refused_or_finite() {
    for (kind, bytes) in files() {
        let mut random = Random::new(1);
        for _ in 0..MUTATIONS {
            let mut bytes = bytes.clone();
            for _ in 0..=random.below(3) {
                // Headers are at either end.
                let at = match random.below(3) {
                    0 => random.below(bytes.len().min(128)),
                    1 => bytes.len() - 1 - random.below(bytes.len().min(512)),
                    _ => random.below(bytes.len()),
                };
                bytes[at] = [0, 0xff, u8::try_from(random.below(256)).unwrap()][random.below(3)];
            }
            check(kind, &bytes);
        }
    }
}
