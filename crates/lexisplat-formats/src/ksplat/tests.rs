use lexisplat::{Error, Silent, Splats};
use lexisplat_sample::{SampleOptions, scene};
use lexisplat_testing::Random;

use super::layout::{HEADER, SECTION_HEADER};
use super::*;
use crate::kind::Kind;
use crate::open::open;
use crate::siblings::Siblings;

/// Files that the format's own program made, with their level and degree (tests/data/README.md).
const FILES: [(&[u8], u8, u8); 5] = [
    (include_bytes!("../../tests/data/ksplat_l0_d2.ksplat"), 0, 2),
    (include_bytes!("../../tests/data/ksplat_l1_d1.ksplat"), 1, 1),
    (include_bytes!("../../tests/data/ksplat_l1_d2.ksplat"), 1, 2),
    (include_bytes!("../../tests/data/ksplat_l2_d0.ksplat"), 2, 0),
    (include_bytes!("../../tests/data/ksplat_l2_d2.ksplat"), 2, 2),
];
/// Gaussians of the scene that they were made from.
const GAUSSIANS: usize = 60;
/// Side of their buckets.
const BLOCK: f32 = 1.0;

fn opened(bytes: &[u8]) -> Result<Splats> {
    let opened = open("a", bytes, Siblings::NONE, &ReadOptions::default(), true, &Silent)?;
    assert_eq!(opened.kind(), Kind::Ksplat);
    Ok(opened.source().whole()?.into_owned())
}

#[test]
fn files_of_its_own_program_hold_the_scene() {
    let whole = scene(&SampleOptions::new(GAUSSIANS, 1));
    let source = &whole.geometry;
    for (bytes, level, degree) in FILES {
        let read = opened(bytes).unwrap();
        assert_eq!((read.len(), read.degree.get()), (GAUSSIANS, degree));
        let share = f32::from(f16::EPSILON);
        let is_whole = level == 0;
        let (place, relative) = if is_whole { (0.0, 1e-6) } else { (BLOCK / 2.0 / 32_767.0, share) };
        let sh_step = [1e-6, share, 3.0 / 255.0][usize::from(level)];
        let mut seen = [false; GAUSSIANS];
        for i in 0..GAUSSIANS {
            let g = &read.geometry;
            let far = |j: usize| {
                (0..3).map(|k| (g.positions[i][k] - source.positions[j][k]).abs()).fold(0.0, f32::max)
            };
            let j = (0..GAUSSIANS).min_by(|&a, &b| far(a).total_cmp(&far(b))).unwrap();
            assert!(far(j) <= place + 1e-6, "level {level}, Gaussian {i} is {} off", far(j));
            assert!(!std::mem::replace(&mut seen[j], true));
            for k in 0..3 {
                assert!((g.scales[i][k] - source.scales[j][k]).abs() <= 2.0 * relative + 1e-5);
                let share = (COLOUR_OFFSET + C0 * source.dc[j][k]).clamp(0.0, 1.0);
                assert!((COLOUR_OFFSET + C0 * g.dc[i][k] - share).abs() <= 1.001 / 255.0);
            }
            let sigmoid = |v: f32| 1.0 / (1.0 + (-v).exp());
            assert!((sigmoid(g.opacities[i]) - sigmoid(source.opacities[j])).abs() <= 1.001 / 255.0);
            let length = |q: [f32; 4]| q.iter().map(|v| v * v).sum::<f32>().sqrt();
            let (a, b) = (g.rotations[i], source.rotations[j]);
            let dot: f32 = (0..4).map(|k| a[k] * b[k]).sum::<f32>() / length(a) / length(b);
            assert!(dot.abs() > 1.0 - 2.0 * share, "{a:?} {b:?}");
            let (mine, theirs) = (read.degree.rest() / 3, whole.degree.rest() / 3);
            for c in 0..3 {
                for k in 0..mine {
                    let value = whole.sh_rest[(3 * j + c) * theirs + k].clamp(-1.5, 1.5);
                    let error = (read.sh_rest[(3 * i + c) * mine + k] - value).abs();
                    assert!(error <= sh_step, "level {level}, SH {c} {k} of Gaussian {i} is {error} off");
                }
            }
        }
    }
}

