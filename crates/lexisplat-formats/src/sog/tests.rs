//! Archives and folders that come back, and those that lie.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::Path;

use flate2::Compression;
use flate2::write::DeflateEncoder;
use lexisplat::{Input, Silent, Splats};
use lexisplat_sample::{SampleOptions, scene};
use serde_json::Value;

use super::*;
use crate::open::open;
use crate::write_options::WriteOptions;

/// Gaussians of the scene.
pub(super) const GAUSSIANS: usize = 300;

fn sample() -> Splats {
    scene(&SampleOptions::new(GAUSSIANS, 3))
}

/// The members of a SOG by name.
pub(super) type Members = BTreeMap<String, Vec<u8>>;

pub(super) fn members(splats: &Splats) -> Members {
    let (bytes, _) = write(splats, &WriteOptions::default(), &Silent).unwrap();
    let archive = Files::Archive(Archive::open("a", &bytes).unwrap());
    let names = ["means_l", "means_u", "quats", "scales", "sh0", "shN_centroids", "shN_labels"];
    let names = names.map(|name| format!("{name}.webp")).into_iter().chain([META.to_owned()]);
    names
        .filter_map(|name| {
            let content = archive.get(&name, &Limits::default()).ok()?.to_vec();
            Some((name, content))
        })
        .collect()
}

fn archive(members: &Members) -> Vec<u8> {
    let all: Vec<(&str, Vec<u8>)> = members.iter().map(|(name, v)| (name.as_str(), v.clone())).collect();
    archive::write(&all).unwrap()
}

fn opened(bytes: &[u8]) -> Result<Splats> {
    let opened = open("a.sog", bytes, Siblings::NONE, &ReadOptions::default(), true, &Silent)?;
    Ok(opened.source().whole()?.into_owned())
}

/// The scene in `folder`.
pub(super) fn opened_at(folder: &Path) -> Result<Splats> {
    let path = crate::scene_path(folder);
    let (name, bytes) = (path.display().to_string(), Input::open(&path)?);
    let opened = open(&name, &bytes, Siblings::of(&path), &ReadOptions::default(), true, &Silent)?;
    Ok(opened.source().whole()?.into_owned())
}

/// A stranger's folder may hold links and pipes: what is no file of the folder is not read, nor waited for.
#[cfg(unix)]
#[test]
fn pictures_that_are_links_and_pipes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene");
    std::fs::create_dir(&scene).unwrap();
    let all = members(&sample());
    for (name, content) in &all {
        std::fs::write(scene.join(name), content).unwrap();
    }
    assert_eq!(opened_at(&scene).unwrap().len(), GAUSSIANS);
    let refused = |picture: &dyn Fn(&Path)| {
        let path = scene.join("means_l.webp");
        std::fs::remove_file(&path).unwrap();
        picture(&path);
        opened_at(&scene).unwrap_err().to_string()
    };
    let link = |to: &Path, path: &Path| std::os::unix::fs::symlink(to, path).unwrap();
    let said = refused(&|path| link(Path::new("/dev/zero"), path));
    assert!(said.contains("means_l.webp: it leads out of the folder"), "{said}");
    // The picture that is meant, but elsewhere.
    let elsewhere = folder.path().join("elsewhere");
    std::fs::write(&elsewhere, &all["means_l.webp"]).unwrap();
    let said = refused(&|path| link(&elsewhere, path));
    assert!(said.contains("it leads out of the folder"), "{said}");
    let said = refused(&|path| {
        let made = std::process::Command::new("mkfifo").arg(path).status().unwrap();
        assert!(made.success());
    });
    assert!(said.contains("regular file"), "{said}");
    // A link within the folder is as good as the file.
    std::fs::write(scene.join("other"), &all["means_l.webp"]).unwrap();
    std::fs::remove_file(scene.join("means_l.webp")).unwrap();
    link(Path::new("other"), &scene.join("means_l.webp"));
    assert_eq!(opened_at(&scene).unwrap().len(), GAUSSIANS);
}

/// Returns the error of a SOG that `change` made wrong.
fn refused(change: impl Fn(&mut Members)) -> Error {
    let mut members = members(&sample());
    change(&mut members);
    opened(&archive(&members)).unwrap_err()
}

/// As [`refused`] of a change of `meta.json`.
fn refused_meta(change: impl Fn(&mut Value)) -> Error {
    refused(|members| {
        let mut meta: Value = serde_json::from_slice(&members[META]).unwrap();
        change(&mut meta);
        members.insert(META.to_owned(), serde_json::to_vec(&meta).unwrap());
    })
}

