//! Packed files written by released versions decode to the same bits, on every machine.
//!
//! Nothing is packed here but by hand, so a better encoder changes nothing.

use std::path::PathBuf;

use lexisplat::lexi::{LexiReader, LexiWriter};
use lexisplat::packed::{PackOptions, Packed, Packer, TargetRecord};
use lexisplat::{Extra, ExtraValues, Limits, Model, Sensitivity, ShDegree, Silent, Splats, lexi, ply};
use lexisplat_sample::{SampleOptions, scene};

const NAMES: [&str; 3] = ["packed", "packed_degree0", "packed_escapes"];

fn golden(name: &str, kind: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "tests", "golden", &format!("{name}.{kind}")].iter().collect()
}

fn opened(name: &str) -> Packed {
    let bytes = std::fs::read(golden(name, "lexi")).unwrap();
    LexiReader::open(name, bytes, &Limits::default()).unwrap().packed().unwrap().unwrap()
}

fn decoded(name: &str) -> Model {
    lexi::read(&golden(name, "lexi"), &Limits::default()).unwrap()
}

fn ply_bytes(splats: &Splats) -> Vec<u8> {
    let mut bytes = Vec::new();
    ply::write(&mut bytes, splats).unwrap();
    bytes
}

fn promise() -> TargetRecord {
    TargetRecord::new("psnr", 38.5, [38.562, 33.25], 18, false)
}

/// Makes the golden files of a new format version. Never run it to make a failing test pass.
#[test]
#[ignore = "writes tests/golden"]
fn regenerate() {
    let pack = |splats: &Splats, change: fn(&mut PackOptions)| {
        let mut options = PackOptions::default();
        change(&mut options);
        let sensitivity = Sensitivity::heuristic(&splats.geometry);
        Packer::new(splats, &sensitivity, &options).unwrap().pack(2e-5, &Silent).unwrap()
    };
    let write = |name: &str, packed: &Packed| {
        LexiWriter::packed(packed).write(&golden(name, "lexi"), &Silent).unwrap();
        let splats = packed.unpack().unwrap().into_splats();
        std::fs::write(golden(name, "ply"), ply_bytes(&splats)).unwrap();
    };

    let mut splats = scene(&SampleOptions::new(300, 1));
    splats.meta.comments.push("made by \"hand\"".to_owned());
    splats.meta.antialiased = true;
    let numbers = 0..300_u16;
    splats.geometry.extras = vec![
        Extra {
            name: "label".to_owned(),
            values: ExtraValues::U8(numbers.clone().map(|i| i.to_le_bytes()[0]).collect()),
        },
        Extra { name: "time".to_owned(), values: ExtraValues::F32(numbers.map(f32::from).collect()) },
    ];
    let (packed, _) = pack(&splats, |o| o.keep_order = true);
    write("packed", &packed.with_target(promise()));

    let splats = scene(&SampleOptions::new(40, 2)).with_degree_cut(ShDegree::ZERO);
    write("packed_degree0", &pack(&splats, |o| o.seed = 7).0);

    let mut splats = scene(&SampleOptions::new(80, 3)).with_degree_cut(ShDegree::ONE);
    for row in splats.sh_rest.chunks_exact_mut(9).step_by(32) {
        row.fill(1e6);
    }
    let (packed, report) = pack(&splats, |o| o.tolerance = Some(0.05));
    assert!(report.escapes >= 3 && report.mean_nonzeros > 1.0);
    write("packed_escapes", &packed);
}

/// Decoding adds and multiplies f32 and takes the rest from libm, so no bit may differ.
#[test]
fn golden_files_decode_bit_for_bit() {
    for name in NAMES {
        let expected = std::fs::read(golden(name, "ply")).unwrap();
        let found = ply_bytes(&decoded(name).into_splats());
        assert!(found == expected, "{name} decodes to something else: first at {:?}", {
            found.iter().zip(&expected).position(|(a, b)| a != b)
        });
    }
}

#[test]
fn golden_files_are_the_same_on_any_number_of_threads() {
    for name in NAMES {
        let bytes = std::fs::read(golden(name, "lexi")).unwrap();
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let model = pool.install(|| lexi::read_bytes(name, &bytes, &Limits::default()).unwrap());
            assert_eq!(model, decoded(name), "{name} on {threads} threads");
        }
    }
}

#[test]
fn golden_files_say_how_they_were_made() {
    let (packed, model) = (opened("packed"), decoded("packed"));
    assert_eq!((packed.len(), packed.head().degree, model.len()), (300, ShDegree::THREE, 300));
    assert_eq!(packed.head().target.as_ref(), Some(&promise()));
    assert_eq!(packed.head().meta.comments, ["lexisplat sample scene, seed 1", "made by \"hand\""]);
    assert!(
        packed.head().meta.antialiased
            && packed.order().is_some()
            && packed.head().record.tolerance.is_none()
    );
    assert_eq!(model.meta(), &packed.head().meta);
    // Back in the source's order they count up again.
    let [label, time] = model.geometry().extras.as_slice() else { panic!("two extras") };
    assert_eq!((label.name.as_str(), time.name.as_str()), ("label", "time"));
    assert_eq!(time.values, ExtraValues::F32((0..300_u16).map(f32::from).collect()));

    let (packed, model) = (opened("packed_degree0"), decoded("packed_degree0"));
    assert_eq!((packed.len(), packed.head().atoms, packed.head().record.seed), (40, 0, 7));
    assert!(packed.head().target.is_none() && packed.order().is_none() && model.dictionary().is_empty());

    let (packed, model) = (opened("packed_escapes"), decoded("packed_escapes"));
    assert_eq!((packed.len(), packed.head().degree), (80, ShDegree::ONE));
    assert_eq!((packed.head().record.tolerance, packed.head().record.over_tolerance), (Some(0.05), 0));
    assert!((0.01..=0.05).contains(&packed.head().record.max_residual));
    let escapes = model.codes().escapes();
    assert!(escapes.gaussians.len() >= 3 && model.codes().nonzeros() > 80);
    assert!(escapes.rows.chunks_exact(9).filter(|row| **row == [1e6; 9]).count() == 3);

    for name in NAMES {
        assert_eq!(decoded(name).record().pursuit, None, "{name}");
        let packed = opened(name);
        assert_eq!(&packed.unpack_dictionary().unwrap(), decoded(name).dictionary(), "{name}");
    }
}

#[test]
fn their_bytes_are_still_written() {
    for name in NAMES {
        let mut bytes = Vec::new();
        LexiWriter::packed(&opened(name)).write(&mut bytes, &Silent).unwrap();
        assert!(bytes == std::fs::read(golden(name, "lexi")).unwrap(), "{name} is written differently now");
    }
}

#[test]
fn other_readers_of_safetensors_take_them() {
    for name in NAMES {
        let bytes = std::fs::read(golden(name, "lexi")).unwrap();
        let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
        for (tensor, view) in tensors.iter() {
            let size = view.dtype().bitsize() / 8;
            let offset = view.data().as_ptr() as usize - bytes.as_ptr() as usize;
            assert!(offset.is_multiple_of(size), "{name}: {tensor} is not aligned to its entries");
        }
        assert_eq!(tensors.tensor("packed.data").unwrap().data(), opened(name).data(), "{name}");
    }
}
