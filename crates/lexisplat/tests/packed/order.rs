//! Packing sorts the Gaussians; what belongs together stays together, and the order comes back if kept.

use lexisplat::{Splats, ply};

use super::support::{STEP, distance, options, pack, row_errors, sample, size, with_extras};

/// A scene with escapes, whose rows are kept apart from the others'.
fn scene() -> Splats {
    let mut splats = with_extras(sample(1500, 11, 1));
    for row in splats.sh_rest.chunks_exact_mut(9).step_by(400) {
        row.fill(1e5);
    }
    splats
}

/// All values of Gaussian `i`, bit for bit.
fn key(splats: &Splats, i: usize) -> Vec<u8> {
    let mut one = splats.clone();
    one.retain(&(0..splats.len()).map(|k| k == i).collect::<Vec<bool>>());
    let mut bytes = Vec::new();
    ply::write(&mut bytes, &one).unwrap();
    bytes
}

#[test]
fn a_kept_order_is_that_of_the_source() {
    let splats = scene();
    let (packed, report) = pack(&splats, STEP, &options(|o| o.keep_order = true));
    assert_eq!(report.escapes, 4);
    let back = packed.unpack().unwrap().into_splats();
    assert_eq!(back.geometry.extras, splats.geometry.extras);
    for i in 0..splats.len() {
        let (a, b) = (splats.geometry.positions[i], back.geometry.positions[i]);
        // Nearer to its original than to most neighbours, which are about a size apart.
        assert!(distance(&a, &b) < 0.25 * size(&splats, i), "Gaussian {i}: {a:?} {b:?}");
    }
    let worst = row_errors(&splats, &back).into_iter().fold(0.0, f64::max);
    assert!(worst < 0.5, "{worst}: codes belong to others");
    assert!(!packed.order().unwrap().is_sorted(), "a scene already sorted would prove nothing");
}

#[test]
fn without_the_order_the_same_gaussians_come_back() {
    let splats = scene();
    let (kept, _) = pack(&splats, STEP, &options(|o| o.keep_order = true));
    let (free, _) = pack(&splats, STEP, &options(|_| ()));
    assert_eq!((kept.data(), kept.head()), (free.data(), free.head()), "the order is beside the streams");
    let order = kept.order().unwrap().to_vec();
    let (kept, free) = (kept.unpack().unwrap().into_splats(), free.unpack().unwrap().into_splats());
    let mut seen = vec![false; splats.len()];
    for (k, &source) in order.iter().enumerate() {
        let source = source as usize;
        assert!(!std::mem::replace(&mut seen[source], true), "Gaussian {source} comes twice");
        assert_eq!(key(&free, k), key(&kept, source), "Gaussian {source}, extras and SH included");
    }
}
