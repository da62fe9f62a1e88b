//! Tests of reading and writing.

mod build;
mod hostile;
mod placed;
mod round;

use lexisplat::ply::ReadOptions;
use lexisplat::{Result, ShDegree, Silent, Splats};
use lexisplat_sample::{SampleOptions, scene};

use super::write::unit;
use crate::kind::Kind;
use crate::open::open;
use crate::siblings::Siblings;

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
        *q = unit(*q);
    }
    let degree = ShDegree::new(degree).unwrap();
    if degree < splats.degree { splats.with_degree_cut(degree) } else { splats }
}

/// The largest difference.
fn most(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}
