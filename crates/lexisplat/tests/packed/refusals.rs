//! Scenes that cannot be packed or unpacked are refused, and the error names the reason.

use lexisplat::lexi::{self, LexiReader};
use lexisplat::packed::{PackOptions, Packer};
use lexisplat::{Error, Extra, ExtraValues, Limits, Sensitivity, Silent, Splats};

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
        Packer::new(&splats, &Sensitivity::guess(&splats.geometry), &PackOptions::default()).unwrap();
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
    let sensitivity = Sensitivity::guess(&splats.geometry);
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
        let mut sensitivity = Sensitivity::guess(&splats.geometry);
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
        let sensitivity = Sensitivity::guess(&splats.geometry);
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
        let sensitivity = Sensitivity::guess(&splats.geometry);
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

type Change = fn(&mut Parts);

/// Each change makes a file that is refused with this word.
fn assert_refused(bytes: &[u8], changes: &[(&str, Change)]) {
    for (number, (word, change)) in changes.iter().enumerate() {
        let mut parts = Parts::of(bytes);
        change(&mut parts);
        parts.fit_shapes();
        let error = lexi::read_bytes("p.lexi", &parts.sealed(), &Limits::default()).unwrap_err();
        let said = error.to_string();
        assert!(matches!(error, Error::Format { .. }) && said.starts_with("p.lexi: "), "{number}: {said}");
        assert!(said.contains(word), "{number}, {word}: {said}");
    }
}

/// Takes the values of a column that is not drawn for the order.
fn order_from(parts: &mut Parts, column: &str) {
    let bytes = parts.tensor(column).unwrap().clone();
    parts.tensors.retain(|t| t.0 != column);
    *parts.tensor("packed.order").unwrap() = bytes;
}

#[test]
fn a_packed_scene_changed_by_hand_is_refused() {
    let mut splats = with_extras(sample(200, 57, 2));
    let column = |name: &str, values| Extra { name: name.to_owned(), values };
    splats.geometry.extras.extend([
        column("past", ExtraValues::U32((1..=200).collect())),
        column("real", ExtraValues::F32(vec![0.0; 200])),
        column("zeros", ExtraValues::U32(vec![0; 200])),
    ]);
    let (good, _) = pack(&splats, STEP, &options(|o| o.keep_order = true));
    let (plain, _) = pack(&sample(200, 57, 2), STEP, &options(|_| ()));
    assert_refused(
        &bytes(&good),
        &[
            ("order", |p| cut(p, "packed.order", 4)),
            ("order", |p| p.tensor("packed.order").unwrap().extend([200, 0, 0, 0])),
            ("order", |p| p.tensor("packed.order").unwrap().clear()),
            ("'packed.order' is not a permutation", |p| order_from(p, "extra.zeros")),
            ("'packed.order' is not a permutation", |p| order_from(p, "extra.past")),
            ("'packed.order' is not of u32", |p| order_from(p, "extra.real")),
            ("head", |p| cut(p, "packed.head", 1)),
            ("head", |p| p.tensor("packed.head").unwrap().push(0)),
            ("head", |p| p.tensor("packed.head").unwrap().clear()),
            ("head", |p| p.tensors.retain(|t| t.0 != "packed.head")),
            ("checksum of 'range 0 of chunk 0'", |p| p.tensor("packed.data").unwrap()[0] ^= 1),
            ("ranges", |p| cut(p, "packed.data", 1)),
            ("ranges", |p| p.tensor("packed.data").unwrap().push(0)),
            ("extra", |p| cut(p, "extra.label", 1)),
        ],
    );
    assert_refused(
        &bytes(&plain),
        &[
            ("head", |p| set(p, "gaussians", "0")),
            ("head", |p| set(p, "gaussians", "199")),
            ("head", |p| set(p, "degree", "0")),
            ("'offset'", |p| set(p, "offset", "[1.5,2.0]")),
            ("'offset'", |p| set(p, "offset", "[1.5,2.0,\"3\"]")),
            ("'offset'", |p| set(p, "offset", "[1e999,0,0]")),
            ("'offset'", |p| set(p, "offset", "1.5")),
        ],
    );
    for packed in [good, plain] {
        let unchanged = Parts::of(&bytes(&packed)).sealed();
        let read = lexi::read_bytes("p.lexi", &unchanged, &Limits::default()).unwrap();
        assert_eq!(read, packed.unpack().unwrap());
    }
}

#[test]
fn more_gaussians_than_a_file_can_hold_are_refused_before_decoding() {
    let (packed, _) = pack(&sample(50, 58, 1), STEP, &PackOptions::default());
    let mut parts = Parts::of(&bytes(&packed));
    set(&mut parts, "gaussians", &(4 * bytes(&packed).len()).to_string());
    let error = LexiReader::open("p.lexi", parts.sealed(), &Limits::default()).unwrap_err();
    // No limit helps, so it is damage.
    assert!(matches!(error, Error::Format { .. }), "{error}");
    assert!(error.to_string().contains("metadata 'gaussians' is "), "{error}");
}

/// Found by the fuzz target `packed`: the reader in parts took it.
#[test]
fn an_order_of_no_gaussians_has_no_bytes_after_it() {
    let packed = pack(&sample(0, 1, 1), STEP, &options(|o| o.keep_order = true)).0;
    let file = bytes(&packed);
    assert!(LexiReader::open("empty.lexi", &file[..], &Limits::default()).is_ok());
    let mut parts = Parts::of(&file);
    parts.tensor("packed.order").unwrap().extend([0; 84]);
    parts.fit_shapes();
    let file = parts.sealed();
    let error = LexiReader::open("empty.lexi", &file[..], &Limits::default()).unwrap_err();
    assert!(error.to_string().contains("packed.order"), "{error}");
}
