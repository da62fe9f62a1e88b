//! Streams give what whole scenes give, from and to files, on any number of threads.

use std::path::Path;

use lexisplat::lexi::LexiReader;
use lexisplat::packed::{PackOptions, Packer};
use lexisplat::ply::{PlySource, ReadOptions};
use lexisplat::{
    CodeLayout, CompressOptions, Error, Extra, ExtraValues, Input, Layout, Limits, Sensitivity, Silent,
    SplatSource, Splats, compress, lexi, ply, stats, stream,
};
use lexisplat_sample::{SampleOptions, scene};

/// More than two chunks of every kind, with a normal and an extra.
const GAUSSIANS: usize = 2 * 65_536 + 333;

fn splats(count: usize) -> Splats {
    let mut splats = scene(&SampleOptions::new(count, 5));
    splats.geometry.normals = vec![[0.0; 3]; count];
    splats.geometry.normals[count / 2][1] = -0.0;
    let values = ExtraValues::U16((0..count).map(|i| u16::try_from(i % 65_536).unwrap()).collect());
    splats.geometry.extras = vec![Extra { name: "label".into(), values }];
    splats
}

fn options(layout: Layout) -> CompressOptions {
    let mut options = CompressOptions::default();
    options.values = layout.values();
    options.atoms = Some(16);
    options.sample = 400;
    // Short codes: learning and coding are not what is tested.
    options.tolerance = Some(0.4);
    options
}

fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

fn files(folder: &Path) -> usize {
    std::fs::read_dir(folder).unwrap().count()
}

#[test]
fn an_exact_file_made_and_undone_part_by_part_is_that_of_the_whole_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let whole = splats(GAUSSIANS);
    ply::write(&path("in.ply"), &whole).unwrap();
    let bytes = Input::open(&path("in.ply")).unwrap();
    let chunks = PlySource::open("in.ply", &bytes, &ReadOptions::default(), &Silent).unwrap();
    assert_eq!(chunks.len(), GAUSSIANS);
    let (model, _) = compress(whole.clone(), &options(Layout::F16), &Silent).unwrap();
    let mut expected = Vec::new();
    lexi::write(&mut expected, &model).unwrap();
    for threads in [1, 3] {
        let done = on_threads(threads, || {
            stream::compress(&chunks, &options(Layout::F16), CodeLayout::Compact, &path("out.lexi"), &Silent)
                .unwrap()
        });
        assert!(std::fs::read(path("out.lexi")).unwrap() == expected, "{threads} threads");
        assert_eq!(&done.record, model.record());
        assert_eq!(
            done.tensor_bytes,
            lexi::LexiWriter::exact(&model, CodeLayout::Compact).unwrap().tensor_bytes()
        );
    }
    let bytes = Input::open(&path("out.lexi")).unwrap();
    let chunks = LexiReader::open("out.lexi", &bytes, &Limits::default()).unwrap();
    let mut expected = Vec::new();
    ply::write(&mut expected, &model.clone().into_splats()).unwrap();
    let written = stream::decompress(&chunks, &path("back.ply"), &Silent).unwrap();
    assert_eq!(written, expected.len() as u64);
    assert!(std::fs::read(path("back.ply")).unwrap() == expected);
    let survey = stream::survey(&chunks, folder.path()).unwrap();
    assert_eq!(survey.lint, stats::lint(&model.clone().into_splats()).unwrap());
    assert_eq!(survey.nonzeros, model.codes().nonzeros() as u64);
    assert_eq!(survey.resident_sh_bytes, model.resident_sh_bytes() as u64);
    assert_eq!(survey.nonzero_histogram.iter().sum::<u64>() + survey.escapes, GAUSSIANS as u64);
    assert_eq!(survey.atom_usage.iter().sum::<u64>(), survey.nonzeros);
    assert_eq!(
        chunks.tensor_bytes(),
        lexi::LexiWriter::exact(&model, CodeLayout::Compact).unwrap().tensor_bytes()
    );
    assert_eq!(files(folder.path()), 3);
}

