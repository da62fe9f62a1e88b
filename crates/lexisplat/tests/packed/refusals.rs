//! What cannot be packed or unpacked is refused, and the error names it.

use lexisplat::lexi::{self, LexiReader};
use lexisplat::packed::{PackOptions, Packed, Packer};
use lexisplat::{Error, Limits, Sensitivity, Silent, Splats};

use super::support::{STEP, bytes, options, pack, sample, with_extras};
use crate::parts::Parts;

fn refused(splats: &Splats, sensitivity: &Sensitivity, options: &PackOptions) -> String {
    let error = Packer::new(splats, sensitivity, options).unwrap_err();
    assert!(matches!(error, Error::Parameter { .. }), "{error}");
    error.to_string()
}

#[test]
fn steps_out_of_range_are_named() {
    let splats = sample(20, 51, 3);
    let packer =
        Packer::new(&splats, &Sensitivity::heuristic(&splats.geometry), &PackOptions::default()).unwrap();
    for (step, name) in
        [(0.0, "step = 0"), (-1e-5, "step = -"), (f64::NAN, "step = NaN"), (f64::INFINITY, "step = inf")]
    {
        let error = packer.pack(step, &Silent).unwrap_err();
        assert!(matches!(error, Error::Parameter { .. }) && error.to_string().starts_with(name), "{error}");
    }
}

#[test]
fn options_out_of_range_are_named() {
    let splats = sample(20, 52, 3);
    let sensitivity = Sensitivity::heuristic(&splats.geometry);
    let run = |change: fn(&mut PackOptions)| refused(&splats, &sensitivity, &options(change));
    assert!(run(|o| o.atoms = Some(0)).starts_with("atoms = 0: 1 to 1024"));
    assert!(run(|o| o.atoms = Some(1025)).starts_with("atoms = 1025"));
    assert!(run(|o| o.tolerance = Some(0.0)).starts_with("tolerance = 0"));
    assert!(run(|o| o.tolerance = Some(-0.1)).starts_with("tolerance = -0.1"));
    assert!(run(|o| o.tolerance = Some(f64::NAN)).starts_with("tolerance = NaN"));
    assert!(run(|o| o.tolerance = Some(f64::INFINITY)).starts_with("tolerance = inf"));
}

#[test]
fn the_most_atoms_there_may_be_work() {
    let splats = sample(600, 53, 1);
    for atoms in [1, 256, 257, 1024] {
        let (packed, _) = pack(&splats, STEP, &options(|o| o.atoms = Some(atoms)));
        assert!((1..=atoms).contains(&packed.head().atoms));
        assert_eq!(packed.unpack().unwrap().dictionary().len(), packed.head().atoms);
    }
}

#[test]
fn weights_that_do_not_fit_the_scene_are_named() {
    let splats = sample(20, 54, 3);
    let run = |change: fn(&mut Sensitivity)| {
        let mut sensitivity = Sensitivity::heuristic(&splats.geometry);
        change(&mut sensitivity);
        let text = refused(&splats, &sensitivity, &PackOptions::default());
        assert!(text.starts_with("sensitivity = "), "{text}");
        text
    };
    assert!(run(|s| *s = Sensitivity::zeros(19)).starts_with("sensitivity = 19: 20 entries"));
    run(|s| _ = s.opacity.pop());
    run(|s| _ = s.position.pop());
    run(|s| s.scale.push([0.0; 3]));
    run(|s| s.rotation.clear());
    assert!(run(|s| s.colour[3] = f32::NAN).contains("NaN"));
    run(|s| s.position[19][5] = f32::INFINITY);
}

#[test]
fn values_that_are_not_finite_are_named() {
    let run = |change: fn(&mut Splats)| {
        let mut splats = sample(20, 55, 3);
        let sensitivity = Sensitivity::heuristic(&splats.geometry);
        change(&mut splats);
        refused(&splats, &sensitivity, &PackOptions::default())
    };
    assert!(run(|s| s.geometry.positions[3][1] = f32::NAN).starts_with("positions = NaN"));
    assert!(run(|s| s.geometry.dc[3][1] = f32::INFINITY).starts_with("dc = inf"));
    assert!(run(|s| s.geometry.opacities[3] = f32::NEG_INFINITY).starts_with("opacities = -inf"));
    assert!(run(|s| s.geometry.scales[3][0] = f32::NAN).starts_with("scales = NaN"));
    assert!(run(|s| s.geometry.rotations[3][0] = f32::NAN).starts_with("rotations = NaN"));
    assert!(run(|s| s.sh_rest[3] = f32::NAN).starts_with("sh_rest = NaN"));
    assert!(run(|s| _ = s.sh_rest.pop()).starts_with("sh_rest = 899"));
    assert!(run(|s| _ = s.geometry.dc.pop()).starts_with("dc = 19"));
}

