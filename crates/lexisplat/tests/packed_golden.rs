//! Packed files decode to the same bits, on every machine.
//!
//! Nothing is packed here but by hand, so a better encoder changes nothing.

use std::path::PathBuf;

use lexisplat::lexi::{LexiReader, LexiWriter};
use lexisplat::packed::{PackOptions, Packed, Packer, TargetRecord};
use lexisplat::{Extra, ExtraValues, Limits, Model, Sensitivity, ShDegree, Silent, Splats, lexi, ply};
use lexisplat_sample::{SampleOptions, scene};

/// Of each there is what it decodes to.
const NAMES: [&str; 4] = ["packed3", "packed3_degree0", "packed3_escapes", LAYERS.0];
/// The name of a file of two layers, and the CRC-32 of the PLY that its first tenths decode to, from 2 to 10 of them.
const LAYERS: (&str, [u32; 9]) = (
    "packed3_layers",
    [3476501158, 3476501158, 3476501158, 3476501158, 3476501158, 4030427560, 659720978, 3148367324, 28826881],
);

/// Number of tenths of the file of two layers whose scene is a golden file too.
const SHOWN_TENTHS: usize = 8;

fn golden(name: &str, kind: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "tests", "golden", &format!("{name}.{kind}")].iter().collect()
}

fn opened(name: &str) -> Packed {
    let bytes = std::fs::read(golden(name, "lexi")).unwrap();
    LexiReader::open(name, bytes, &Limits::default()).unwrap().packed().unwrap().unwrap()
}

fn decoded(name: &str) -> Model {
    lexi::read(golden(name, "lexi"), &Limits::default()).unwrap()
}

fn ply_bytes(splats: &Splats) -> Vec<u8> {
    let mut bytes = Vec::new();
    ply::write(&mut bytes, splats).unwrap();
    bytes
}

fn target() -> TargetRecord {
    TargetRecord::new("psnr", 38.5, [38.562, 33.25], 18, false)
}

