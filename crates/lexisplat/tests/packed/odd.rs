//! Scenes no trainer makes: they pack, and what comes back is finite and said here.

use lexisplat::packed::{PackOptions, Packer};
use lexisplat::{Limits, Sensitivity, Silent, Splats, lexi};

use super::support::{STEP, bytes, copies, distance, options, pack, returned, row_errors, sample, size};

fn changed(gaussians: usize, change: impl FnOnce(&mut Splats)) -> (Splats, Splats) {
    let mut splats = sample(gaussians, 41, 3);
    change(&mut splats);
    let back = returned(&splats, STEP, &PackOptions::default());
    (splats, back)
}

#[test]
fn copies_of_one_gaussian_come_back_alike() {
    let splats = copies(&sample(1, 42, 3), 1000);
    let back = returned(&splats, STEP, &PackOptions::default());
    let g = &back.geometry;
    assert!(g.positions.iter().all(|p| distance(p, &splats.geometry.positions[0]) < 1e-6));
    assert!(g.dc.iter().all(|dc| distance(dc, &splats.geometry.dc[0]) < 1e-6));
    assert!(row_errors(&splats, &back).iter().all(|&e| e < 0.01));
    // Predictions are made of features that are multiples of 2^-9, so the copies differ by a few of these.
    assert!(g.scales.iter().all(|s| distance(s, &g.scales[0]) < 4.0 / 512.0));
    let (packed, _) = pack(&splats, STEP, &PackOptions::default());
    let each = packed.data().len() as f64 / 1000.0;
    assert!(each < 6.0, "{each} bytes for each copy, which says nothing new but a rotation");
}

/// A reader refuses files that promise more Gaussians than their bytes can hold; these are the most.
#[test]
fn the_cheapest_gaussians_there_are_can_be_read() {
    let splats = copies(&sample(1, 43, 0), 100_000);
    let sensitivity = Sensitivity::guess(&splats.geometry);
    let packer = Packer::new(&splats, &sensitivity, &PackOptions::default()).unwrap();
    let (packed, _) = packer.quantise(1e300, false, &Silent).unwrap().finish(None, None, &Silent).unwrap();
    let bytes = bytes(&packed);
    assert!(bytes.len() < 50_000, "{}", bytes.len());
    let model = lexi::read_bytes("copies.lexi", &bytes, &Limits::default()).unwrap();
    assert_eq!(model.len(), 100_000);
}

#[test]
fn no_view_dependence_takes_no_codes() {
    let (splats, back) = changed(500, |s| s.sh_rest.fill(0.0));
    assert!(back.sh_rest.iter().all(|&v| v == 0.0));
    let (packed, report) = pack(&splats, STEP, &PackOptions::default());
    assert_eq!((packed.head().atoms, report.mean_nonzeros, packed.head().record.max_residual), (1, 0.0, 0.0));
}

/// 0.9999 is the most that is kept apart from opaque. The least that is kept is e^-16, of which a byte shows nothing.
#[test]
fn extreme_opacities_stay_at_their_end() {
    let (splats, back) = changed(100, |s| {
        for (i, opacity) in s.geometry.opacities.iter_mut().enumerate() {
            *opacity = [20.0, -20.0][i % 2];
        }
    });
    for (i, &x) in back.geometry.opacities.iter().enumerate() {
        let opacity = 1.0 / (1.0 + (-f64::from(x)).exp());
        if splats.geometry.opacities[i] > 0.0 {
            assert!((0.99..0.99991).contains(&opacity), "Gaussian {i}: {opacity}");
        } else {
            assert!(opacity < 1e-3, "Gaussian {i}: {opacity}");
        }
    }
    for extreme in [1e30, f32::MAX, -1e30, f32::MIN] {
        let (_, back) = changed(100, |s| s.geometry.opacities[7] = extreme);
        let x = back.geometry.opacities[7];
        assert!(if extreme > 0.0 { x > 9.0 } else { (-16.1..-15.8).contains(&x) }, "{extreme:e} became {x}");
    }
}

/// One stray Gaussian stretches the grid until all others lie in a single cell.
#[test]
fn outliers_cost_the_others_nothing() {
    let (splats, back) = changed(800, |s| {
        s.geometry.positions[5] = [3e6, -2e6, 1e6];
        s.geometry.positions[6] = [-3e6; 3];
    });
    for i in 0..splats.len() {
        let moved = distance(&splats.geometry.positions[i], &back.geometry.positions[i]);
        // f32 itself has steps of a quarter out there.
        let allowed = if i == 5 || i == 6 { 1.0 } else { 0.1 * size(&splats, i) };
        assert!(moved < allowed, "Gaussian {i} moved by {moved}");
    }
}

