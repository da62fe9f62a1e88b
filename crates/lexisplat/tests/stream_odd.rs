//! Odd scenes go through the streams as they go through memory: none, one, the same again and again, rows left out at
//! the borders of parts, properties of every type, normals, text.

use lexisplat::lexi::LexiReader;
use lexisplat::packed::PackOptions;
use lexisplat::ply::{PlySource, ReadOptions};
use lexisplat::{
    CompressOptions, Extra, ExtraValues, Layout, Limits, ShDegree, Silent, SplatSource, Splats, compress,
    lexi, ply, stats, stream,
};
use lexisplat_sample::{SampleOptions, scene};

/// Gaussians that readers and coders take together.
const BORDERS: [usize; 4] = [1024, 2048, 32_768, 65_536];

fn sample(count: usize, degree: u8) -> Splats {
    scene(&SampleOptions::new(count, 8)).with_degree_cut(ShDegree::new(degree).unwrap())
}

fn file(splats: &Splats) -> Vec<u8> {
    let mut bytes = Vec::new();
    ply::write(&mut bytes, splats).unwrap();
    bytes
}

/// A property of every type, NaN and infinity among the values.
fn with_extras(mut splats: Splats) -> Splats {
    let numbers = || (0..splats.len()).map(|i| u8::try_from(i % 251).unwrap());
    let values = vec![
        ExtraValues::I8(numbers().map(|v| (v / 2).cast_signed() - 100).collect()),
        ExtraValues::U8(numbers().collect()),
        ExtraValues::I16(numbers().map(|v| i16::from(v) * -100).collect()),
        ExtraValues::U16(numbers().map(|v| u16::from(v) * 200).collect()),
        ExtraValues::I32(numbers().map(|v| i32::from(v) - (1 << 30)).collect()),
        ExtraValues::U32(numbers().map(|v| u32::from(v) << 24).collect()),
        ExtraValues::F32(numbers().map(|v| if v % 5 == 0 { f32::NAN } else { f32::from(v) }).collect()),
        ExtraValues::F64(numbers().map(|v| 1.0 / (f64::from(v) - 3.0)).collect()),
    ];
    let named = (0..).zip(values).map(|(k, values)| Extra { name: format!("property_{k}"), values });
    splats.geometry.extras = named.collect();
    splats
}

/// `count` times the same Gaussian.
fn copies(count: usize, degree: u8) -> Splats {
    let one = sample(1, degree);
    let mut splats = one.clone();
    let g = &mut splats.geometry;
    g.positions = one.geometry.positions.repeat(count);
    g.dc = one.geometry.dc.repeat(count);
    g.opacities = one.geometry.opacities.repeat(count);
    g.scales = one.geometry.scales.repeat(count);
    g.rotations = one.geometry.rotations.repeat(count);
    splats.sh_rest = one.sh_rest.repeat(count);
    splats
}

fn as_text(splats: &Splats) -> Vec<u8> {
    let binary = file(splats);
    let end = binary.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8(binary[..end].to_vec()).unwrap();
    let mut text = header.replace("binary_little_endian", "ascii");
    // Floats alone: positions, normals, colours, opacity, scales and rotation.
    for row in binary[end..].chunks_exact((17 + splats.degree.rest()) * 4) {
        let words = row.as_chunks::<4>().0.iter().map(|v| f32::from_le_bytes(*v).to_string());
        text.push_str(&words.collect::<Vec<_>>().join("\t"));
        text.push_str("\r\n");
    }
    text.into_bytes()
}

fn with_normals(mut splats: Splats) -> Splats {
    splats.geometry.normals = vec![[0.0; 3]; splats.len()];
    splats.geometry.normals[0][2] = -0.0;
    splats
}

/// Every scene by name, as a PLY; `--drop-invalid` is given.
fn plys() -> Vec<(&'static str, Vec<u8>)> {
    let mut holes = with_extras(sample(BORDERS[3] + 5000, 0));
    for border in BORDERS {
        holes.geometry.scales[border - 1][0] = f32::NAN;
        holes.geometry.scales[border][1] = f32::INFINITY;
    }
    // The remaining rows of the first of these scenes end just at a border.
    (0..7).for_each(|i| holes.geometry.positions[i][2] = f32::NAN);
    let mut only_holes = sample(3000, 1);
    only_holes.geometry.dc.iter_mut().for_each(|dc| dc[0] = f32::NAN);
    vec![
        ("none", file(&sample(0, 3))),
        ("none, no SH", file(&with_extras(sample(0, 0)))),
        ("one", file(&sample(1, 3))),
        ("one, no SH", file(&with_extras(with_normals(sample(1, 0))))),
        ("two of one", file(&copies(2, 2))),
        ("copies", file(&copies(33_000, 1))),
        ("extras and normals", file(&with_extras(with_normals(sample(2500, 1))))),
        ("text", as_text(&with_normals(sample(1500, 1)))),
        ("holes", file(&holes)),
        ("only holes", file(&only_holes)),
    ]
}

