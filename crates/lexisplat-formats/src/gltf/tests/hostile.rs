//! Files that are refused, and what is odd about others.

use lexisplat::ply::ReadOptions;
use lexisplat::{Error, Limits};
use lexisplat_testing::Random;
use serde_json::{Value, json};

use super::super::read;
use super::build::Builder;
use super::opened;
use crate::spz;
use crate::write_options::WriteOptions;

const WORD: &str = "KHR_gaussian_splatting";

/// A file of three splats after `change`.
fn changed(change: impl FnOnce(&mut Builder)) -> Builder {
    let mut builder = Builder::new();
    builder.splats(3, 1);
    change(&mut builder);
    builder
}

fn error(change: impl FnOnce(&mut Builder)) -> String {
    opened(&changed(change).glb()).unwrap_err().to_string()
}

/// The words of the first primitive's extension.
fn words(builder: &mut Builder) -> &mut Value {
    &mut builder.first()["extensions"][WORD]
}

#[test]
fn what_cannot_be_read_is_named() {
    type Change = fn(&mut Builder);
    let cases: [(&str, Change); 24] = [
        (
            "the attribute _SCALE is of a draft of KHR_gaussian_splatting, which has KHR_gaussian_splatting:SCALE",
            |b| {
                let attributes = b.first()["attributes"].as_object_mut().unwrap();
                let accessor = attributes.remove("KHR_gaussian_splatting:SCALE").unwrap();
                attributes.insert("_SCALE".to_owned(), accessor);
            },
        ),
        ("the attribute _ROTATION is of a draft", |b| b.first()["attributes"]["_ROTATION"] = json!(1)),
        ("accessor 3, KHR_gaussian_splatting:OPACITY, ends at byte", |b| {
            b.json["accessors"][3]["count"] = json!(4);
        }),
        ("2 elements of KHR_gaussian_splatting:OPACITY, and 3", |b| {
            b.json["accessors"][3]["count"] = json!(2);
        }),
        ("ends at byte 18446744073709551615", |b| b.json["accessors"][0]["count"] = json!(u64::MAX)),
        ("ends at byte 37", |b| b.accessor_of("POSITION")["byteOffset"] = json!(1)),
        ("a stride of 8", |b| b.json["bufferViews"][0]["byteStride"] = json!(8)),
        ("bufferView 0 ends at byte", |b| b.json["bufferViews"][0]["byteLength"] = json!(u64::MAX)),
        ("bufferView 99 does not exist", |b| b.accessor_of("POSITION")["bufferView"] = json!(99)),
        ("buffer 7 does not exist", |b| b.json["bufferViews"][2]["buffer"] = json!(7)),
        ("accessor 99 does not exist", |b| b.first()["attributes"]["POSITION"] = json!(99)),
        ("mesh 5 does not exist", |b| b.json["nodes"][0]["mesh"] = json!(5)),
        ("has no bufferView", |b| {
            drop(b.accessor_of("POSITION").as_object_mut().unwrap().remove("bufferView"));
        }),
        ("is sparse", |b| b.accessor_of("POSITION")["sparse"] = json!({"count": 1})),
        ("is not of type Vec3", |b| b.accessor_of("POSITION")["type"] = json!("VEC4")),
        ("componentType 5125", |b| b.accessor_of("POSITION")["componentType"] = json!(5125)),
        ("SH_DEGREE_1_COEF_2 is missing", |b| {
            let attributes = b.first()["attributes"].as_object_mut().unwrap();
            attributes.remove("KHR_gaussian_splatting:SH_DEGREE_1_COEF_2");
        }),
        ("SH_DEGREE_1_COEF_0 is missing", |b| {
            let attributes = &mut b.first()["attributes"];
            let position = attributes["POSITION"].clone();
            attributes["KHR_gaussian_splatting:SH_DEGREE_2_COEF_3"] = position;
            attributes.as_object_mut().unwrap().remove("KHR_gaussian_splatting:SH_DEGREE_1_COEF_0");
        }),
        ("the kernel 'round' is not read", |b| words(b)["kernel"] = json!("round")),
        ("its mode is 4", |b| drop(b.first().as_object_mut().unwrap().remove("mode"))),
        ("only equal scales", |b| b.json["nodes"][0]["scale"] = json!([1, 2, 1])),
        ("only equal scales", |b| b.json["nodes"][0]["scale"] = json!([0, 0, 0])),
        ("shears", |b| {
            b.json["nodes"][0]["matrix"] = json!([1, 0, 0, 0, 0.6, 0.8, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
        }),
        ("requires the extension 'EXT_meshopt_compression'", |b| {
            b.json["extensionsRequired"] = json!(["EXT_meshopt_compression"]);
        }),
    ];
    for (problem, change) in cases {
        let error = error(change);
        assert!(error.contains(problem), "{problem}: {error}");
    }
    let no_splats = error(|b| b.first()["extensions"] = json!({}));
    assert!(no_splats.contains("no splats"), "{no_splats}");
}

#[test]
fn nothing_outside_of_the_file_is_opened() {
    for uri in ["0.bin", "../secret", "file:///etc/passwd", "http://a/b", "//host/share", "datum:x"] {
        let json = String::from_utf8(changed(|_| ()).gltf()).unwrap();
        let mut json: Value = serde_json::from_str(&json).unwrap();
        json["buffers"][0]["uri"] = json!(uri);
        let error = opened(json.to_string().as_bytes()).unwrap_err().to_string();
        assert!(error.contains("is not opened"), "{error}");
    }
    for (uri, problem) in
        [("data:,abc", "not in base64"), ("data:x;base64,a*", "base64"), ("data:;base64,AAAA", "buffer 0")]
    {
        let mut json: Value = serde_json::from_slice(&changed(|_| ()).gltf()).unwrap();
        json["buffers"][0]["uri"] = json!(uri);
        let error = opened(json.to_string().as_bytes()).unwrap_err().to_string();
        assert!(error.contains(problem), "{error}");
    }
}

#[test]
fn odd_words_are_warned_of() {
    let warnings = |change: fn(&mut Builder)| opened(&changed(change).glb()).unwrap().1;
    assert_eq!(warnings(|_| ()), [""; 0]);
    let linear = warnings(|b| words(b)["colorSpace"] = json!("lin_rec709_display"));
    assert!(linear[0].contains("colorSpace is 'lin_rec709_display'"), "{linear:?}");
    assert!(warnings(|b| words(b)["projection"] = json!("fisheye"))[0].contains("projection"));
    assert!(warnings(|b| words(b)["sortingMethod"] = json!("none"))[0].contains("sortingMethod"));
    assert!(warnings(|b| *words(b) = json!({}))[0].contains("kernel and colorSpace are missing"));
}

/// Nodes that show one mesh many times, and bufferViews that are the same bytes, ask for more than the file has.
#[test]
fn small_files_that_ask_for_much_are_refused() {
    let mut many = changed(|_| ());
    let nodes = 70_000;
    many.json["nodes"] = (0..nodes).map(|_| json!({"mesh": 0})).collect();
    many.json["scenes"][0]["nodes"] = (0..nodes).collect();
    let error = opened(&many.glb()).unwrap_err();
    assert!(matches!(error, Error::Limit { limit: 65_536, .. }), "{error}");
    let mut wide = changed(|b| b.splats(5000, 0));
    wide.json["nodes"] = (0..4000).map(|_| json!({"mesh": 0})).collect();
    wide.json["scenes"][0]["nodes"] = (0..4000).collect();
    let error = opened(&wide.glb()).unwrap_err();
    assert!(matches!(error, Error::Limit { .. }), "{error}");
    let mut bytes = Builder::new();
    let (packed, _) =
        spz::write(&super::sample(1), &WriteOptions { spz_version: 2, ..WriteOptions::default() }).unwrap();
    bytes.view(&packed);
    for view in 0..2 {
        let again = bytes.json["bufferViews"][0].clone();
        bytes.json["bufferViews"][view] = again;
        let words = json!({"extensions": {"KHR_gaussian_splatting_compression_spz_2": {"bufferView": view}}});
        bytes.primitive(json!({"mode": 0, "attributes": {}, "extensions": {WORD: words}}));
        if view == 0 {
            bytes.view(&[]);
        }
    }
    let error = opened(&bytes.glb()).unwrap_err().to_string();
    assert!(error.contains("overlap"), "{error}");
    let options = ReadOptions::default().with_limits(Limits::default().with_gaussians(2));
    let error = read("a", &changed(|_| ()).glb(), &options).unwrap_err();
    assert!(matches!(error, Error::Limit { found: 3, limit: 2, .. }), "{error}");
}

/// A glTF as JSON, which tests/hostile.rs does not write.
#[test]
fn damaged_json_is_refused_or_finite() {
    let bytes = changed(|_| ()).gltf();
    for end in 0..bytes.len() {
        let refused = crate::open(
            "a.gltf",
            &bytes[..end],
            crate::Siblings::NONE,
            &ReadOptions::default(),
            true,
            &lexisplat::Silent,
        );
        assert!(refused.is_err(), "{end}");
    }
    let mut random = Random::new(1);
    for _ in 0..2_000 {
        let mut bytes = bytes.clone();
        for _ in 0..=random.below(3) {
            let at = random.below(bytes.len());
            bytes[at] = b"0129,:[]{}\"-ae.A"[random.below(16)];
        }
        if let Ok(found) = read("a", &bytes, &ReadOptions::default()) {
            assert!(found.len <= 3);
        }
    }
}