#[test]
fn archives_and_folders_hold_the_scene_within_the_quantum() {
    for degree in 0..=3 {
        let mut splats = sample().with_degree_cut(ShDegree::new(degree).unwrap());
        splats.meta.antialiased = degree == 1;
        let (bytes, _) = write(&splats, &WriteOptions::default(), &Silent).unwrap();
        let read = opened(&bytes).unwrap();
        assert_eq!((read.degree, read.meta.antialiased), (splats.degree, degree == 1));
        // The order is another: each written Gaussian is near one of the scene.
        for (position, scales) in read.geometry.positions.iter().zip(&read.geometry.scales) {
            let g = &splats.geometry;
            let away = |i: usize| -> f32 { (0..3).map(|k| (g.positions[i][k] - position[k]).abs()).sum() };
            let i = (0..splats.len()).min_by(|&a, &b| away(a).total_cmp(&away(b))).unwrap();
            assert!(away(i) < 1e-3, "{}", away(i));
            assert!((0..3).all(|k| (g.scales[i][k] - scales[k]).abs() < 0.1));
        }
        let members = members(&splats);
        let given = |name: &str, _: &Limits| Ok(Input::from(members[name].clone()));
        let siblings = Siblings::given(&given);
        let meta = &members[META];
        let opened = open("meta.json", meta, siblings, &ReadOptions::default(), true, &Silent).unwrap();
        assert_eq!(*opened.source().whole().unwrap(), read);
        let all: usize = members.values().map(Vec::len).sum();
        assert_eq!(opened.source().source_bytes(), all as u64);
    }
}

#[test]
fn names_outside_of_the_archive_are_refused() {
    for name in ["../means_l.webp", "/etc/passwd", "C:\\a", "http://a/b", "", "."] {
        let error = refused_meta(|meta| meta["means"]["files"][0] = name.into());
        assert!(error.to_string().contains("plain name"), "{error}");
    }
    let error = refused_meta(|meta| meta["means"]["files"][0] = "other.webp".into());
    assert!(error.to_string().contains("'other.webp' is missing"), "{error}");
    let (bytes, _) = write(&sample(), &WriteOptions::default(), &Silent).unwrap();
    let found = Archive::open("a", &bytes).unwrap();
    assert!(Files::Archive(found).get("none", &Limits::default()).is_err());
}

#[test]
fn pictures_of_other_sizes_are_refused() {
    let small = picture::write(&[[1, 2, 3, 255]; 16], 4, 4).unwrap();
    for name in ["means_l", "means_u", "quats", "scales", "sh0", "shN_labels", "shN_centroids"] {
        let error = refused(|members| {
            members.insert(format!("{name}.webp"), small.clone());
        });
        assert!(error.to_string().contains(&format!("'{name}.webp' ")), "{error}");
    }
    let error = refused(|members| {
        members.insert("quats.webp".to_owned(), b"RIFF and nothing else".to_vec());
    });
    assert!(error.to_string().contains("no WebP"), "{error}");
}

/// A picture of 16,383 pixels a side, as its few bytes say.
fn huge() -> Vec<u8> {
    // A lossless WebP of one pixel, whose size is 14 bits of width less 1, then 14 of height less 1.
    let mut webp = picture::write(&[[1, 2, 3, 255]], 1, 1).unwrap();
    let at = webp.windows(4).position(|w| w == b"VP8L").unwrap() + 9;
    assert_eq!(webp[at - 1], 0x2f);
    let flags = u32::from_le_bytes(*webp[at..].first_chunk().unwrap()) & !0x0fff_ffff;
    webp[at..at + 4].copy_from_slice(&(flags | 0x3ffe << 14 | 0x3ffe).to_le_bytes());
    webp
}

/// A picture of one colour has a few bytes for a gigabyte of pixels.
#[test]
fn small_pictures_that_claim_many_pixels_are_refused() {
    let webp = huge();
    let error = refused(|members| {
        members.insert("means_l.webp".to_owned(), webp.clone());
    });
    assert!(matches!(error, Error::Limit { name: Some("expansion"), .. }), "{error}");
}

/// Bytes that are never read, beside pictures or in them, do not make room for larger ones.
#[test]
fn junk_in_an_archive_buys_no_memory() {
    let junk = vec![7; 8 << 20];
    let error = refused(|members| {
        members.insert("means_l.webp".to_owned(), huge());
        members.insert("junk".to_owned(), junk.clone());
    });
    assert!(matches!(error, Error::Limit { name: Some("expansion"), .. }), "{error}");
    let error = refused(|members| {
        let mut webp = huge();
        webp.extend(&junk);
        members.insert("means_l.webp".to_owned(), webp);
    });
    assert!(error.to_string().contains("16383 x 16383 pixels, where 1048576 are most"), "{error}");
}

