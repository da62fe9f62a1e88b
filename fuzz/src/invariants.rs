//! Rules for every scene that a reader accepted.

use lexisplat::lexi::LexiWriter;
use lexisplat::{CodeLayout, Geometry, Indices, Model, Silent, SparseCodes, Splats, lexi, ply};

/// Gaussians up to which a scene is made dense and written: more says nothing new and takes long.
const SMALL: usize = 4096;

/// Every number that is drawn is finite, and every array as long as the others.
///
/// # Panics
/// If not.
pub fn splats(splats: &Splats) {
    splats.validate().expect("arrays fit");
    geometry(&splats.geometry);
    assert!(splats.sh_rest.iter().all(|v| v.is_finite()), "SH-rest not finite");
}

fn geometry(g: &Geometry) {
    let arrays = [
        g.positions.as_flattened(),
        g.normals.as_flattened(),
        g.dc.as_flattened(),
        &g.opacities,
        g.scales.as_flattened(),
        g.rotations.as_flattened(),
    ];
    assert!(arrays.iter().all(|values| values.iter().all(|v| v.is_finite())), "geometry not finite");
}

/// Codes name atoms that are there, in order, with finite values.
fn codes(codes: &SparseCodes, atoms: usize, dim: usize) {
    let indices: Vec<usize> = match codes.indices() {
        Indices::U8(v) => v.iter().map(|&i| usize::from(i)).collect(),
        Indices::U16(v) => v.iter().map(|&i| usize::from(i)).collect(),
    };
    assert!(indices.iter().all(|&i| i < atoms), "an atom that is not there");
    let total: usize = codes.counts().iter().map(|&c| usize::from(c)).sum();
    assert_eq!(total, indices.len());
    assert!(codes.counts().iter().all(|&c| usize::from(c) <= dim));
    let mut start = 0;
    for &count in codes.counts() {
        let own = &indices[start..start + usize::from(count)];
        assert!(own.windows(2).all(|w| w[0] < w[1]), "atoms out of order");
        start += own.len();
    }
    let escapes = codes.escapes();
    assert_eq!(escapes.rows.len(), escapes.gaussians.len() * dim);
    assert!(escapes.gaussians.iter().all(|&g| (g as usize) < codes.len()));
}

/// As [`splats`] for a model, of which nothing is made dense.
///
/// # Panics
/// If not.
pub fn decoded(model: &Model) {
    geometry(model.geometry());
    model.geometry().validate().expect("arrays fit");
    assert_eq!(model.codes().len(), model.len());
    codes(model.codes(), model.dictionary().len(), model.dictionary().dim());
    assert!(model.dense_rest().iter().all(|v| v.is_finite()), "SH-rest not finite");
}

/// As [`splats`] for a model, and that small ones decode and can be written and read again.
///
/// # Panics
/// If not.
pub fn model(model: &Model) {
    geometry(model.geometry());
    assert_eq!(model.codes().len(), model.len());
    codes(model.codes(), model.dictionary().len(), model.dictionary().dim());
    if model.len() > SMALL {
        return;
    }
    let dense = model.clone().into_splats();
    splats(&dense);
    let mut bytes = Vec::new();
    match ply::write(&mut bytes, &dense) {
        Ok(_) => {}
        // Names of extras that a PLY cannot hold.
        Err(error) if error.to_string().starts_with("extra = ") => return,
        Err(error) => panic!("{error}"),
    }
    let again = ply::read_bytes("again.ply", &bytes, &ply::ReadOptions::default());
    let again = match again {
        Ok(read) => read,
        Err(error) if may_mean_something_else(&dense) => return assert!(!error.to_string().is_empty()),
        Err(error) => panic!("what was written cannot be read: {error}"),
    };
    assert_eq!(again.splats.len(), dense.len());
}

/// Extras of a .lexi file may bear names that mean something to a PLY reader.
fn may_mean_something_else(splats: &Splats) -> bool {
    let names = ["f_rest_", "f_anchor_feat_0", "packed_position"];
    splats.geometry.extras.iter().any(|e| names.iter().any(|n| e.name.starts_with(n)))
}

/// A model of an exact layout comes back from its file as it was.
///
/// # Panics
/// If not.
pub fn exact_round_trip(model: &Model, codes: CodeLayout) {
    let written = |model: &Model| {
        let mut bytes = Vec::new();
        let writer = LexiWriter::exact(model, codes).expect("what was read can be written");
        writer.write(&mut bytes, &Silent).expect("what was read can be written");
        bytes
    };
    let bytes = written(model);
    let again =
        lexi::read_bytes("again.lexi", &bytes, &crate::limits()).expect("what was written can be read");
    assert!(bytes == written(&again), "written, read and written again differs");
}