#[test]
fn escapes_and_pointers_are_found_in_every_part() {
    let mut whole = splats(GAUSSIANS).with_degree_cut(lexisplat::ShDegree::new(1).unwrap());
    for i in [0, 9, 65_535, 65_536, 100_000, GAUSSIANS - 1] {
        whole.sh_rest[9 * i] = 1e20;
    }
    for layout in [Layout::F32, Layout::Paper] {
        let (model, report) = compress(whole.clone(), &options(layout), &Silent).unwrap();
        assert_eq!(report.escapes, 6);
        let (mut bytes, mut expected, mut found) = (Vec::new(), Vec::new(), Vec::new());
        lexi::LexiWriter::exact(&model, layout.codes()).unwrap().write(&mut bytes, &Silent).unwrap();
        ply::write(&mut expected, &model.into_splats()).unwrap();
        let chunks = LexiReader::open("t.lexi", &bytes, &Limits::default()).unwrap();
        assert_eq!(stream::decompress(&chunks, &mut found, &Silent).unwrap(), expected.len() as u64);
        assert!(found == expected, "{layout}");
    }
}

#[test]
fn a_packed_file_in_either_order_comes_out_as_if_read_whole() {
    let whole = splats(40_000).with_degree_cut(lexisplat::ShDegree::new(2).unwrap());
    let sensitivity = Sensitivity::guess(&whole.geometry);
    let folder = tempfile::tempdir().unwrap();
    for keep_order in [false, true] {
        let mut options = PackOptions::default();
        (options.keep_order, options.atoms) = (keep_order, Some(24));
        let packer = Packer::new(&whole, &sensitivity, &options).unwrap();
        let (packed, _) = packer.pack(packer.step_for(30.0), &Silent).unwrap();
        let mut bytes = Vec::new();
        lexi::LexiWriter::packed(&packed).write(&mut bytes, &Silent).unwrap();
        let model = lexi::read_bytes("t.lexi", &bytes, &Limits::default()).unwrap();
        let chunks = LexiReader::open("t.lexi", &bytes, &Limits::default()).unwrap();
        assert_eq!(chunks.order_kept(), keep_order);
        assert_eq!(chunks.tensor_bytes(), lexi::LexiWriter::packed(&packed).tensor_bytes());
        let (mut expected, mut found) = (Vec::new(), Vec::new());
        ply::write(&mut expected, &model.clone().into_splats()).unwrap();
        stream::decompress(&chunks, &mut found, &Silent).unwrap();
        assert!(found == expected, "{keep_order}");
        let survey = stream::survey(&chunks, folder.path()).unwrap();
        assert_eq!(survey.lint, stats::lint(&model.clone().into_splats()).unwrap());
        assert_eq!(survey.stream_bits, packed.stream_bits().unwrap());
        assert_eq!(survey.resident_sh_bytes, model.resident_sh_bytes() as u64);
        assert_eq!(files(folder.path()), 0);
    }
}

#[test]
fn no_ply_is_left_half_made_of_a_scene_with_two_properties_of_a_name() {
    let mut whole = splats(500);
    whole.geometry.extras[0].name = "nx".into();
    let (model, _) = compress(whole, &options(Layout::F16), &Silent).unwrap();
    let mut bytes = Vec::new();
    lexi::write(&mut bytes, &model).unwrap();
    let chunks = LexiReader::open("t.lexi", &bytes, &Limits::default()).unwrap();
    assert!(chunks.has_normals());
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.ply");
    let error = stream::decompress(&chunks, &output, &Silent).unwrap_err().to_string();
    assert!(error.contains("nx"), "{error}");
    assert_eq!(ply::write(&output, &model.into_splats()).unwrap_err().to_string(), error);
    assert_eq!(files(folder.path()), 0);
}

