//! The encoder as a whole: the promise, every degree, odd scenes, and bytes that depend on nothing but
//! the input.

use crate::common::written;
use lexisplat::lexi::{LexiReader, LexiWriter};
use lexisplat::packed::{PackOptions, Packer};
use lexisplat::ply::{self, PlySource, ReadOptions};
use lexisplat::pursuit::ValueType;
use lexisplat::{
    CodeLayout, CompressOptions, Dictionary, Error, Extra, Geometry, Layout, Limits, Model, Progress,
    Pursuit, SceneMeta, Sensitivity, ShDegree, Silent, SplatSource, Splats, compress, lexi, stream,
};
use lexisplat_testing::Random;

fn row<const W: usize>(random: &mut Random) -> [f32; W] {
    std::array::from_fn(|_| random.signed())
}

/// A scene whose SH-rest is a few common directions and noise, with norms spread over decades.
fn scene(count: usize, degree: u8, seed: u64) -> Splats {
    let degree = ShDegree::new(degree).unwrap();
    let dim = degree.rest();
    let mut random = Random::new(seed);
    let shapes: Vec<Vec<f32>> = (0..6).map(|_| (0..dim).map(|_| random.signed()).collect()).collect();
    let mut sh_rest = Vec::new();
    for i in 0..count {
        let strength = [0.0, 0.01, 0.05, 0.1, 0.2][i % 5];
        let weights: Vec<f32> = shapes.iter().map(|_| strength * random.signed()).collect();
        for d in 0..dim {
            let signal: f32 = shapes.iter().zip(&weights).map(|(s, w)| s[d] * w).sum();
            sh_rest.push(signal + 0.02 * random.signed());
        }
    }
    let geometry = Geometry {
        positions: (0..count).map(|_| row(&mut random)).collect(),
        normals: Vec::new(),
        dc: (0..count).map(|_| row(&mut random)).collect(),
        opacities: (0..count).map(|_| random.signed()).collect(),
        scales: (0..count).map(|_| row(&mut random)).collect(),
        rotations: (0..count).map(|_| row(&mut random)).collect(),
        extras: Vec::new(),
    };
    Splats { geometry, degree, sh_rest, meta: SceneMeta::default() }
}

/// Largest error of any Gaussian, in f64, on the values a decoder writes.
fn worst(original: &Splats, decoded: &Splats) -> f64 {
    let dim = original.degree.rest().max(1);
    let rows = original.sh_rest.chunks_exact(dim).zip(decoded.sh_rest.chunks_exact(dim));
    let error = |(a, b): (&[f32], &[f32])| {
        let squares = a.iter().zip(b).map(|(x, y)| (f64::from(*x) - f64::from(*y)).powi(2));
        squares.sum::<f64>().sqrt()
    };
    rows.map(error).fold(0.0, f64::max)
}

fn options(change: impl FnOnce(&mut CompressOptions)) -> CompressOptions {
    let mut options = CompressOptions::default();
    change(&mut options);
    options
}

#[test]
fn every_degree_and_layout_keeps_the_promise_and_the_geometry() {
    for degree in 0..=4 {
        for layout in [Layout::F32, Layout::F16, Layout::Paper] {
            let splats = scene(700, degree, 3);
            let options = options(|o| o.values = layout.values());
            let (model, report) = compress(splats.clone(), &options, &Silent).unwrap();
            let bytes = written(&model, layout.codes());
            let read = lexi::read_bytes("m", &bytes, &Limits::default()).unwrap();
            assert_eq!(read, model, "degree {degree} {layout}");
            let decoded = read.into_splats();
            assert_eq!(decoded.geometry, splats.geometry);
            let error = worst(&splats, &decoded);
            assert!(error <= 0.1, "degree {degree} {layout}: {error}");
            assert!(
                (error - model.record().max_residual).abs() < 1e-12,
                "{error} {}",
                model.record().max_residual
            );
            assert_eq!(model.record().over_tolerance, 0);
            assert_eq!(model.dictionary().len(), 2 * splats.degree.rest());
            if degree > 0 {
                assert!(error > 0.02, "degree {degree}: an error of {error} wastes the tolerance");
                assert!(report.mean_nonzeros < 12.0, "degree {degree}: {}", report.mean_nonzeros);
            }
            let counted: u64 = report.nonzero_histogram.iter().sum();
            assert_eq!(counted + report.escapes, 700);
        }
    }
}