/// A file that no reader takes must not be written.
#[test]
fn values_too_large_to_decode_are_refused() {
    let run = |change: fn(&mut Splats)| {
        let mut splats = sample(200, 56, 1);
        change(&mut splats);
        let sensitivity = Sensitivity::heuristic(&splats.geometry);
        let packer = Packer::new(&splats, &sensitivity, &PackOptions::default()).unwrap();
        packer.pack(STEP, &Silent).map(|(packed, _)| packed.unpack().unwrap())
    };
    let changes: [fn(&mut Splats); 4] = [
        |s| s.geometry.positions[3] = [f32::MAX; 3],
        |s| s.geometry.positions[3..5].copy_from_slice(&[[f32::MAX; 3], [f32::MIN; 3]]),
        |s| s.geometry.dc[3] = [f32::MAX; 3],
        |s| s.geometry.dc.fill([f32::MIN; 3]),
    ];
    for change in changes {
        // Either is fine, but not a file that cannot be unpacked.
        if let Err(error) = run(change) {
            assert!(error.to_string().starts_with("values = too large"), "{error}");
        }
    }
    run(|s| s.geometry.dc[3] = [1e30; 3]).unwrap();
}

fn set(parts: &mut Parts, key: &str, value: &str) {
    parts.metadata.insert(key.to_owned(), value.into());
}

fn cut(parts: &mut Parts, name: &str, bytes: usize) {
    let tensor = parts.tensor(name).unwrap();
    tensor.truncate(tensor.len() - bytes);
}

fn words<'a>(parts: &'a mut Parts, name: &str) -> &'a mut [[u8; 4]] {
    parts.tensor(name).unwrap().as_chunks_mut().0
}

#[test]
fn a_packed_scene_changed_by_hand_is_refused() {
    let splats = sample(200, 57, 2);
    let (good, _) = pack(&with_extras(splats.clone()), STEP, &options(|o| o.keep_order = true));
    let (plain, _) = pack(&splats, STEP, &options(|_| ()));
    type Change = fn(&mut Parts);
    let changes: [(&Packed, &str, Change); 14] = [
        (&good, "order", |p| cut(p, "packed.order", 4)),
        (&good, "order", |p| p.tensor("packed.order").unwrap().extend([200, 0, 0, 0])),
        (&good, "order", |p| words(p, "packed.order")[3] = [200, 0, 0, 0]),
        (&good, "order", |p| words(p, "packed.order")[3] = words(p, "packed.order")[4]),
        (&good, "parameters", |p| cut(p, "packed.parameters", 4)),
        (&good, "parameters", |p| words(p, "packed.parameters")[0] = f32::NAN.to_le_bytes()),
        (&good, "tables", |p| cut(p, "packed.tables", 1)),
        (&good, "lengths", |p| words(p, "packed.lengths")[0][0] ^= 1),
        (&good, "lengths", |p| cut(p, "packed.data", 1)),
        (&plain, "lengths", |p| set(p, "gaussians", "0")),
        (&plain, "chunk 0", |p| set(p, "gaussians", "199")),
        (&plain, "dictionary", |p| set(p, "atoms", "0")),
        (&plain, "dictionary", |p| set(p, "degree", "0")),
        (&good, "extra", |p| cut(p, "extra.label", 1)),
    ];
    for (packed, name, change) in changes {
        let mut parts = Parts::of(&bytes(packed));
        change(&mut parts);
        parts.fit_shapes();
        let error = lexi::read_bytes("p.lexi", &parts.sealed(), &Limits::default()).unwrap_err();
        let said = error.to_string();
        assert!(matches!(error, Error::Format { .. }) && said.starts_with("p.lexi: "), "{name}: {said}");
        assert!(said.contains(name), "{name}: {said}");
    }
    let unchanged = Parts::of(&bytes(&good)).sealed();
    assert_eq!(lexi::read_bytes("p.lexi", &unchanged, &Limits::default()).unwrap(), good.unpack().unwrap());
}

#[test]
fn more_gaussians_than_a_file_can_hold_are_refused_before_decoding() {
    let (packed, _) = pack(&sample(50, 58, 1), STEP, &PackOptions::default());
    let mut parts = Parts::of(&bytes(&packed));
    set(&mut parts, "gaussians", &(4 * bytes(&packed).len()).to_string());
    let error = LexiReader::open("p.lexi", parts.sealed(), &Limits::default()).unwrap_err();
    assert!(matches!(error, Error::Limit { .. }), "{error}");
}