fn options(layout: Layout) -> CompressOptions {
    let mut options = CompressOptions::default();
    options.values = layout.values();
    options.atoms = Some(6);
    options.sample = 300;
    options.tolerance = Some(0.4);
    options
}

fn unpacked(bytes: &[u8]) -> Splats {
    lexi::read_bytes("t.lexi", bytes, &Limits::default()).unwrap().into_splats()
}

/// The .lexi file `bytes` decompressed and looked over in parts, as `whole`.
fn comes_out_as(name: &str, bytes: &[u8], whole: &Splats) {
    let chunks = LexiReader::open("t.lexi", bytes, &Limits::default()).unwrap();
    let mut found = Vec::new();
    let written = stream::decompress(&chunks, &mut found, &Silent).unwrap();
    assert!(found == file(whole), "{name}");
    assert_eq!(written, found.len() as u64);
    let folder = tempfile::tempdir().unwrap();
    let survey = stream::survey(&chunks, folder.path()).unwrap();
    // Ranges of extras may be NaN.
    assert_eq!(format!("{:?}", survey.lint), format!("{:?}", stats::lint(whole).unwrap()), "{name}");
}

#[test]
fn exact_layouts_give_the_bytes_of_the_whole_scene() {
    let read = ReadOptions::default().with_drop_invalid(true);
    for (name, bytes) in plys() {
        let whole = ply::read_bytes("t.ply", &bytes, &read).unwrap();
        let chunks = PlySource::open("t.ply", &bytes, &read, &Silent).unwrap();
        assert_eq!(
            (chunks.len(), chunks.warnings()),
            (whole.splats.len(), whole.warnings.as_slice()),
            "{name}"
        );
        let lint = stream::lint(&chunks, &Silent).unwrap();
        assert_eq!(format!("{lint:?}"), format!("{:?}", stats::lint(&whole.splats).unwrap()), "{name}");
        for layout in [Layout::F16, Layout::F32, Layout::Paper] {
            let (model, _) = compress(whole.splats.clone(), &options(layout), &Silent).unwrap();
            let (mut expected, mut found) = (Vec::new(), Vec::new());
            lexi::LexiWriter::exact(&model, layout.codes()).unwrap().write(&mut expected, &Silent).unwrap();
            let done =
                stream::compress(&chunks, &options(layout), layout.codes(), &mut found, &Silent).unwrap();
            assert!(found == expected, "{name}, {layout}");
            assert_eq!(
                (done.gaussians, done.record),
                (model.len(), model.record().clone()),
                "{name}, {layout}"
            );
            comes_out_as(name, &found, &model.into_splats());
        }
    }
}

#[test]
fn packing_keeps_every_gaussian_and_comes_out_as_if_read_whole() {
    let read = ReadOptions::default().with_drop_invalid(true);
    for (name, bytes) in plys() {
        let whole = ply::read_bytes("t.ply", &bytes, &read).unwrap().splats;
        let chunks = PlySource::open("t.ply", &bytes, &read, &Silent).unwrap();
        for keep_order in [false, true] {
            let mut options = PackOptions::default();
            options.keep_order = keep_order;
            options.atoms = (chunks.degree() != ShDegree::ZERO).then_some(6);
            let mut packed = Vec::new();
            let done = stream::pack(
                &chunks,
                None::<&mut dyn stream::Observer>,
                &options,
                36.0,
                &mut packed,
                &Silent,
            )
            .unwrap();
            assert_eq!(done.file_bytes(), packed.len() as u64, "{name}");
            let dense = unpacked(&packed);
            assert_eq!((dense.len(), dense.degree), (whole.len(), whole.degree), "{name}");
            assert_eq!(dense.meta, whole.meta, "{name}");
            if keep_order {
                let (a, b) = (&dense.geometry.extras, &whole.geometry.extras);
                assert_eq!(format!("{a:?}"), format!("{b:?}"), "{name}");
                let far = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).any(|k| (a[k] - b[k]).abs() > 0.2);
                let moved =
                    dense.geometry.positions.iter().zip(&whole.geometry.positions).filter(|&p| far(p));
                assert_eq!(moved.count(), 0, "{name}");
            }
            comes_out_as(name, &packed, &dense);
        }
    }
}