#[test]
fn threads_do_not_change_the_bytes() {
    // More Gaussians than one chunk, so that there is something to share out.
    let splats = scene(9000, 2, 4);
    let bytes = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let options = options(|o| o.seed = seed);
        written(&pool.install(|| compress(splats.clone(), &options, &Silent)).unwrap().0, CodeLayout::Compact)
    };
    let one = bytes(1, 0);
    for threads in [2, 5] {
        assert!(bytes(threads, 0) == one, "{threads} threads");
    }
    assert!(bytes(1, 1) != one, "the seed must matter");
}

#[test]
fn learning_beats_the_first_guess_and_generalises() {
    let splats = scene(6000, 3, 5);
    let unlearned = {
        let axes: Vec<f32> = (0..45 * 45).map(|i| if i % 46 == 0 { 1.0 } else { 0.0 }).collect();
        let options = options(|o| o.dictionary = Some(Dictionary::new(ShDegree::THREE, axes).unwrap()));
        compress(splats.clone(), &options, &Silent).unwrap().1.mean_nonzeros
    };
    let (_, report) = compress(splats, &CompressOptions::default(), &Silent).unwrap();
    let learned = report.learned.unwrap();
    assert!(report.mean_nonzeros < 0.3 * unlearned, "{} {unlearned}", report.mean_nonzeros);
    assert!((learned.held_out_nonzeros - report.mean_nonzeros).abs() < 0.6, "{learned:?}");
}

#[test]
fn ols_needs_no_more_than_omp() {
    let splats = scene(4000, 3, 6);
    let mean = |pursuit| {
        let options = options(|o| o.pursuit = pursuit);
        compress(splats.clone(), &options, &Silent).unwrap().1.mean_nonzeros
    };
    assert!(mean(Pursuit::Ols) <= mean(Pursuit::Omp));
}

#[test]
fn a_cap_lifts_the_promise_and_is_counted() {
    let splats = scene(500, 3, 7);
    let options = options(|o| o.max_nonzeros = Some(1));
    let (model, report) = compress(splats.clone(), &options, &Silent).unwrap();
    assert!(model.codes().counts().iter().all(|&c| c <= 1));
    let decoded = model.clone().into_splats();
    let over = (0..splats.len()).filter(|&i| {
        let squares = splats.rest(i).iter().zip(decoded.rest(i)).map(|(x, y)| f64::from(x - y).powi(2));
        squares.sum::<f64>().sqrt() > 0.1
    });
    assert_eq!(over.count() as u64, model.record().over_tolerance);
    assert!(model.record().over_tolerance > 0 && report.escapes == 0);
    let mut only_cap = options;
    only_cap.tolerance = None;
    let (model, _) = compress(splats, &only_cap, &Silent).unwrap();
    assert_eq!((model.record().tolerance, model.record().over_tolerance), (None, 0));
}

#[test]
fn odd_scenes_have_results() {
    for count in [0, 1, 2, 9] {
        let splats = scene(count, 3, 8);
        let (model, _) = compress(splats.clone(), &CompressOptions::default(), &Silent).unwrap();
        assert_eq!(
            lexi::read_bytes("m", &written(&model, CodeLayout::Compact), &Limits::default()).unwrap(),
            model,
            "{count}"
        );
        assert!(worst(&splats, &model.into_splats()) <= 0.1);
    }
    let mut flat = scene(300, 3, 9);
    flat.sh_rest.fill(0.0);
    let (model, report) = compress(flat, &CompressOptions::default(), &Silent).unwrap();
    assert_eq!((model.codes().nonzeros(), report.mean_nonzeros, report.coefficient_ratio()), (0, 0.0, None));

    let mut huge = scene(300, 3, 10);
    huge.sh_rest[..45].fill(1e7);
    huge.sh_rest[45..90].fill(f32::MAX);
    let (model, report) = compress(huge.clone(), &CompressOptions::default(), &Silent).unwrap();
    assert_eq!((report.escapes, &model.codes().escapes().gaussians[..]), (2, &[0, 1][..]));
    let decoded = lexi::read_bytes("m", &written(&model, CodeLayout::Compact), &Limits::default())
        .unwrap()
        .into_splats();
    assert_eq!(decoded.rest(1), huge.rest(1), "an escape is exact");
    assert!(worst(&huge, &decoded) <= 0.1);

    let same = {
        let mut splats = scene(200, 3, 11);
        let row = splats.rest(4).to_vec();
        splats.sh_rest = row.repeat(200);
        splats
    };
    let (model, _) = compress(same, &CompressOptions::default(), &Silent).unwrap();
    assert!(model.codes().counts().iter().all(|&c| c == 1), "one atom is the vector itself");
}

