//! The rules of docs/FORMAT.md for versions and for names that a reader does not know, of every layout and every
//! reader.

use std::path::PathBuf;

use crate::common;
use crate::parts::Parts;
use lexisplat::lexi::{self, LexiReader};
use lexisplat::{Error, FormatError, Limits, Model, Result, Splats};
use serde_json::Value;

/// Golden files: scenes of version 1 in each of its layouts, then of version 3.
const SCENES: [&str; 9] = [
    "f32",
    "f16",
    "paper",
    "degree0",
    "degree4",
    "degree1_u16_escapes",
    "packed3",
    "packed3_degree0",
    "packed3_escapes",
];

fn golden(name: &str) -> Vec<u8> {
    let path: PathBuf =
        [env!("CARGO_MANIFEST_DIR"), "tests", "golden", &format!("{name}.lexi")].iter().collect();
    std::fs::read(path).unwrap()
}

/// A golden file as its parts, with checksums of its tensors, which a packed file need not have.
fn parts_of(name: &str) -> Parts {
    let mut parts = Parts::of(&golden(name));
    parts.metadata.entry("checksums").or_insert_with(|| Value::from("{}"));
    parts
}

fn is_packed(name: &str) -> bool {
    name.starts_with("packed")
}

/// The dense scene of a file, as each of the readers sees it.
fn read(bytes: &[u8]) -> [Result<Splats>; 2] {
    let whole = lexi::read_bytes("file.lexi", bytes, &Limits::default()).map(Model::into_splats);
    let in_parts = || {
        let chunks = LexiReader::open("file.lexi", bytes, &Limits::default())?;
        let mut all = Vec::new();
        lexisplat::stream::in_source_order(&chunks, &std::env::temp_dir(), &mut |part| {
            all.push(part);
            Ok(())
        })?;
        assert_eq!(all.len(), 1, "these files are shorter than a part");
        Ok(all.remove(0))
    };
    [whole, in_parts()]
}

/// Returns the error of each reader for a file, that of dictionaries too where there is one.
fn refusals(bytes: &[u8], degree: &str) -> Vec<Error> {
    let mut errors: Vec<Error> = read(bytes).into_iter().map(|r| r.expect_err("taken")).collect();
    if degree != "0" {
        errors.push(lexi::read_dictionary_bytes("file.lexi", bytes, &Limits::default()).expect_err("taken"));
    }
    errors
}

fn scene_refusals(bytes: &[u8]) -> Vec<String> {
    read(bytes).into_iter().map(|r| r.unwrap_err().to_string()).collect()
}

fn assert_refused(parts: &Parts, words: &[&str]) {
    for error in refusals(&parts.sealed(), parts.metadata["degree"].as_str().unwrap()) {
        let said = error.to_string();
        assert!(words.iter().all(|word| said.contains(word)), "{said}, without {words:?}");
        assert!(said.starts_with("file.lexi: "), "{said}");
    }
}

fn assert_same(name: &str, parts: &Parts, original: &Parts) {
    for (a, b) in read(&parts.sealed()).into_iter().zip(read(&original.sealed())) {
        assert_eq!(a.unwrap(), b.unwrap(), "{name}");
    }
}

/// A dictionary alone, of the golden scene `f32`.
fn dictionary_alone() -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("d.lexi");
    let scene = lexi::read_bytes("f32.lexi", &golden("f32"), &Limits::default()).unwrap();
    lexi::write_dictionary(&path, scene.dictionary()).unwrap();
    std::fs::read(path).unwrap()
}

#[test]
fn golden_files_of_every_version_are_read_alike_whole_and_in_parts() {
    for name in SCENES {
        let bytes = golden(name);
        let [whole, in_parts] = read(&bytes).map(Result::unwrap);
        assert_eq!(whole, in_parts, "{name}");
        let version = if is_packed(name) { "3" } else { "1" };
        assert_eq!(Parts::of(&bytes).metadata["version"], version, "{name}");
        // Changing nothing changes nothing.
        assert_same(name, &Parts::of(&bytes), &Parts::of(&bytes));
    }
    assert_eq!(Parts::of(&dictionary_alone()).metadata["version"], "1");
}