#[test]
fn zero_and_huge_quaternions_stand_for_the_identity_and_themselves() {
    let (splats, back) = changed(300, |s| s.geometry.rotations.fill([0.0; 4]));
    for (i, scales) in back.geometry.scales.iter().enumerate() {
        // Axes may swap places with their scales; along each world axis the extent is the old one.
        let q = back.geometry.rotations[i];
        let [w, x, y, z] = q;
        let rows = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ];
        let largest = (0..3).max_by(|&a, &b| scales[a].total_cmp(&scales[b])).unwrap();
        let original = splats.geometry.scales[i];
        let along = (0..3).max_by(|&a, &b| original[a].total_cmp(&original[b])).unwrap();
        assert!(rows[along][largest].abs() > 0.8, "Gaussian {i}: {q:?} {scales:?} {original:?}");
    }
    changed(300, |s| s.geometry.rotations.fill([f32::MAX, f32::MIN, f32::MAX, 0.0]));
    changed(300, |s| s.geometry.rotations[9] = [1e-40; 4]);
}

#[test]
fn numbers_below_normal_come_back_as_good_as_zero() {
    let tiny = 1e-41;
    let (_, back) = changed(300, |s| {
        let g = &mut s.geometry;
        g.positions.fill([tiny; 3]);
        g.dc.fill([-tiny; 3]);
        g.opacities.fill(tiny);
        g.scales.fill([tiny; 3]);
        s.sh_rest.fill(tiny);
    });
    let g = &back.geometry;
    let values = g.positions.as_flattened().iter().chain(g.dc.as_flattened()).chain(&back.sh_rest);
    assert!(values.chain(g.scales.as_flattened()).all(|v| v.abs() < 1e-5));
    // Its logarithm is that of a half, and has an average that is a multiple of 2^-9 where there are no neighbours. The
    // logit moves by at most 2 for each 1 of the logarithm there.
    assert!(g.opacities.iter().all(|v| v.abs() < 2.0 * 2.0 / 512.0));
}

/// Sizes end where exp leaves f32, and thinness where pictures no longer show it.
#[test]
fn extreme_scales_end_at_the_limits() {
    let (_, back) = changed(300, |s| {
        let scales = &mut s.geometry.scales;
        scales[1] = [f32::MAX; 3];
        scales[2] = [f32::MIN; 3];
        scales[3] = [-30.0, -2.0, -30.0];
    });
    let sorted = |i: usize| {
        let mut scales = back.geometry.scales[i];
        scales.sort_by(|a, b| b.total_cmp(a));
        scales
    };
    assert!(sorted(1).iter().all(|s| (s - 40.0).abs() < 1.0), "{:?}", sorted(1));
    assert!(sorted(2).iter().all(|s| (-50.0..-39.0).contains(s)), "{:?}", sorted(2));
    let [long, middle, short] = sorted(3);
    assert!((long + 2.0).abs() < 0.5 && (middle + 11.0).abs() < 1.0 && (short + 11.0).abs() < 1.0);
}

/// A Gaussian too large to be drawn must not appear because sizes end at a limit.
#[test]
fn what_is_too_large_to_be_drawn_stays_unseen() {
    for (scale, drawn) in [(30.0, true), (44.0, true), (45.0, false), (89.0, false), (f32::MAX, false)] {
        let (_, back) = changed(300, |s| {
            s.geometry.scales[3] = [-3.0, scale, -3.0];
            s.geometry.opacities[3] = 2.0;
        });
        let opacity = back.geometry.opacities[3];
        assert!(if drawn { opacity > 0.0 } else { opacity < -15.8 }, "{scale:e}: {opacity}");
    }
}

#[test]
fn a_scene_nothing_depends_on_packs() {
    let splats = sample(300, 44, 1);
    let zeros = Sensitivity::zeros(300);
    let packer = Packer::new(&splats, &zeros, &options(|_| ())).unwrap();
    let (packed, _) = packer.pack(STEP, &Silent).unwrap();
    super::support::assert_finite(&packed.unpack().unwrap().into_splats());
}

#[test]
fn a_scene_nobody_can_see_packs() {
    for opacity in [-60.0, -100.0, -1e30] {
        changed(300, |s| s.geometry.opacities.fill(opacity));
    }
    changed(300, |s| s.geometry.scales.fill([-100.0; 3]));
}
