//! Every refusal says what is wrong, where, and what to do, on one line.

use lexisplat::ply::{self, Format, ReadOptions, ScalarType};
use lexisplat::{CompressOptions, Error, Extra, ExtraValues, FLAT_SCALE, FormatError, Limits, Silent, lexi};

use super::support::{Column, File, assert_same, columns, scene};

fn refuse(bytes: &[u8]) -> String {
    let said =
        ply::read_bytes("t.ply", bytes, &ReadOptions::default()).expect_err("must be refused").to_string();
    assert!(!said.contains('\n'), "{said}");
    said
}

fn good() -> File {
    File::new(columns(&scene(1, 4, 11)))
}

fn edited(from: &str, to: &str) -> Vec<u8> {
    let text = good().header();
    assert!(text.contains(from), "{from}");
    let mut bytes = text.replacen(from, to, 1).into_bytes();
    bytes.extend(&good().bytes()[text.len()..]);
    bytes
}

#[test]
fn relatives_of_3dgs_are_named() {
    let chunk = "element chunk 1\nproperty float min_x\nelement vertex 4\nproperty uint packed_position\n";
    let packed = format!("ply\nformat binary_little_endian 1.0\n{chunk}end_header\n");
    let cases = [
        (
            packed.into_bytes(),
            "t.ply: this is a PlayCanvas compressed.ply, which is not supported; 'lexisplat convert' makes a PLY",
        ),
        (
            good().without(&["opacity", "scale_0", "rot_0"]).bytes(),
            "t.ply: this is a point cloud, not a Gaussian scene (no opacity), which is not supported; pass the trained model",
        ),
        (edited("f_rest_0", "f_anchor_feat_0"), "a Scaffold-GS anchor model"),
        (b"PK\x03\x04".to_vec(), "a zip archive (SOG?)"),
        (vec![0x1f, 0x8b, 8, 0], "a gzip file (SPZ?)"),
    ];
    for (bytes, part) in cases {
        let said = refuse(&bytes);
        assert!(said.contains(part), "{said}");
    }
}

#[test]
fn wrong_headers_are_named() {
    let cases = [
        (good().without(&["z"]).bytes(), "t.ply: property 'z' is missing"),
        (good().without(&["opacity"]).bytes(), "t.ply: property 'opacity' is missing"),
        (good().without(&["rot_3"]).bytes(), "t.ply: property 'rot_3' is missing"),
        (good().without(&["scale_1"]).bytes(), "t.ply: property 'scale_1' is missing"),
        (
            good().without(&["f_dc_0"]).bytes(),
            "property 'f_dc_0' is missing; colours as red, green and blue alone",
        ),
        (
            good().without(&["f_rest_4"]).bytes(),
            "property 'f_rest_4' is missing: 8 f_rest properties found, the highest is f_rest_8; expected f_rest_0 onwards",
        ),
        (
            good().without(&["f_rest_8"]).bytes(),
            "8 f_rest properties found; expected f_rest_0 onwards, 0, 9, 24, 45 or 72",
        ),
        (edited("property float x\n", "property list uchar float x\n"), "vertex property 'x' is a list"),
        (edited("float nx", "float x"), "vertex property 'x' is declared twice"),
        (edited("element vertex", "element vertices"), "no element 'vertex'; elements found: vertices"),
        (edited("end_header", "element vertex 1\nend_header"), "'vertex' is declared more than once"),
        (
            edited("property float x", "property half x"),
            "header line 4, 'property half x': floats of 16 bits are no type of a PLY",
        ),
        (edited("property float x\n", "property real x\n"), "header line 4, 'property real x': unknown type"),
        (
            edited("vertex 4", "vertex 4294967296"),
            "Gaussians in t.ply: 4294967296 is over the limit of 4294967294",
        ),
    ];
    for (bytes, part) in cases {
        let said = refuse(&bytes);
        assert!(said.contains(part), "{said}");
    }
    let wide = ReadOptions::default().with_limits(Limits::default());
    assert!(ply::read_bytes("t.ply", &good().bytes(), &wide).is_ok());
}