#[test]
fn any_number_of_atoms_works() {
    let splats = scene(1200, 1, 12);
    for atoms in [1, 2, 9, 255, 256, 257, 1024] {
        let options = options(|o| o.atoms = Some(atoms));
        let (model, report) = compress(splats.clone(), &options, &Silent).unwrap();
        assert_eq!(model.dictionary().len(), atoms);
        assert_eq!(
            lexi::read_bytes("m", &written(&model, CodeLayout::Compact), &Limits::default()).unwrap(),
            model,
            "{atoms}"
        );
        assert!(worst(&splats, &model.into_splats()) <= 0.1, "{atoms} atoms");
        assert!(report.escapes == 0 || atoms < 9);
    }
}

#[test]
fn wrong_options_are_named() {
    let run = |change: fn(&mut CompressOptions)| {
        let error = compress(scene(20, 3, 13), &options(change), &Silent).unwrap_err();
        assert!(matches!(error, Error::Parameter { .. }), "{error}");
        error.to_string()
    };
    assert!(run(|o| o.tolerance = Some(0.0)).starts_with("tolerance = 0"));
    assert!(run(|o| o.tolerance = Some(f64::NAN)).starts_with("tolerance = NaN"));
    assert!(run(|o| o.tolerance = None).starts_with("tolerance = none"));
    assert!(run(|o| o.atoms = Some(0)).starts_with("atoms = 0"));
    assert!(run(|o| o.atoms = Some(1025)).contains("1 to 1024"));
    assert!(run(|o| o.dictionary = Some(Dictionary::empty())).contains("degree 3"));
    let mut broken = scene(20, 3, 14);
    broken.sh_rest[100] = f32::NAN;
    assert!(compress(broken, &CompressOptions::default(), &Silent).is_err());
}

/// A file of such a scene could be written, but no reader would take it.
#[test]
fn values_that_are_not_finite_are_named() {
    type Change = fn(&mut Splats, f32);
    let changes: [(&str, Change); 7] = [
        ("positions", |s, v| s.geometry.positions[7][1] = v),
        ("normals", |s, v| s.geometry.normals = vec![[0.0, v, 0.0]; 20]),
        ("dc", |s, v| s.geometry.dc[7][2] = v),
        ("opacities", |s, v| s.geometry.opacities[7] = v),
        ("scales", |s, v| s.geometry.scales[7][0] = v),
        ("rotations", |s, v| s.geometry.rotations[7][3] = v),
        ("sh_rest", |s, v| s.sh_rest[100] = v),
    ];
    for (name, change) in changes {
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut splats = scene(20, 3, 15);
            change(&mut splats, value);
            let error = compress(splats, &CompressOptions::default(), &Silent).unwrap_err();
            let Error::Parameter { name: found, .. } = error else { panic!("{error}") };
            // Learning, which may see the rows first, calls them signals.
            assert!(found == name || (name, found) == ("sh_rest", "signals"), "{name}: {found}");
        }
    }
}

/// Values of either type fit either layout of codes, and mean the same.
#[test]
fn no_layout_is_refused() {
    let splats = scene(500, 3, 16);
    for values in [ValueType::F16, ValueType::F32] {
        let (model, _) = compress(splats.clone(), &options(|o| o.values = values), &Silent).unwrap();
        for codes in [CodeLayout::Compact, CodeLayout::Paper] {
            let bytes = written(&model, codes);
            let read = lexi::read_bytes("m", &bytes, &Limits::default()).unwrap();
            assert_eq!(
                (read.clone().into_splats(), read.record()),
                (model.clone().into_splats(), model.record())
            );
        }
    }
}

