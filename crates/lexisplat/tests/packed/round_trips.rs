//! Pack, write, read, unpack: the same every way, whatever the degree and the number of Gaussians.

use lexisplat::lexi::{LexiReader, LexiWriter};
use lexisplat::packed::{PackOptions, Packed, ReachedRecord, TargetRecord};
use lexisplat::{Input, Layout, Limits, Offset, Silent, Splats, lexi};

use super::support::{STEP, bytes, options, pack, row_errors, sample, with_extras};

/// Every way to read `packed` gives it back.
fn assert_travels(packed: &Packed, what: &str) {
    let bytes = bytes(packed);
    let reader = LexiReader::open("p.lexi", &bytes, &Limits::default()).unwrap();
    assert_eq!(reader.packed().unwrap().as_ref(), Some(packed), "{what}");
    assert_eq!(reader.layout(), Layout::Packed, "{what}");
    let model = lexi::read_bytes("p.lexi", &bytes, &Limits::default()).unwrap();
    assert_eq!(model, packed.unpack().unwrap(), "{what}");
    assert_eq!((model.len(), model.degree()), (packed.len(), packed.head().degree), "{what}");
    assert_eq!((model.meta(), model.record()), (&packed.head().meta, &packed.head().record), "{what}");
    assert_eq!(&packed.unpack_dictionary().unwrap(), model.dictionary(), "{what}");
    let writer = LexiWriter::packed(packed);
    assert_eq!(writer.file_bytes(), bytes.len() as u64, "{what}");
    assert_eq!(writer.tensor_bytes(), reader.tensor_bytes(), "{what}");
}

#[test]
fn every_degree_travels() {
    for degree in 0..=4 {
        for tolerance in [None, Some(0.1)] {
            let splats = with_extras(sample(200, 1, degree));
            let (packed, report) = pack(&splats, STEP, &options(|o| o.tolerance = tolerance));
            assert_travels(&packed, &format!("degree {degree}, {tolerance:?}"));
            assert_eq!(packed.head().degree.get(), degree);
            assert_eq!(packed.head().atoms == 0, degree == 0);
            let counted: u64 = report.nonzero_histogram.iter().sum();
            assert_eq!(counted + report.escapes, if degree == 0 { 0 } else { 200 });
        }
    }
}

#[test]
fn a_file_holds_comments_marks_and_promise() {
    let mut splats = with_extras(sample(90, 2, 1));
    splats.meta.comments = vec!["made by \"hand\"".to_owned(), String::new(), "größer".to_owned()];
    splats.meta.antialiased = true;
    splats.meta.offset = Offset::new([500_000.25, -4_649_776.0, 0.0]).unwrap();
    let (packed, _) = pack(&splats, STEP, &options(|o| o.keep_order = true));
    let packed = packed.with_target(TargetRecord::new("min-psnr", 38.5, [41.127, 38.507], 18, true));
    let packed = packed.with_reached(ReachedRecord::new([39.25, 41.127, 38.507], 18, true));
    assert_travels(&packed, "everything");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.lexi");
    let written = LexiWriter::packed(&packed).write(&path, &Silent).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), bytes(&packed));
    assert_eq!(written, bytes(&packed).len() as u64);
    let owned = Input::open(&path).unwrap();
    let reader: LexiReader<'static> = LexiReader::open("p.lexi", owned, &Limits::default()).unwrap();
    let head = reader.packed_head().unwrap();
    assert_eq!((&head.meta, head.target.as_ref()), (&splats.meta, packed.head().target.as_ref()));
    assert_eq!(head.reached, packed.head().reached);
    assert_eq!(lexi::read(&path, &Limits::default()).unwrap().meta(), &splats.meta);
}