#[test]
fn wrong_sizes_are_named() {
    let bytes = good().bytes();
    let row = 26 * 4;
    let said = refuse(&bytes[..bytes.len() - 1]);
    let part = format!(
        "truncated: element 'vertex' (4 rows of {row} bytes) needs {} bytes, the file has {}",
        4 * row,
        4 * row - 1
    );
    assert!(said.contains(&part), "{said}");
    let said = refuse(&edited("vertex 4", "vertex 4000000000"));
    assert!(said.contains("needs 416000000000 bytes, the file has 416"), "{said}");

    let mut file = good();
    file.before = ("element face 2\nproperty list int double v\n".to_owned(), vec![1, 0, 0, 0]);
    file.before.1.extend([0; 8]);
    file.before.1.extend([255, 255, 255, 127]);
    let said = refuse(&file.bytes());
    assert!(said.contains("list 'v' in row 1 of element 'face' does not fit"), "{said}");
    let end = file.before.1.len() - 1;
    file.before.1[end] = 255;
    assert!(refuse(&file.bytes()).contains("list 'v' in row 1"));
}

#[test]
fn wrong_text_is_named() {
    let mut file = good();
    file.format = Format::Ascii;
    let text = String::from_utf8(file.bytes()).unwrap();
    let (header, data) = text.split_once("end_header\n").unwrap();
    let with = |data: String| refuse(format!("{header}end_header\n{data}").as_bytes());
    let lines: Vec<&str> = data.lines().collect();

    let said = with(lines[..3].join("\n") + "\n");
    assert!(said.contains("the header promises 4 vertices, the file holds 3 rows"), "{said}");
    let said = with(data.to_owned() + lines[0]);
    assert!(said.contains("the header promises 4 vertices, the file holds 5 rows"), "{said}");
    let said = with(data.replacen(' ', " 1 ", 1));
    assert!(said.contains("vertex 0: 27 values, the header promises 26"), "{said}");
    let (first, rest) = data.split_once(' ').unwrap();
    let said = with(rest.to_owned());
    assert!(said.contains("vertex 0: 25 values, the header promises 26"), "{said}");
    let said = with(format!("{first}mm {rest}"));
    assert!(said.contains("vertex 0: value 0, '") && said.contains("mm', is no float"), "{said}");
    let said = with("1\n".repeat(4));
    assert!(said.contains("truncated: element 'vertex' (4 rows of 26 values)"), "{said}");
    let mut bytes = text.clone().into_bytes();
    bytes[header.len() + 11] = 0xff;
    assert!(refuse(&bytes).contains("vertex 0: not text"));
}

#[test]
fn bad_values_are_counted_or_dropped() {
    let rows = 3000;
    let splats = scene(1, rows, 2);
    for (bad, property) in [
        (f64::NAN, "y"),
        (f64::NAN, "opacity"),
        (f64::INFINITY, "scale_1"),
        (f64::NEG_INFINITY, "f_rest_7"),
        (1e300, "rot_2"),
        (f64::NAN, "nz"),
    ] {
        let mut file = File::new(columns(&splats));
        for row in [1500, 1501, 2999] {
            file.column(property).values[row] = bad;
        }
        // A later property of an earlier row than the rest, and two in one row.
        file.column("rot_3").values[1500] = f64::NAN;
        file.column(property).ty = ScalarType::F64;
        let said = refuse(&file.bytes());
        let part = format!(
            "t.ply: 3 Gaussians hold NaN or infinite values, the first is number 1500 (property '{property}')"
        );
        assert_eq!(said, part);

        file.columns.push(Column {
            name: "id".to_owned(),
            ty: ScalarType::F32,
            values: (0..rows).map(|i| if i == 7 { f64::NAN } else { 1.0 }).collect(),
        });
        let options = ReadOptions::default().with_drop_invalid(true);
        for format in [Format::BinaryLittleEndian, Format::Ascii] {
            file.format = format;
            let found = ply::read_bytes("t.ply", &file.bytes(), &options).unwrap();
            assert_eq!(found.summary.dropped, 3);
            assert!(
                found.warnings.iter().any(|w| w.starts_with("dropped 3 of 3000 Gaussians")),
                "{:?}",
                found.warnings
            );
            let mut expected = splats.clone();
            let keep: Vec<bool> = (0..rows).map(|i| ![1500, 1501, 2999].contains(&i)).collect();
            expected.retain(&keep);
            let mut kept = found.splats.clone();
            assert_eq!(kept.geometry.extras.len(), 1);
            assert_eq!(kept.geometry.extras[0].values.len(), rows - 3);
            kept.geometry.extras.clear();
            assert_same(&kept, &expected, property);
        }
    }
}