/// Where there is nothing to read, shapes and types must still be looked at, by both readers.
#[test]
fn tensors_of_no_gaussians_are_of_their_shape_and_type() {
    let taken = |parts: &Parts| {
        let bytes = parts.sealed();
        let whole = lexi::read_bytes("file.lexi", &bytes, &Limits::default()).map(|model| model.len());
        [whole, common::count_in_parts(&bytes)]
    };
    for name in SCENES.iter().filter(|name| !is_packed(name)) {
        let mut none = parts_of(name);
        let of_gaussians = |name: &str| !["dictionary", "checksum.header"].contains(&name);
        let mut rows = Vec::new();
        for (name, _, shape, bytes) in none.tensors.iter_mut().filter(|t| of_gaussians(&t.0)) {
            let row = bytes.len() / usize::try_from(shape[0].as_u64().unwrap()).unwrap();
            let pointers = usize::from(name == "codes.pointers");
            shape[0] = pointers.into();
            bytes.truncate(pointers * row);
            rows.push((name.clone(), pointers, row));
        }
        assert!(taken(&none).into_iter().all(|n| n.unwrap() == 0), "{name}");
        for (tensor, length, row) in rows {
            let at = none.tensors.iter().position(|t| t.0 == tensor).unwrap();
            let mut longer = none.clone();
            longer.tensors[at].2[0] = (length + 1).into();
            longer.tensors[at].3.extend(vec![0; row]);
            let mut other = none.clone();
            other.tensors[at].1 = "I64".into();
            other.tensors[at].3 = other.tensors[at].3.repeat(2);
            for wrong in [longer, other] {
                for found in taken(&wrong) {
                    assert!(found.is_err(), "{name}: {:?}", wrong.tensors[at]);
                }
            }
        }
    }
}

#[test]
fn newer_versions_are_refused_with_both_numbers_and_what_to_do() {
    for name in SCENES {
        let parts = parts_of(name);
        // A newer file may hold anything else that is not known.
        let layout = parts.with("layout", "holographic").and("codes.more", "F64", &[1], &[0; 8]);
        for newer in [parts.with("version", "4"), layout.with("version", "4000000000000")] {
            let found: u64 = newer.metadata["version"].as_str().unwrap().parse().unwrap();
            let mut damaged = newer.sealed();
            let last = damaged.len() - 1;
            damaged[last] ^= 1;
            for bytes in [newer.sealed(), damaged] {
                for error in refusals(&bytes, parts.metadata["degree"].as_str().unwrap()) {
                    let said = error.to_string();
                    let Error::Format { problem: FormatError::Version { found: f, supported: 3 }, .. } =
                        error
                    else {
                        panic!("{name}: {said}")
                    };
                    assert_eq!(f, found, "{name}");
                    assert!(said.contains("version") && said.contains(&found.to_string()), "{said}");
                    assert!(said.ends_with("update lexisplat"), "{said}");
                }
            }
        }
    }
    let newer = Parts::of(&dictionary_alone()).with("version", "4").sealed();
    let error = lexi::read_dictionary_bytes("d.lexi", &newer, &Limits::default()).unwrap_err().to_string();
    assert!(error.starts_with("d.lexi: format version 4 ") && error.ends_with("update lexisplat"), "{error}");
}

