//! Attributes of all kinds, and nodes.

use lexisplat::sh::rest_basis;
use lexisplat::{ShDegree, Splats};
use serde_json::json;

use super::super::placement::GLTF;
use super::super::write::{unit, write};
use super::build::Builder;
use super::{most, opened, read, sample};
use crate::axes::Flip;
use crate::quaternion::turned;
use crate::spz;
use crate::write_options::WriteOptions;

const WORD: &str = "KHR_gaussian_splatting";

#[test]
fn attributes_are_read_in_glb_and_json() {
    for degree in 0..=4 {
        let mut builder = Builder::new();
        builder.splats(3, degree);
        let (splats, warnings) = opened(&builder.clone().glb()).unwrap();
        assert!(read(&builder.gltf()) == splats);
        assert_eq!(warnings.len(), usize::from(degree == 4), "{warnings:?}");
        assert_eq!((splats.len(), splats.degree.get()), (3, degree));
        let geometry = &splats.geometry;
        assert_eq!(geometry.positions, [[0.0, -2.0, 3.0], [-1.0, -2.0, 3.0], [-2.0, -2.0, 3.0]]);
        assert_eq!(geometry.scales[1], [0.0, 2.0_f32.ln(), 4.0_f32.ln()]);
        assert_eq!((geometry.opacities[1], geometry.dc[1]), (0.0, [0.0, 1.0, 2.0]));
        assert_eq!(geometry.rotations[1].map(f32::abs), [1.0, 0.0, 0.0, 0.0]);
        let per = splats.degree.rest_per_channel();
        for (i, v) in splats.rest(1).iter().enumerate() {
            let (c, k) = (i / per, i % per);
            assert_eq!(v.abs(), 10.0 * (k + 1) as f32 + c as f32);
        }
    }
}

#[test]
fn numbers_of_all_kinds_are_read() {
    let mut builder = Builder::new();
    builder.splats(2, 0);
    builder.replace("POSITION", 5122, false, &[1, 0, 254, 255, 3, 0, 0, 0, 0, 0, 0, 0]);
    builder.replace(&format!("{WORD}:ROTATION"), 5120, true, &[127, 0, 0, 0, 0, 0x80, 0, 0]);
    builder.replace(&format!("{WORD}:SCALE"), 5121, true, &[255, 51, 0, 1, 1, 1]);
    builder.replace(&format!("{WORD}:OPACITY"), 5123, true, &[0xff, 0xff, 0x66, 0x66]);
    let splats = read(&builder.clone().glb());
    let geometry = &splats.geometry;
    assert_eq!(geometry.positions[0], [-1.0, 2.0, 3.0]);
    assert_eq!(
        geometry.rotations.iter().map(|q| q.map(f32::abs)).collect::<Vec<_>>(),
        [[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]
    );
    // 0 stands for less than half of the smallest size.
    let expected = [0.0, 0.2_f32.ln(), (0.5_f32 / 255.0).ln()];
    assert!(most(&geometry.scales[0], &expected) < 1e-6, "{:?}", geometry.scales[0]);
    assert_eq!(geometry.opacities[0], 100.0);
    assert!((geometry.opacities[1] - (0.4_f32 / 0.6).ln()).abs() < 1e-5);
    // Elements may lie apart.
    builder.replace("POSITION", 5126, false, &[[0; 16], [0; 16]].concat());
    let views = builder.json["bufferViews"].as_array_mut().unwrap();
    views.last_mut().unwrap()["byteStride"] = json!(16);
    builder.accessor_of("POSITION")["byteOffset"] = json!(4);
    assert_eq!(read(&builder.glb()).len(), 2);
}

/// The colour, without the base, that Gaussian `i` shows from `direction`.
fn shown(splats: &Splats, i: usize, direction: [f64; 3]) -> [f32; 3] {
    #[expect(clippy::cast_possible_truncation, reason = "directions are in single precision")]
    let basis = rest_basis(splats.degree, direction.map(|v| v as f32));
    let per = splats.degree.rest_per_channel();
    [0, 1, 2].map(|c| splats.rest(i)[c * per..(c + 1) * per].iter().zip(basis).map(|(a, b)| a * b).sum())
}

/// Twice the matrix of the ellipsoid of Gaussian `i`, along `direction`.
fn spread(splats: &Splats, i: usize, direction: [f64; 3]) -> f64 {
    let q = unit(splats.geometry.rotations[i]).map(f64::from);
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| turned(q, axis));
    let scales = splats.geometry.scales[i].map(|v| f64::from(v).exp());
    let dot = |a: [f64; 3]| (0..3).map(|k| a[k] * direction[k]).sum::<f64>();
    (0..3).map(|k| (scales[k] * dot(axes[k])).powi(2)).sum()
}