#[test]
fn a_ply_is_refused_left_out_and_looked_over_as_when_read_whole() {
    let mut whole = splats(70_000);
    for i in [3, 65_535, 65_536, 69_999] {
        whole.geometry.scales[i][2] = f32::INFINITY;
    }
    let mut bytes = Vec::new();
    ply::write(&mut bytes, &whole).unwrap();
    let strict = ReadOptions::default();
    let expected = ply::read_bytes("t.ply", &bytes, &strict).unwrap_err();
    let found = PlySource::open("t.ply", &bytes, &strict, &Silent).unwrap_err();
    assert_eq!(found.to_string(), expected.to_string());
    assert!(found.to_string().contains("4 Gaussians"), "{found}");
    let lenient = strict.with_drop_invalid(true);
    let read = ply::read_bytes("t.ply", &bytes, &lenient).unwrap();
    let chunks = PlySource::open("t.ply", &bytes, &lenient, &Silent).unwrap();
    assert_eq!((chunks.warnings(), chunks.summary()), (read.warnings.as_slice(), &read.summary));
    assert_eq!(stream::lint(&chunks, &Silent).unwrap(), stats::lint(&read.splats).unwrap());
    let mut part = chunks.empty();
    let mut start = 0;
    // Parts of every length, borders at rows left out among them.
    for length in [1, 2, 1, 40_000, 25_528, 1, 3, 4459, 0, 1] {
        chunks.read(start..start + length, &mut part).unwrap();
        let range = start..start + length;
        assert_eq!(part.geometry.positions, read.splats.geometry.positions[range.clone()]);
        assert_eq!(part.sh_rest, read.splats.sh_rest[45 * range.start..45 * range.end]);
        assert_eq!(part.geometry.normals.len(), length);
        start = range.end;
    }
    assert_eq!(start, chunks.len());
}

#[test]
fn ascii_rows_are_found_at_any_place() {
    let whole = scene(&SampleOptions::new(2500, 1)).with_degree_cut(lexisplat::ShDegree::new(1).unwrap());
    let mut binary = Vec::new();
    ply::write(&mut binary, &whole).unwrap();
    let end = binary.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let mut ascii =
        String::from_utf8(binary[..end].to_vec()).unwrap().replace("binary_little_endian", "ascii");
    for row in binary[end..].chunks_exact(26 * 4) {
        let words = row.as_chunks::<4>().0.iter().map(|v| f32::from_le_bytes(*v).to_string());
        ascii.push_str(&words.collect::<Vec<_>>().join(" "));
        ascii.push('\n');
    }
    let chunks = PlySource::open("t.ply", ascii.as_bytes(), &ReadOptions::default(), &Silent).unwrap();
    let mut part = chunks.empty();
    for range in [0..2500, 1023..1025, 1500..2049, 2499..2500] {
        chunks.read(range.clone(), &mut part).unwrap();
        assert_eq!(part.geometry.positions, whole.geometry.positions[range]);
    }
    let (mut from_ascii, mut from_binary) = (Vec::new(), Vec::new());
    stream::compress(&chunks, &options(Layout::F16), CodeLayout::Compact, &mut from_ascii, &Silent).unwrap();
    let chunks = PlySource::open("t.ply", &binary, &ReadOptions::default(), &Silent).unwrap();
    stream::compress(&chunks, &options(Layout::F16), CodeLayout::Compact, &mut from_binary, &Silent).unwrap();
    assert!(from_ascii == from_binary);
}

#[test]
fn a_damaged_file_leaves_no_output_behind() {
    let whole = scene(&SampleOptions::new(3000, 1));
    let (model, _) = compress(whole, &options(Layout::F16), &Silent).unwrap();
    let mut bytes = Vec::new();
    lexi::write(&mut bytes, &model).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    let expected = lexi::read_bytes("t.lexi", &bytes, &Limits::default()).unwrap_err().to_string();
    let found = LexiReader::open("t.lexi", &bytes, &Limits::default()).unwrap_err();
    assert_eq!(found.to_string(), expected);
    assert!(matches!(found, Error::Format { .. }));
}