#[test]
fn versions_that_never_were_are_damage() {
    for name in SCENES {
        let parts = parts_of(name);
        for version in ["0", "", "-1", "1.0", "two", "99999999999999999999"] {
            assert_refused(&parts.with("version", version), &["metadata 'version' is "]);
        }
        // Each layout belongs to one version.
        let layout = parts.metadata.get("layout").and_then(Value::as_str).unwrap_or("packed");
        let other = parts.with("layout", layout).with("version", if is_packed(name) { "1" } else { "3" });
        let lacks = ["tensor 'checksum.header' is missing"];
        assert_refused(
            &other,
            if is_packed(name) { &lacks } else { &["metadata 'version'", "has no layout"] },
        );
        assert_refused(&parts.with("layout", "holographic"), &["holographic"]);
        assert_refused(&parts.with("format", "lexi-video"), &["metadata 'format' is 'lexi-video'"]);
        assert_refused(&parts.with("version", "2"), &["'version' is 2", "versions 1 and 3"]);
        // A packed file need not name its layout.
        let needed = ["version", "format", "layout"];
        for key in &needed[..if is_packed(name) { 2 } else { 3 }] {
            let mut missing = parts.clone();
            missing.metadata.remove(*key);
            assert_refused(&missing, &[key, "is missing"]);
        }
    }
}

#[test]
fn tensors_that_may_be_ignored_are_but_their_checksum_is_not() {
    for name in SCENES {
        let parts = parts_of(name);
        let more = parts.and("x-thumbnail", "U8", &[2, 3], &[7; 6]).and("x-", "F64", &[0, 4], &[]);
        assert_same(name, &more, &parts);
        // Wherever they lie, and in whatever order the others are, but for the properties of packed files.
        let mut turned = more.clone();
        turned.tensors.reverse();
        if is_packed(name) {
            turned.tensors.retain(|tensor| !tensor.0.starts_with("extra."));
            turned.tensors.extend(more.tensors.into_iter().filter(|tensor| tensor.0.starts_with("extra.")));
        }
        assert_same(name, &turned, &parts);
        let mut bytes = turned.sealed();
        let at = bytes.windows(6).position(|w| w == [7; 6]).unwrap();
        bytes[at] ^= 1;
        for error in refusals(&bytes, parts.metadata["degree"].as_str().unwrap()) {
            let problem = matches!(&error, Error::Format { problem: FormatError::Checksum { covered }, .. }
                if covered == "x-thumbnail");
            assert!(problem, "{name}: {error}");
        }
    }
}