/// A scene whose node has a transformation looks as the transformed scene should.
#[test]
fn nodes_turn_scale_move_and_mirror_splats_and_what_they_show() {
    let plain = sample(3);
    let (bytes, _) = write(&plain, &WriteOptions::default()).unwrap();
    let json_end = 20 + u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let q = [0.5, 0.1, -0.7, 0.5_f64];
    let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    let [x, y, z, w] = q.map(|v| v / length);
    for (scale, sign) in [(1.0, 1.0), (2.5, 1.0), (1.5, -1.0)] {
        let mut builder = Builder {
            json: serde_json::from_slice(&bytes[20..json_end]).unwrap(),
            bin: bytes[json_end + 8..].to_vec(),
        };
        builder.json["nodes"] = json!([
            {"children": [1], "translation": [1, 2, 3]},
            {"mesh": 0, "rotation": [x, y, z, w], "scale": [scale, scale, sign * scale]},
        ]);
        let (splats, warnings) = opened(&builder.glb()).unwrap();
        assert_eq!(warnings.len(), usize::from(sign < 0.0), "{warnings:?}");
        #[expect(clippy::cast_possible_truncation, reason = "positions are in single precision")]
        let single = |v: [f64; 3]| v.map(|v| v as f32);
        let flip = |v: [f64; 3]| Flip::of(GLTF).position(single(v)).map(f64::from);
        let linear = |v: [f64; 3]| {
            let [a, b, c] = flip(v);
            flip(turned([w, x, y, z], [a, b, sign * c]))
        };
        for i in 0..plain.len() {
            let moved = linear(plain.geometry.positions[i].map(f64::from)).map(|v| v * scale);
            let expected = single([moved[0] - 1.0, moved[1] - 2.0, moved[2] + 3.0]);
            assert!(most(&splats.geometry.positions[i], &expected) < 1e-4, "{i}");
            for direction in [[0.36, 0.48, 0.8], [-0.48, 0.64, -0.6]] {
                let seen = linear(direction);
                let [before, after] = [shown(&plain, i, direction), shown(&splats, i, seen)];
                assert!(most(&before, &after) < 1e-5, "{i}");
                let [before, after] =
                    [spread(&plain, i, direction) * scale * scale, spread(&splats, i, seen)];
                assert!((before / after - 1.0).abs() < 1e-4, "{i}: {before} {after}");
            }
        }
    }
}

#[test]
fn primitives_of_all_nodes_become_one_scene() {
    let mut builder = Builder::new();
    builder.splats(2, 0);
    builder.splats(3, 2);
    let (spz, _) =
        spz::write(&sample(1), &WriteOptions { spz_version: 3, ..WriteOptions::default() }).unwrap();
    let view = builder.view(&spz);
    let compressed = json!({"KHR_gaussian_splatting_compression_spz_2": {"bufferView": view}});
    let words = json!({"kernel": "ellipse", "colorSpace": "srgb_rec709_display", "extensions": compressed});
    builder.primitive(json!({"mode": 0, "attributes": {}, "extensions": {WORD: words}}));
    builder.primitive(json!({"mode": 4, "attributes": {"POSITION": 0}}));
    builder.json["nodes"] = json!([{"mesh": 0, "children": [1]}, {"mesh": 0, "translation": [10, 0, 0]}]);
    let (splats, warnings) = opened(&builder.glb()).unwrap();
    assert_eq!((splats.len(), splats.degree.get()), (2 * 405, 2));
    assert_eq!(warnings, ["primitives that are not splats are left out: 2"]);
    assert!(splats.rest(0).iter().all(|v| *v == 0.0) && splats.rest(2)[7].abs() == 80.0);
    let alone = sample(1);
    assert!(
        most(splats.geometry.positions[5..405].as_flattened(), alone.geometry.positions.as_flattened())
            < 1e-3
    );
    let narrow = |i: usize| [0, 1, 2, 8, 9, 10, 16, 17, 18].map(|k| splats.rest(i)[k]);
    assert!(narrow(5) != [0.0; 9] && splats.rest(5)[3..8] == [0.0; 5]);
    assert_eq!(splats.geometry.positions[405], [-10.0, -2.0, 3.0]);
}

/// Drafts hold glTF's axes where an SPZ has its own: half a turn about y is between them.
#[test]
fn drafts_of_compression_are_read_along_their_axes() {
    let (spz, _) =
        spz::write(&sample(1), &WriteOptions { spz_version: 2, ..WriteOptions::default() }).unwrap();
    let read_with = |extensions: serde_json::Value| {
        let mut builder = Builder::new();
        builder.view(&spz);
        builder.primitive(json!({"mode": 0, "attributes": {}, "extensions": extensions}));
        read(&builder.glb())
    };
    let view = json!({"bufferView": 0});
    let nested = json!({"KHR_gaussian_splatting_compression_spz_2": view});
    let now = read_with(
        json!({WORD: {"kernel": "ellipse", "colorSpace": "srgb_rec709_display", "extensions": nested}}),
    );
    assert_eq!(now.degree, ShDegree::ONE);
    let about_y = Flip::of([true, false, true]);
    for draft in [json!({WORD: {"extensions": nested}}), json!({"KHR_spz_gaussian_splats_compression": view})]
    {
        let draft = read_with(draft);
        for (a, b) in now.geometry.positions.iter().zip(&draft.geometry.positions) {
            assert_eq!(about_y.position(*a), *b);
        }
    }
}

/// A file of another program (tests/data/README.md). It turns the ellipsoids' own axes about z, by half, beside ours.
#[test]
fn a_file_of_splat_transform_holds_the_scene() {
    let (found, warnings) = opened(include_bytes!("../../../tests/data/splat-transform.glb")).unwrap();
    assert_eq!(warnings, [""; 0]);
    let scene = lexisplat_sample::scene(&lexisplat_sample::SampleOptions::new(8, 1));
    let (a, b) = (&scene.geometry, &found.geometry);
    assert!(most(a.positions.as_flattened(), b.positions.as_flattened()) < 1e-6);
    assert!(a.dc == b.dc && most(&scene.sh_rest, &found.sh_rest) < 1e-6);
    assert!(most(a.scales.as_flattened(), b.scales.as_flattened()) < 1e-6);
    assert!(most(&a.opacities, &b.opacities) < 1e-5);
    for i in 0..scene.len() {
        for direction in [[1.0, 0.0, 0.0], [0.36, 0.48, 0.8], [-0.48, 0.64, -0.6]] {
            let [before, after] = [spread(&scene, i, direction), spread(&found, i, direction)];
            assert!((before / after - 1.0).abs() < 1e-5, "{i}: {before} {after}");
        }
    }
}