/// Decoders of 8-bit opacities write the logit of 1 and 0 as it is.
#[test]
fn infinite_opacities_are_sure_ones() {
    let rows = 3000;
    let splats = scene(1, rows, 2);
    for ty in [ScalarType::F32, ScalarType::F64] {
        let mut file = File::new(columns(&splats));
        file.column("opacity").ty = ty;
        let values = &mut file.column("opacity").values;
        (values[0], values[1501], values[2999]) = (f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY);
        for (format, drop_invalid) in
            [(Format::BinaryLittleEndian, false), (Format::BinaryBigEndian, true), (Format::Ascii, false)]
        {
            file.format = format;
            let options = ReadOptions::default().with_drop_invalid(drop_invalid);
            let found = ply::read_bytes("t.ply", &file.bytes(), &options).unwrap();
            let warning = "3 opacities are infinite, taken as 100 (opaque) or -100 (invisible)";
            assert!(found.warnings.iter().any(|w| w == warning), "{:?}", found.warnings);
            assert_eq!(found.summary.dropped, 0);
            let mut expected = splats.clone();
            let opacities = &mut expected.geometry.opacities;
            (opacities[0], opacities[1501], opacities[2999]) = (100.0, -100.0, 100.0);
            assert_same(&found.splats, &expected, "infinite opacities");
        }
    }
}

/// Converters of 2D Gaussians write the logarithm of a thickness of 0 as it is.
#[test]
fn sizes_of_zero_are_flat_and_said_once() {
    let rows = 3000;
    let splats = scene(1, rows, 2);
    let mut file = File::new(columns(&splats));
    for (column, row) in [("scale_2", 0), ("scale_0", 1501), ("scale_1", 1501), ("scale_2", 2999)] {
        file.column(column).values[row] = f64::NEG_INFINITY;
    }
    for format in [Format::BinaryLittleEndian, Format::Ascii] {
        file.format = format;
        for drop_invalid in [false, true] {
            let options = ReadOptions::default().with_drop_invalid(drop_invalid);
            let found = ply::read_bytes("t.ply", &file.bytes(), &options).unwrap();
            assert_eq!(
                found.warnings,
                ["3 Gaussians have a size of zero (a scale of -inf), taken as e^-20: flat"]
            );
            let mut expected = splats.clone();
            let scales = &mut expected.geometry.scales;
            (scales[0][2], scales[2999][2]) = (FLAT_SCALE, FLAT_SCALE);
            (scales[1501][0], scales[1501][1]) = (FLAT_SCALE, FLAT_SCALE);
            assert_same(&found.splats, &expected, "flat Gaussians");
        }
    }
    file.column("scale_1").values[7] = f64::INFINITY;
    assert!(refuse(&file.bytes()).contains("(property 'scale_1')"));
}

#[test]
fn models_of_2d_gaussians_are_flat() {
    let splats = scene(1, 3000, 2);
    let file = File::new(columns(&splats)).without(&["scale_2"]);
    let found = ply::read_bytes("t.ply", &file.bytes(), &ReadOptions::default()).unwrap();
    let said = "a 2D Gaussian Splatting model (no scale_2): its Gaussians are taken as flat";
    assert_eq!(found.warnings, [said]);
    let mut expected = splats;
    expected.geometry.scales.iter_mut().for_each(|scales| scales[2] = FLAT_SCALE);
    assert_same(&found.splats, &expected, "2D Gaussians");
}

#[test]
fn a_mark_of_utf_8_before_the_header_is_nothing() {
    for format in [Format::BinaryLittleEndian, Format::Ascii] {
        let mut file = good();
        file.format = format;
        let marked = [&b"\xef\xbb\xbf"[..], &file.bytes()].concat();
        let [plain, marked] =
            [&file.bytes(), &marked].map(|b| ply::read_bytes("t.ply", b, &ReadOptions::default()).unwrap());
        assert_same(&marked.splats, &plain.splats, "a marked file");
        assert_eq!(marked.warnings, plain.warnings);
        assert_eq!(marked.summary.file_bytes, plain.summary.file_bytes + 3);
    }
}

#[test]
fn part_of_a_normal_is_dropped_by_name() {
    let found = ply::read_bytes("t.ply", &good().without(&["ny"]).bytes(), &ReadOptions::default()).unwrap();
    assert_eq!(found.warnings, ["only part of a normal is there, dropped: nx, nz"]);
    assert!(found.splats.geometry.extras.is_empty() && found.splats.geometry.normals.is_empty());
}