#[test]
fn any_other_unknown_tensor_is_refused_by_name() {
    for name in SCENES {
        let parts = parts_of(name);
        // Names of other layouts are not known in this one.
        let mut unknown = vec!["X-thumbnail", "thumbnail", "codes.more", "sh.order", "packed.more", ""];
        if is_packed(name) {
            assert_refused(&parts.with("reached", r#"{"judged_psnr":38.5}"#), &["reached"]);
            unknown.extend(["position", "dictionary", "codes.counts", "escapes.rows", "packed.tables"]);
        } else {
            let pointers = if name == "paper" { "codes.counts" } else { "codes.pointers" };
            unknown.extend(["packed.data", "packed.order", pointers]);
        }
        if name == "f32" {
            unknown.push("escapes.rows");
        }
        if name == "degree0" {
            unknown.extend(["dictionary", "codes.counts", "escapes.gaussians"]);
        }
        for tensor in unknown {
            let more = parts.and(tensor, "F32", &[1], &[0; 4]);
            assert_refused(&more, &[&format!("tensor '{tensor}' is not known for layout '")]);
        }
        // A property that is known, of a type that is not.
        for said in scene_refusals(&parts.and("extra.flag", "BOOL", &[1], &[0]).sealed()) {
            assert!(said.contains("extra.flag"), "{said}");
        }
    }
}

#[test]
fn unknown_metadata_is_ignored() {
    for name in SCENES {
        let parts = parts_of(name);
        let more = parts.with("licence", "none").with("x", "").with("generator", "another program 7");
        assert_same(name, &more, &parts);
    }
    // Of a promise too, and of what was reached.
    let parts = parts_of("packed3");
    let reached =
        r#"{"judged_psnr":38.5,"mean_psnr":40,"min_psnr":31,"views":12,"cameras":false,"judge":"someone"}"#;
    assert_same("packed3", &parts.with("reached", reached), &parts);
    let mut target: Value = serde_json::from_str(parts.metadata["target"].as_str().unwrap()).unwrap();
    target["judge"] = Value::from("someone");
    assert_same("packed3", &parts.with("target", &target.to_string()), &parts);
}

#[test]
fn values_beyond_those_of_this_version_are_refused_by_name() {
    for name in SCENES {
        let parts = parts_of(name);
        assert_refused(&parts.with("degree", "5"), &["degree"]);
        let lasso = parts.with("pursuit", "lasso");
        if is_packed(name) {
            // No packed file has the key.
            assert_same(name, &lasso, &parts);
        } else {
            assert_refused(&lasso, &["lasso"]);
        }
    }
}

/// The file with another text of its header, sealed again.
fn with_header(bytes: &[u8], change: impl Fn(&str) -> String) -> Vec<u8> {
    let length = usize::try_from(u64::from_le_bytes(*bytes.first_chunk().unwrap())).unwrap();
    let text = std::str::from_utf8(&bytes[8..8 + length]).unwrap();
    let entries: Value = serde_json::from_str(text).unwrap();
    let head = entries.get("packed.head");
    let offset = |i: usize| {
        let offsets = &head.unwrap_or(&entries["checksum.header"])["data_offsets"];
        usize::try_from(offsets[i].as_u64().unwrap()).unwrap()
    };
    let changed = change(text);
    assert_ne!(changed, text);
    let mut header = (changed.len() as u64).to_le_bytes().to_vec();
    header.extend_from_slice(changed.as_bytes());
    let data = &bytes[8 + length..];
    // The checksum of a packed file covers the rest of its tensor too.
    let sum = crc32fast::hash(&[&header, &data[offset(0) + 4..offset(1)]].concat()).to_le_bytes();
    let at = offset(0) + header.len();
    let mut new = [&header, data].concat();
    new[at..at + 4].copy_from_slice(&sum);
    new
}

/// Parsers differ in which of two members of one name they take.
#[test]
fn members_that_are_there_twice_are_refused() {
    for name in SCENES {
        // There is at least one checksum.
        let parts = parts_of(name).and("x-", "U8", &[1], &[0]);
        let degree = parts.metadata["degree"].as_str().unwrap();
        let bytes = parts.sealed();
        assert_eq!(read(&with_header(&bytes, |text| format!("{text} "))).map(|r| r.is_ok()), [true; 2]);
        let tensor = if is_packed(name) { "packed.head" } else { "checksum.header" };
        let repeated = format!(r#"{{"{tensor}":{{"dtype":"U32","shape":[1],"data_offsets":[0,4]}},"#);
        let twice = [
            (r#""__metadata__":{"#, r#""__metadata__":{"degree":"0","#, "degree"),
            ("{", &repeated, tensor),
            (r#"{"data_offsets":"#, r#"{"dtype":"F32","data_offsets":"#, "dtype"),
        ];
        for (before, after, member) in twice {
            let bytes = with_header(&bytes, |text| text.replacen(before, after, 1));
            for error in refusals(&bytes, degree) {
                let said = error.to_string();
                assert!(said.contains(&format!("member '{member}' is there twice")), "{said}");
            }
        }
        let sums = parts.metadata["checksums"].as_str().unwrap();
        assert!(sums.starts_with('{'));
        let bytes = with_header(&bytes, |text| {
            text.replacen(r#""checksums":"{"#, r#""checksums":"{\"a\":\"00000000\",\"a\":\"00000000\","#, 1)
        });
        for error in refusals(&bytes, degree) {
            assert!(error.to_string().contains("metadata 'checksums': member 'a' is there twice"), "{error}");
        }
    }
    let parts = parts_of("packed3");
    for key in ["target", "reached"] {
        for said in scene_refusals(&parts.with(key, r#"{"views":1,"views":2}"#).sealed()) {
            assert!(said.contains(&format!("metadata '{key}': member 'views' is there twice")), "{said}");
        }
    }
}

/// Parsers differ in how deep they go.
#[test]
fn json_is_at_most_32_deep() {
    let lists = |depth: usize| "[".repeat(depth) + &"]".repeat(depth);
    for name in SCENES {
        let parts = parts_of(name);
        let bytes = parts.sealed();
        // The header and the entry of a tensor are around these.
        let nested = |depth| {
            let more = format!(r#"{{"more":{},"data_offsets":"#, lists(depth));
            with_header(&bytes, |text| text.replacen(r#"{"data_offsets":"#, &more, 1))
        };
        assert_eq!(read(&nested(30)).map(|r| r.is_ok()), [true; 2], "{name}");
        for error in refusals(&nested(31), parts.metadata["degree"].as_str().unwrap()) {
            let said = error.to_string();
            assert!(said.contains("the header: arrays and objects more than 32 deep"), "{said}");
        }
    }
    let parts = parts_of("packed3");
    let target = parts.metadata["target"].as_str().unwrap();
    let nested =
        |depth| parts.with("target", &target.replacen('{', &format!(r#"{{"x":{},"#, lists(depth)), 1));
    assert_same("packed3", &nested(31), &parts);
    for said in scene_refusals(&nested(32).sealed()) {
        assert!(said.contains("metadata 'target': arrays and objects more than 32 deep"), "{said}");
    }
}

#[test]
fn tensors_are_of_types_that_are_listed() {
    for name in SCENES {
        let parts = parts_of(name);
        for dtype in
            ["BOOL", "I8", "U8", "I16", "U16", "F16", "BF16", "I32", "U32", "F32", "I64", "U64", "F64"]
        {
            assert_same(name, &parts.and("x-a", dtype, &[0], &[]), &parts);
        }
        for dtype in [
            "F4",
            "F6_E2M3",
            "F6_E3M2",
            "F8_E5M2",
            "F8_E4M3",
            "F8_E8M0",
            "F8_E4M3FNUZ",
            "F8_E5M2FNUZ",
            "C64",
            "u8",
            "",
        ] {
            assert_refused(&parts.and("x-a", dtype, &[0], &[]), &["tensor 'x-a' has an unknown dtype"]);
        }
    }
}

#[test]
fn version_1_may_lack_its_generator_and_what_stopped_the_pursuit() {
    for name in SCENES.iter().filter(|name| !is_packed(name)) {
        let parts = parts_of(name);
        let mut less = parts.clone();
        for key in ["generator", "tolerance", "max_nonzeros"] {
            less.metadata.remove(key);
        }
        assert_same(name, &less, &parts);
    }
}

#[test]
fn numbers_of_the_metadata_are_those_of_json() {
    for name in SCENES {
        let parts = parts_of(name);
        for (key, wrong) in [
            ("seed", "+7"),
            ("seed", "017"),
            ("seed", " 7"),
            ("seed", "3e2"),
            ("seed", "-0"),
            ("seed", "7.0"),
            ("degree", "-0"),
            ("version", "1e0"),
            ("max_nonzeros", "-0"),
            ("over_tolerance", "0e0"),
            ("max_residual", ".5"),
            ("max_residual", "5."),
            ("max_residual", "NaN"),
            ("tolerance", "inf"),
            ("over_tolerance", "-0x1"),
            ("antialiased", "True"),
            ("antialiased", "1"),
        ] {
            for said in scene_refusals(&parts.with(key, wrong).sealed()) {
                assert!(said.contains(key), "{said}");
            }
        }
        assert_same(name, &parts.with("max_residual", "1e-3"), &parts.with("max_residual", "0.001"));
        assert_same(name, &parts.with("tolerance", "-0"), &parts.with("tolerance", "0"));
    }
    let parts = parts_of("packed3");
    for (key, wrong) in [("gaussians", "3e2"), ("gaussians", "300.0"), ("removed", "-0")] {
        for said in scene_refusals(&parts.with(key, wrong).sealed()) {
            assert!(said.contains(&format!("metadata '{key}' is '{wrong}'")), "{said}");
        }
    }
    let reached = |views: &str| {
        let numbers = r#""judged_psnr":-0,"mean_psnr":4e1,"min_psnr":31.0,"cameras":false"#;
        parts.with("reached", &format!(r#"{{{numbers},"views":{views}}}"#))
    };
    assert_same("packed3", &reached("12"), &parts);
    for views in ["-0", "12.0", "1e1", "4294967296"] {
        for said in scene_refusals(&reached(views).sealed()) {
            assert!(said.contains("metadata 'reached'"), "{said}");
        }
    }
}

#[test]
fn properties_that_no_ply_could_hold_are_damage() {
    for name in SCENES {
        let parts = parts_of(name);
        let gaussians = read(&parts.sealed())[0].as_ref().unwrap().len();
        let with = |tensor: &str| parts.and(tensor, "U8", &[gaussians], &vec![0; gaussians]).sealed();
        for tensor in [
            "extra.",
            "extra.a b",
            "extra.a\nb",
            "extra.\u{1b}[2J\u{7}",
            "extra.\u{a0}",
            "extra.x",
            "extra.f_rest_7",
            "extra.f_rest_07",
            "extra.f_rest_99999999999999999999",
            "extra.rot_3",
        ] {
            for said in scene_refusals(&with(tensor)) {
                assert!(said.contains("is not named as a property can be"), "{said}");
                assert!(!said.contains(char::is_control), "{said}");
            }
        }
        // Columns of packed files are coded.
        let column = parts.tensors.iter().find(|tensor| tensor.0 == "extra.label").map(|tensor| &tensor.3);
        for tensor in ["extra.mine", "extra.f_rest_", "extra.f_rest_x7", "extra.nx", "extra.größe"] {
            let file = match column {
                Some(column) if is_packed(name) => parts.and(tensor, "U8", &[column.len()], column).sealed(),
                _ if is_packed(name) => continue,
                _ => with(tensor),
            };
            assert!(read(&file).iter().all(Result::is_ok), "{tensor}");
        }
    }
}

#[test]
fn a_dictionary_alone_keeps_the_same_rules() {
    let parts = Parts::of(&dictionary_alone());
    let read = |parts: &Parts| lexi::read_dictionary_bytes("d.lexi", &parts.sealed(), &Limits::default());
    let original = read(&parts).unwrap();
    let more = parts.and("x-name", "U8", &[2], b"no").with("licence", "none");
    assert_eq!(read(&more).unwrap(), original);
    for name in ["name", "position", "extra.label", "codes.values"] {
        let said = read(&parts.and(name, "F32", &[1], &[0; 4])).unwrap_err().to_string();
        assert_eq!(said, format!("d.lexi: tensor '{name}' is not known in a dictionary"));
    }
    for version in ["0", "one", "2", "3"] {
        let said = read(&parts.with("version", version)).unwrap_err().to_string();
        assert!(said.contains("metadata 'version' is "), "{said}");
    }
    let said = read(&parts.with("version", "3")).unwrap_err().to_string();
    assert!(said.ends_with("is 3, and a dictionary's is 1"), "{said}");
    let said = read(&parts.with("degree", "0")).unwrap_err().to_string();
    assert!(said.contains("SH degree 0 has no dictionary"), "{said}");
    // Parts that only scenes have are not looked at.
    let mut less = parts.with("layout", "holographic").with("pursuit", "lasso").with("seed", "x");
    less.metadata.remove("generator");
    assert_eq!(read(&less).unwrap(), original);
    let mut bytes = more.sealed();
    let at = bytes.windows(2).rposition(|w| w == b"no").unwrap();
    bytes[at] ^= 1;
    let said = lexi::read_dictionary_bytes("d.lexi", &bytes, &Limits::default()).unwrap_err().to_string();
    assert!(said.contains("checksum of 'x-name'"), "{said}");
    // It is no scene.
    for said in scene_refusals(&parts.sealed()) {
        assert!(said.contains("metadata 'format' is 'lexi-dictionary'"), "{said}");
    }
}