#[test]
fn parts_that_do_not_fit_make_no_model() {
    let (model, _) = compress(scene(50, 1, 17), &options(|o| o.atoms = Some(4)), &Silent).unwrap();
    let (geometry, meta, dictionary, codes, record) = model.into_parts();
    let refused = |geometry: Geometry, dictionary: Dictionary| {
        let made = Model::new(geometry, meta.clone(), dictionary, codes.clone(), record.clone());
        made.unwrap_err().to_string()
    };
    let mut shorter = geometry.clone();
    shorter.opacities.pop();
    assert!(refused(shorter, dictionary.clone()).starts_with("opacities = 49"));
    assert!(refused(Geometry::default(), dictionary.clone()).starts_with("codes = 50"));
    let fewer = Dictionary::new(ShDegree::ONE, dictionary.as_slice()[..27].to_vec()).unwrap();
    assert!(refused(geometry.clone(), fewer).starts_with("dictionary = 3 atoms"));
    assert!(refused(geometry, Dictionary::empty()).starts_with("dictionary = 0 atoms"));
}

/// Progress that cancels at once.
struct Cancelled;

impl Progress for Cancelled {
    fn is_cancelled(&self) -> bool {
        true
    }
}

#[test]
fn cancelled_work_ends() {
    let splats = scene(3000, 1, 18);
    let error = compress(splats.clone(), &CompressOptions::default(), &Cancelled).unwrap_err();
    assert!(matches!(error, Error::Cancelled), "{error}");
    let sensitivity = Sensitivity::guess(&splats.geometry);
    let packer = Packer::new(splats.clone(), &sensitivity, &PackOptions::default()).unwrap();
    let error = packer.pack(1e-4, &Cancelled).unwrap_err();
    assert!(matches!(error, Error::Cancelled), "{error}");
    let mut bytes = Vec::new();
    let options = CompressOptions::default();
    let error = stream::compress(&splats, &options, CodeLayout::Compact, &mut bytes, &Cancelled).unwrap_err();
    assert!(matches!(error, Error::Cancelled) && bytes.is_empty(), "{error}");
}

/// A scene in memory and a .lexi file are sources as a PLY is.
#[test]
fn sources_of_every_kind_give_the_same_bytes() {
    let mut splats = scene(3000, 2, 19);
    splats.geometry.extras =
        vec![Extra { name: "n".into(), values: (0..3000_u32).collect::<Vec<_>>().into() }];
    let options = options(|o| (o.atoms, o.sample) = (Some(9), 300));
    let compressed = |source: &dyn SplatSource| {
        let mut bytes = Vec::new();
        stream::compress(source, &options, CodeLayout::Compact, &mut bytes, &Silent).unwrap();
        bytes
    };
    let mut ply = Vec::new();
    ply::write(&mut ply, &splats).unwrap();
    let ply = PlySource::open("t.ply", &ply, &ReadOptions::default(), &Silent).unwrap();
    let bytes = compressed(&splats);
    assert!(bytes == compressed(&ply));
    // A .lexi file gives the scene that it decodes to, whether exact or packed.
    let sensitivity = Sensitivity::guess(&splats.geometry);
    let packer = Packer::new(&splats, &sensitivity, &PackOptions::default()).unwrap();
    let mut packed = Vec::new();
    LexiWriter::packed(&packer.pack(1e-4, &Silent).unwrap().0).write(&mut packed, &Silent).unwrap();
    for bytes in [bytes, packed] {
        let reader = LexiReader::open("t.lexi", &bytes, &Limits::default()).unwrap();
        let decoded = reader.model().unwrap().into_splats();
        assert!(compressed(&reader) == compressed(&decoded));
        let mut part = reader.empty();
        reader.read(700..2100, &mut part).unwrap();
        assert_eq!(part.geometry.positions, decoded.geometry.positions[700..2100]);
        assert_eq!(part.geometry.extras[0].values.len(), 1400);
        assert!(reader.read(2900..3001, &mut part).is_err());
    }
}
