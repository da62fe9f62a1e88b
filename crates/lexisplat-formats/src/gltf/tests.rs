//! Tests of reading and writing.

use lexisplat::ply::ReadOptions;
use lexisplat::{Result, ShDegree, Silent, Splats};
use lexisplat_sample::{SampleOptions, scene};

use super::write::{self, write};
use crate::kind::Kind;
use crate::open::open;
use crate::siblings::Siblings;
use crate::write::WriteOptions;

/// The scene in `bytes`, and the warnings about it.
fn opened(bytes: &[u8]) -> Result<(Splats, Vec<String>)> {
    let opened = open("a.glb", bytes, Siblings::NONE, &ReadOptions::default(), true, &Silent)?;
    assert_eq!(opened.kind(), Kind::Gltf);
    Ok((opened.source().whole()?.into_owned(), opened.source().warnings().to_vec()))
}

fn read(bytes: &[u8]) -> Splats {
    opened(bytes).unwrap().0
}

/// A scene of `degree`, whose quaternions have length 1.
fn sample(degree: u8) -> Splats {
    let mut splats = scene(&SampleOptions::new(400, 2));
    for q in &mut splats.geometry.rotations {
        *q = write::unit(*q);
    }
    let degree = ShDegree::new(degree).unwrap();
    if degree < splats.degree {
        splats = splats.with_degree_cut(degree);
    }
    splats
}

fn most(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn floats_come_back_and_so_do_the_bytes() {
    for degree in 0..=3 {
        let splats = sample(degree);
        let (bytes, lost) = write(&splats, &WriteOptions::default()).unwrap();
        assert_eq!((lost.sh_degree, lost.limited), (None, 0));
        let found = read(&bytes);
        let (a, b) = (&splats.geometry, &found.geometry);
        assert_eq!(
            (a.positions == b.positions, a.dc == b.dc, a.rotations == b.rotations),
            (true, true, true)
        );
        assert!(found.sh_rest == splats.sh_rest && found.degree == splats.degree);
        assert!(most(a.scales.as_flattened(), b.scales.as_flattened()) < 1e-6);
        let shares = |opacities: &[f32]| opacities.iter().map(|v| write::share(*v)).collect::<Vec<_>>();
        assert_eq!(shares(&a.opacities), shares(&b.opacities));
        assert!(write(&found, &WriteOptions::default()).unwrap().0 == bytes, "degree {degree}");
    }
}