/// A file of level 1 and degree 0 with two sections of three Gaussians each, in one full bucket and one of a single one.
fn two_sections() -> Vec<u8> {
    let mut bytes = vec![0; HEADER + 2 * SECTION_HEADER];
    let mut put = |at: usize, value: u32| bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
    put(4, 2);
    put(16, 6);
    put(20, 1);
    for s in 0..2 {
        let at = HEADER + s * SECTION_HEADER;
        for (field, value) in [(0, 3), (4, 3), (8, 2), (12, 2), (20, 12), (32, 1), (36, 1)] {
            put(at + field, value);
        }
        put(at + 16, 2.0_f32.to_bits());
    }
    bytes[1] = 1;
    for s in 0..2 {
        bytes.extend(1_u32.to_le_bytes());
        for bucket in 0..2 {
            for k in 0..3 {
                bytes.extend(((100 * s + 10 * bucket + k) as f32).to_le_bytes());
            }
        }
        for i in 0..3_u16 {
            let mut row = [0_u8; 24];
            row[..2].copy_from_slice(&(32_767 * i).to_le_bytes());
            row[12..14].copy_from_slice(&f16::ONE.to_bits().to_le_bytes());
            bytes.extend(row);
        }
    }
    bytes
}

#[test]
fn buckets_and_sections_are_where_they_say() {
    let bytes = two_sections();
    let read = opened(&bytes).unwrap();
    let x: Vec<f32> = read.geometry.positions.iter().map(|p| p[0]).collect();
    assert_eq!(x, [-1.0, 0.0, 11.0, 99.0, 100.0, 111.0]);
    assert_eq!(read.geometry.positions[2][1..], [10.0, 11.0]);
    assert_eq!(read.geometry.scales[0], [LEAST_SCALE; 3]);
    let opened = open("a", &bytes, Siblings::NONE, &ReadOptions::default(), true, &Silent).unwrap();
    let mut part = opened.source().empty();
    opened.source().read(2..5, &mut part).unwrap();
    assert_eq!(part.geometry.positions[..], read.geometry.positions[2..5]);
}

#[test]
fn headers_that_do_not_fit_are_refused() {
    let section = HEADER + SECTION_HEADER;
    let cases: [(usize, u32, &str); 11] = [
        (0, 0x0101, "version 1.1"),
        (20, 3, "compression level 3"),
        (4, u32::MAX, "the headers of sections"),
        (16, 7, "counts 7 Gaussians, its sections 6"),
        (section, 4, "section 1: it holds 4 Gaussians and has room for 3"),
        (section + 4, u32::MAX, "the Gaussians of section 1 needs"),
        (section + 12, u32::MAX, "centres of section 1 needs"),
        (section + 20, 16, "buckets take 16 bytes"),
        (section + 32, 2, "2 full buckets and 1 others"),
        (section + 36, u32::MAX, "sizes of buckets of section 1 needs"),
        (section + 40, 4, "SH degree 4"),
    ];
    for (at, value, expected) in cases {
        let mut bytes = two_sections();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        let error = read("a.ksplat", &bytes, &ReadOptions::default()).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}: {expected}");
    }
    let mut bytes = two_sections();
    let size = HEADER + 2 * SECTION_HEADER;
    bytes[size..size + 4].fill(0);
    let error = read("a", &bytes, &ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("its buckets hold 2 of 3 Gaussians"), "{error}");
}

#[test]
fn damaged_files_are_refused_or_finite() {
    let options = ReadOptions::default();
    let try_read = |bytes: &[u8]| -> Result<Splats> {
        let file = read("a", bytes, &options)?;
        let source = crate::FormatSource::new("a", crate::sog::Sizes::of(bytes.len()), file, &options)?;
        Ok(lexisplat::SplatSource::whole(&source)?.into_owned())
    };
    let mut random = Random::new(1);
    for (bytes, ..) in FILES.into_iter().chain([(&*two_sections(), 1, 0)]) {
        for end in 0..bytes.len() {
            assert!(matches!(try_read(&bytes[..end]), Err(Error::Format { .. })), "{end} bytes");
        }
        for _ in 0..1_000 {
            let mut bytes = bytes.to_vec();
            for _ in 0..=random.below(3) {
                let at = match random.below(3) {
                    0 => random.below(48),
                    1 => HEADER + random.below(48),
                    _ => random.below(bytes.len()),
                };
                bytes[at] = [0, 0xff, u8::try_from(random.below(256)).unwrap()][random.below(3)];
            }
            match try_read(&bytes) {
                Ok(read) => read.validate().unwrap(),
                Err(error) => assert!(matches!(error, Error::Format { .. } | Error::Limit { .. }), "{error}"),
            }
        }
    }
}