/// Makes the golden files of the newest format version. Never run it to make a failing test pass.
#[test]
#[ignore = "writes tests/golden"]
fn regenerate() {
    let pack = |splats: &Splats, change: fn(&mut PackOptions)| {
        let mut options = PackOptions::default();
        change(&mut options);
        let sensitivity = Sensitivity::guess(&splats.geometry);
        Packer::new(splats, &sensitivity, &options).unwrap().pack(2e-5, &Silent).unwrap()
    };
    let write = |name: &str, packed: &Packed| {
        LexiWriter::packed(packed).write(&golden(name, "lexi"), &Silent).unwrap();
        let splats = packed.unpack().unwrap().into_splats();
        std::fs::write(golden(name, "ply"), ply_bytes(&splats)).unwrap();
    };

    let mut splats = scene(&SampleOptions::new(300, 1));
    let numbers = 0..300_u16;
    splats.meta.comments.push("made by \"hand\"".to_owned());
    splats.meta.antialiased = true;
    splats.geometry.extras = vec![
        Extra {
            name: "label".to_owned(),
            values: ExtraValues::U8(numbers.clone().map(|i| i.to_le_bytes()[0]).collect()),
        },
        Extra { name: "time".to_owned(), values: ExtraValues::F32(numbers.map(f32::from).collect()) },
        Extra { name: "one".to_owned(), values: ExtraValues::F64(vec![1.0; 300]) },
    ];
    let (packed, _) = pack(&splats, |o| o.keep_order = true);
    write("packed3", &packed.with_target(target()));

    let splats = scene(&SampleOptions::new(40, 2)).with_degree_cut(ShDegree::ZERO);
    write("packed3_degree0", &pack(&splats, |o| o.seed = 7).0);

    let mut splats = scene(&SampleOptions::new(80, 3)).with_degree_cut(ShDegree::ONE);
    for row in splats.sh_rest.chunks_exact_mut(9).step_by(32) {
        row.fill(1e6);
    }
    let (packed, report) = pack(&splats, |o| o.tolerance = Some(0.05));
    assert!(report.escapes >= 3 && report.mean_nonzeros > 1.0);
    write("packed3_escapes", &packed);

    let splats = scene(&SampleOptions::new(2600, 4)).with_degree_cut(ShDegree::ONE);
    let (packed, _) = pack(&splats, |o| {
        o.layers_from = 1000;
        o.atoms = Some(260);
        o.points_of_view = vec![[6.0, 0.0, 1.0], [-2.0, 5.0, 1.0], [-2.0, -5.0, 2.0]];
    });
    write(LAYERS.0, &packed);
    std::fs::write(golden(LAYERS.0, "first.ply"), first_part(&packed, SHOWN_TENTHS)).unwrap();
    println!("{:?}", checksums_of_first_parts(&packed));
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
    let (packed, model) = (opened("packed3"), decoded("packed3"));
    assert_eq!((packed.len(), packed.head().degree, model.len()), (300, ShDegree::THREE, 300));
    assert_eq!(packed.head().target.as_ref(), Some(&target()));
    assert_eq!(packed.head().meta.comments, ["lexisplat sample scene, seed 1", "made by \"hand\""]);
    assert!(
        packed.head().meta.antialiased
            && packed.order().is_some()
            && packed.head().record.tolerance.is_none()
    );
    assert_eq!(model.meta(), &packed.head().meta);
    // Back in the source's order they count up again.
    let [label, time, one] = model.geometry().extras.as_slice() else { panic!("three extras") };
    assert_eq!([label, time, one].map(|extra| extra.name.as_str()), ["label", "time", "one"]);
    assert_eq!(time.values, ExtraValues::F32((0..300_u16).map(f32::from).collect()));
    assert_eq!(one.values, ExtraValues::F64(vec![1.0; 300]));

    let (packed, model) = (opened("packed3_degree0"), decoded("packed3_degree0"));
    assert_eq!((packed.len(), packed.head().atoms, packed.head().record.seed), (40, 0, 7));
    let head = packed.head();
    assert!(head.target.is_none() && packed.order().is_none() && model.dictionary().is_empty());

    let (packed, model) = (opened("packed3_escapes"), decoded("packed3_escapes"));
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

/// The PLY that the first `tenths` of a file decode to.
fn first_part(packed: &Packed, tenths: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    LexiWriter::packed(packed).write(&mut bytes, &Silent).unwrap();
    bytes.truncate(bytes.len() * tenths / 10);
    let reader = LexiReader::open_first("first", bytes, &Limits::default()).unwrap();
    ply_bytes(&reader.model().unwrap().into_splats())
}

/// CRC-32 of the PLYs that the first tenths of a file decode to, from 2 to 10 of them.
fn checksums_of_first_parts(packed: &Packed) -> [u32; 9] {
    std::array::from_fn(|tenths| crc32fast::hash(&first_part(packed, tenths + 2)))
}

#[test]
fn first_parts_of_a_golden_file_decode_bit_for_bit() {
    let (name, expected) = LAYERS;
    let packed = opened(name);
    let reader = LexiReader::open(name, std::fs::read(golden(name, "lexi")).unwrap(), &Limits::default());
    let reader = reader.unwrap().with_integers_verified().unwrap();
    let outline = reader.outline().unwrap();
    assert_eq!(outline.layers.iter().map(|layer| layer.refinements).collect::<Vec<_>>(), [2, 1]);
    assert!(packed.head().atoms > 256 && outline.chunks.iter().any(|chunk| chunk.gaussians >= 2048));
    let whole = ply_bytes(&reader.model().unwrap().into_splats());
    let found = checksums_of_first_parts(&packed);
    assert_eq!(found, expected);
    assert_eq!(found[8], crc32fast::hash(&whole));
    assert!(first_part(&packed, SHOWN_TENTHS) == std::fs::read(golden(name, "first.ply")).unwrap());
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