#[test]
fn entries_that_the_palette_lacks_are_refused() {
    let error = refused_meta(|meta| meta["shN"]["count"] = 3.into());
    assert!(error.to_string().contains("of the palette, which has 3"), "{error}");
    let error = refused_meta(|meta| meta["shN"]["count"] = 70_000.into());
    assert!(error.to_string().contains("entries"), "{error}");
    let error = refused_meta(|meta| meta["shN"]["bands"] = 4.into());
    assert!(error.to_string().contains("'shN.bands' is 4"), "{error}");
}

#[test]
fn descriptions_that_are_wrong_are_named() {
    let error = refused_meta(|meta| meta["version"] = 3.into());
    assert!(error.to_string().contains("version 3"), "{error}");
    let error = refused_meta(|meta| meta["count"] = (u64::from(u32::MAX) + 7).into());
    assert!(matches!(error, Error::Limit { .. }), "{error}");
    let error = refused_meta(|meta| meta["count"] = 1_000_000.into());
    assert!(error.to_string().contains("for 1000000 Gaussians"), "{error}");
    let error = refused_meta(|meta| meta["means"]["maxs"][1] = 1e30.into());
    assert!(error.to_string().contains("not finite"), "{error}");
    let error = refused_meta(|meta| meta["scales"]["codebook"][9] = 1e39.into());
    assert!(error.to_string().contains("scales"), "{error}");
    let error = refused_meta(|meta| {
        meta["sh0"]["codebook"].as_array_mut().unwrap().pop();
    });
    assert!(error.to_string().contains("255 values, not 256"), "{error}");
}

/// A zip archive of one member, deflated, that claims to have `plain` bytes.
fn deflated(name: &str, content: &[u8], plain: u32) -> Vec<u8> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(content).unwrap();
    let packed = encoder.finish().unwrap();
    let mut bytes = archive::write(&[(name, packed.clone())]).unwrap();
    let central = bytes.windows(4).position(|w| w == b"PK\x01\x02").unwrap();
    bytes[central + 10..][..2].copy_from_slice(&8_u16.to_le_bytes());
    bytes[central + 16..][..4].copy_from_slice(&crc32fast::hash(content).to_le_bytes());
    bytes[central + 24..][..4].copy_from_slice(&plain.to_le_bytes());
    bytes
}

#[test]
fn archives_that_unpack_to_more_than_they_say_are_refused() {
    let content = vec![b' '; 1 << 20];
    // 1 MiB in about 1 KiB is beyond what a byte may stand for.
    let error = opened(&deflated(META, &content, 1 << 20)).unwrap_err();
    assert!(matches!(error, Error::Limit { name: Some("expansion"), .. }), "{error}");
    for plain in [0, 1000, 100_000] {
        let error = opened(&deflated(META, &content, plain)).unwrap_err();
        assert!(error.to_string().contains("bytes that the directory says"), "{error}");
    }
    // Deflated members are read.
    let members = members(&sample());
    let meta = &members[META];
    let bytes = deflated(META, meta, u32::try_from(meta.len()).unwrap());
    let error = opened(&bytes).unwrap_err();
    assert!(error.to_string().contains("'means_l.webp' is missing"), "{error}");
}

#[test]
fn directories_that_are_wrong_are_refused() {
    let good = archive(&members(&sample()));
    let central = good.windows(4).position(|w| w == b"PK\x01\x02").unwrap();
    let end = good.windows(4).position(|w| w == b"PK\x05\x06").unwrap();
    let with = |at: usize, value: &[u8]| {
        let mut bytes = good.clone();
        bytes[at..at + value.len()].copy_from_slice(value);
        opened(&bytes).unwrap_err().to_string()
    };
    // `meta.json` is the first member.
    let cases: [(usize, &[u8], &str); 8] = [
        (central + 8, &[1, 0], "encrypted"),
        (central + 10, &[12, 0], "method 12"),
        (central + 16, &[0; 4], "checksum"),
        (central + 20, &[0xff; 4], "cut off"),
        (central + 42, &[0xf0; 4], "not where the directory says"),
        (end + 10, &[0xff, 0xff], "several parts"),
        (end + 16, &[0xff, 0xff, 0xff, 0x7f], "outside of it"),
        (end + 20, &[1, 0], "no end"),
    ];
    for (at, value, said) in cases {
        let error = with(at, value);
        assert!(error.contains(said), "{said}: {error}");
    }
    let twice = archive::write(&[(META, vec![b'{']), (META, vec![b'}'])]).unwrap();
    assert!(opened(&twice).unwrap_err().to_string().contains("two members"));
}