#[test]
fn the_writer_refuses_what_it_could_not_read_back() {
    for name in ["", "a b", "a\nend_header", "x", "f_rest_3"] {
        let mut splats = scene(1, 2, 0);
        splats.geometry.extras = vec![Extra { name: name.to_owned(), values: ExtraValues::U8(vec![0; 2]) }];
        let error = ply::write(&mut Vec::new(), &splats).expect_err("must be refused");
        assert!(matches!(error, Error::Parameter { name: "extra", .. }), "{name:?}: {error}");
    }
    let mut splats = scene(1, 2, 0);
    splats.sh_rest.pop();
    assert!(ply::write(&mut Vec::new(), &splats).is_err());
}

#[test]
fn extras_have_the_names_of_normals_where_there_are_none() {
    let mut splats = scene(1, 2, 0);
    splats.geometry.normals.clear();
    let extra = |name: &str, values: Vec<f32>| Extra { name: name.to_owned(), values: values.into() };
    splats.geometry.extras = vec![extra("nx", vec![1.0, 2.0]), extra("label", vec![7.0, 8.0])];
    let mut bytes = Vec::new();
    ply::write(&mut bytes, &splats).unwrap();
    let header = String::from_utf8_lossy(&bytes);
    assert!(header.contains("property float z\nproperty float f_dc_0\n"), "{header}");
    assert!(header.contains("property float nx\nproperty float label\nend_header"), "{header}");
    // A normal needs all three.
    let found = ply::read_bytes("t.ply", &bytes, &ReadOptions::default()).unwrap();
    assert!(found.warnings.contains(&"only part of a normal is there, dropped: nx".to_owned()));
    let mut expected = splats.clone();
    expected.geometry.extras.remove(0);
    assert_same(&found.splats, &expected, "one of a normal");
    splats.geometry.extras =
        vec![extra("nz", vec![1.0, 2.0]), extra("nx", vec![3.0, 4.0]), extra("ny", vec![5.0, 6.0])];
    bytes.clear();
    ply::write(&mut bytes, &splats).unwrap();
    let found = ply::read_bytes("t.ply", &bytes, &ReadOptions::default()).unwrap();
    splats.geometry.extras.clear();
    splats.geometry.normals = vec![[3.0, 5.0, 1.0], [4.0, 6.0, 2.0]];
    assert_same(&found.splats, &splats, "a whole normal");
    // With normals it would be a second property of that name.
    splats.geometry.extras = vec![extra("nx", vec![1.0, 2.0])];
    let error = ply::write(&mut Vec::new(), &splats).expect_err("must be refused");
    assert!(matches!(error, Error::Parameter { name: "extra", .. }), "{error}");
}

/// Found by fuzzing: a name that was read but that the writer refused.
#[test]
fn names_that_cannot_be_written_are_not_read() {
    for name in ["la\u{5}bel", "\u{1b}[31mred", "a\0"] {
        let mut file = good();
        file.columns.push(Column { name: name.to_owned(), ty: ScalarType::U8, values: vec![0.0; 4] });
        let said = refuse(&file.bytes());
        assert!(said.contains("control characters in the name"), "{said}");
        assert!(!said.contains(char::is_control), "{said:?}");
    }
}

#[test]
fn a_scene_of_the_other_kind_is_named() {
    let mut lexi = Vec::new();
    let (model, _) = lexisplat::compress(scene(1, 10, 0), &CompressOptions::default(), &Silent).unwrap();
    lexi::write(&mut lexi, &model).unwrap();
    assert_eq!(refuse(&lexi), "t.ply: this is a .lexi, not a PLY");
    let said = lexi::read_bytes("t.lexi", &good().bytes(), &Limits::default()).unwrap_err();
    assert_eq!(said.to_string(), "t.lexi: this is a PLY, not a .lexi");
    assert!(matches!(said, Error::Format { problem: FormatError::OtherKind { .. }, .. }));
}

#[test]
fn a_missing_file_is_named() {
    let error = ply::read("no/such.ply", &ReadOptions::default()).expect_err("not there");
    assert!(matches!(&error, Error::Io { .. }) && error.to_string().starts_with("no/such.ply: "), "{error}");
}