#[test]
fn hardly_any_gaussians_travel() {
    for count in [0, 1, 2, 3] {
        for degree in [0, 1, 3] {
            for tolerance in [None, Some(0.01)] {
                let what = format!("{count} of degree {degree}, {tolerance:?}");
                let splats = with_extras(sample(count, 3, degree));
                let options = options(|o| {
                    o.keep_order = true;
                    o.tolerance = tolerance;
                });
                let (packed, _) = pack(&splats, STEP, &options);
                assert_travels(&packed, &what);
                let back = packed.unpack().unwrap().into_splats();
                assert_eq!((back.len(), &back.geometry.extras), (count, &splats.geometry.extras), "{what}");
                assert!(row_errors(&splats, &back).iter().all(|&e| e < 0.01), "{what}");
            }
        }
    }
}

/// More than a chunk: the second one is decoded without the first, and order and extras run through both.
#[test]
fn more_than_a_chunk_travels() {
    let splats = with_extras(sample(40_000, 4, 1));
    let (packed, _) = pack(&splats, STEP, &options(|o| o.keep_order = true));
    let reader = LexiReader::open("p.lexi", bytes(&packed), &Limits::default()).unwrap();
    assert!(reader.outline().unwrap().chunks.len() > 1);
    assert_travels(&packed, "two chunks");
    let back = packed.unpack().unwrap().into_splats();
    assert_eq!(back.geometry.extras, splats.geometry.extras);
    let worst = row_errors(&splats, &back).into_iter().fold(0.0, f64::max);
    let written = packed.head().record.max_residual;
    assert!(worst <= written && written <= worst * 1.0002, "{worst} {written}");
}

fn packed_on(threads: usize, splats: &Splats, options: &PackOptions) -> Vec<u8> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| bytes(&pack(splats, STEP, options).0))
}

#[test]
fn threads_change_neither_bytes_nor_scenes() {
    // Two chunks for the walk, many for the codes.
    let splats = sample(33_500, 5, 1);
    let options = options(|o| o.tolerance = Some(0.1));
    let one = packed_on(1, &splats, &options);
    assert!(packed_on(1, &splats, &options) == one, "the second time");
    for threads in [2, 7] {
        assert!(packed_on(threads, &splats, &options) == one, "{threads} threads");
    }
    let read_on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| lexi::read_bytes("p.lexi", &one, &Limits::default()).unwrap())
    };
    assert_eq!(read_on(1), read_on(7));
}

#[test]
fn another_seed_is_another_file_of_the_same_scene() {
    let splats = sample(400, 6, 3);
    let make = |seed| pack(&splats, STEP, &options(|o| o.seed = seed)).0;
    let (one, other) = (make(1), make(2));
    assert_travels(&other, "seed 2");
    assert_ne!(one.data(), other.data(), "the seed decides what is learned from");
    let geometry = |packed: &Packed| packed.unpack().unwrap().geometry().clone();
    assert_eq!(geometry(&one), geometry(&other), "and nothing else");
}

#[test]
fn streams_sum_to_the_data() {
    for (count, degree) in [(0, 3), (1, 3), (1200, 3), (900, 0), (9000, 1)] {
        let (packed, _) = pack(&sample(count, 7, degree), STEP, &PackOptions::default());
        let streams = packed.stream_bits().unwrap();
        assert_eq!(streams.len(), 30);
        assert!(streams.iter().all(|s| s.bits >= 0.0));
        // The stream of the dictionary is in the head.
        let sum: f64 = streams.iter().filter(|s| s.name != "Dictionary").map(|s| s.bits).sum();
        let data = packed.data().len() as f64 * 8.0;
        // Every lane of a range has a state and a length of 32 bits. A chunk has a lane for each 1024 Gaussians and at most
        // six ranges, and there are two chunks at most.
        let lanes = 6 * (packed.len() / 1024 + 2);
        // A step of the coder rounds a state of 16 bits or more down to a multiple of a share of up to 12 bits.
        let most = 1.001 * sum + (64 * lanes) as f64;
        assert!((sum..=most).contains(&data), "{count}: {sum} bits, {data} written");
    }
}
