//! Written files are read back.

use lexisplat::{Error, ShDegree};

use super::super::write::{share, write};
use super::{most, opened, read, sample};
use crate::spz;
use crate::write_options::WriteOptions;

#[test]
fn floats_come_back_and_so_do_the_bytes() {
    for degree in 0..=3 {
        let splats = sample(degree);
        let (bytes, lost) = write(&splats, &WriteOptions::default()).unwrap();
        assert_eq!((lost.sh_degree, lost.limited), (None, 0));
        let (found, warnings) = opened(&bytes).unwrap();
        assert_eq!(warnings, [""; 0]);
        let (a, b) = (&splats.geometry, &found.geometry);
        assert_eq!(
            (a.positions == b.positions, a.dc == b.dc, a.rotations == b.rotations),
            (true, true, true)
        );
        assert!(found.sh_rest == splats.sh_rest && found.degree == splats.degree);
        assert!(most(a.scales.as_flattened(), b.scales.as_flattened()) < 1e-6);
        let shares = |opacities: &[f32]| opacities.iter().map(|v| share(*v)).collect::<Vec<_>>();
        assert_eq!(shares(&a.opacities), shares(&b.opacities));
        assert!(write(&found, &WriteOptions::default()).unwrap().0 == bytes, "degree {degree}");
    }
}

/// The offset is the translation of the node, in doubles.
#[test]
fn an_offset_comes_back() {
    for glb_spz in [false, true] {
        let mut splats = sample(1);
        splats.meta.offset = lexisplat::Offset::new([500_000.0, 4_649_776.5, -128.0]).unwrap();
        let (bytes, lost) = write(&splats, &WriteOptions { glb_spz, ..WriteOptions::default() }).unwrap();
        assert_eq!((lost.offset, lost.coarse.len()), (None, 0));
        let found = read(&bytes);
        assert_eq!(found.meta.offset, splats.meta.offset);
        let (a, b) = (&found.geometry.positions, &splats.geometry.positions);
        assert!(most(a.as_flattened(), b.as_flattened()) <= if glb_spz { 2e-4 } else { 0.0 });
        splats.meta.offset = None;
        assert_eq!(spz::write(&splats, &WriteOptions::default()).unwrap().1.offset, None);
    }
}

/// Values that floats hold badly or not at all.
#[test]
fn extreme_values_come_back_or_are_limited() {
    let mut splats = sample(1);
    let geometry = &mut splats.geometry;
    geometry.positions[0] = [-0.0, 0.0, 1e-40];
    geometry.scales[0] = [-200.0, 200.0, -100.0];
    geometry.opacities[..4].copy_from_slice(&[-100.0, 100.0, 20.0, -20.0]);
    geometry.rotations[0] = [0.0; 4];
    geometry.rotations[1] = [2.0, 0.0, 0.0, 0.0];
    let (bytes, lost) = write(&splats, &WriteOptions::default()).unwrap();
    assert_eq!(lost.limited, 1);
    let found = read(&bytes);
    assert_eq!(found.geometry.positions[0].map(f32::to_bits), splats.geometry.positions[0].map(f32::to_bits));
    let [tiny, huge, small] = found.geometry.scales[0];
    assert!((-104.0..-103.0).contains(&tiny) && (huge - 88.72).abs() < 0.01 && (small + 100.0).abs() < 0.1);
    assert_eq!(found.geometry.opacities[..3], [-100.0, 100.0, 100.0]);
    assert!((found.geometry.opacities[3] + 20.0).abs() < 1e-5);
    assert_eq!(found.geometry.rotations[..2], [[1.0, 0.0, 0.0, 0.0]; 2]);
    assert!(write(&found, &WriteOptions::default()).unwrap().0 == bytes);
}

#[test]
fn an_spz_inside_is_that_of_the_spz_writer() {
    let options = WriteOptions { glb_spz: true, ..WriteOptions::default() };
    for degree in 0..=3 {
        let mut splats = sample(degree);
        splats.meta.antialiased = degree == 1;
        let (bytes, lost) = write(&splats, &options).unwrap();
        assert!(!lost.antialiased && lost.precision.len() >= 4);
        let (found, warnings) = opened(&bytes).unwrap();
        assert_eq!(warnings, [""; 0]);
        assert_eq!(found.meta.antialiased, degree == 1);
        let (alone, _) = spz::write(&splats, &WriteOptions { spz_version: 2, ..options }).unwrap();
        let expected = {
            let options = lexisplat::ply::ReadOptions::default();
            let siblings = crate::siblings::Siblings::NONE;
            let opened =
                crate::open::open("a.spz", &alone, siblings, &options, true, &lexisplat::Silent).unwrap();
            opened.source().whole().unwrap().into_owned()
        };
        assert!(found == expected, "degree {degree}");
        assert!(write(&found, &options).unwrap().0 == bytes, "degree {degree}");
    }
}

#[test]
fn degree_4_is_cut_and_empty_scenes_are_refused() {
    let mut splats = sample(3);
    splats.sh_rest = vec![0.25; 72 * splats.len()];
    splats.degree = ShDegree::new(4).unwrap();
    for glb_spz in [false, true] {
        let options = WriteOptions { glb_spz, ..WriteOptions::default() };
        let (bytes, lost) = write(&splats, &options).unwrap();
        assert_eq!(lost.sh_degree, Some([4, 3]));
        assert_eq!(read(&bytes).degree, ShDegree::THREE);
    }
    splats.retain(&vec![false; splats.len()]);
    let error = write(&splats, &WriteOptions::default()).unwrap_err();
    assert!(matches!(error, Error::Parameter { .. }), "{error}");
}
