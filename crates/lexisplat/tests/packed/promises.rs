//! A tolerance holds for every Gaussian, measured in f64 on the values that come back.

use lexisplat::CompressReport;
use lexisplat::Splats;

use super::support::{STEP, options, pack, returned, row_errors, sample};

/// Packs with a tolerance; the promise holds and the record says by how much.
fn assert_kept(splats: &Splats, tolerance: f64, atoms: Option<usize>) -> CompressReport {
    let options = options(|o| {
        o.tolerance = Some(tolerance);
        o.keep_order = true;
        o.atoms = atoms;
    });
    let (packed, report) = pack(splats, STEP, &options);
    let errors = row_errors(splats, &returned(splats, STEP, &options));
    let worst = errors.iter().copied().fold(0.0, f64::max);
    assert!(worst <= tolerance, "tolerance {tolerance}: {worst}");
    let record = &packed.head().record;
    // Errors have five digits in files. The largest one is rounded up, within the tolerance.
    let most = (worst * 1.0002).min(tolerance);
    assert!(
        worst * (1.0 - 1e-12) <= record.max_residual && record.max_residual <= most,
        "{worst} {record:?}"
    );
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64).sqrt();
    assert!((rms - record.rms_residual).abs() <= 1e-4 * rms, "{rms} {record:?}");
    assert_eq!((record.tolerance, record.over_tolerance), (Some(tolerance), 0));
    let exact = errors.iter().filter(|&&e| e == 0.0).count() as u64;
    assert!(exact >= report.escapes, "an escape is exact");
    report
}

#[test]
fn every_gaussian_is_within_the_tolerance() {
    for degree in 1..=4 {
        let splats = sample(1200, 31, degree);
        let coarse = assert_kept(&splats, 0.2, None);
        let fine = assert_kept(&splats, 0.05, None);
        assert!(coarse.mean_nonzeros < fine.mean_nonzeros, "degree {degree}: a tolerance must pay");
        assert!(fine.escapes < 60, "degree {degree}: {} escapes", fine.escapes);
    }
}

#[test]
fn a_tolerance_that_no_code_reaches_makes_escapes() {
    let splats = sample(300, 32, 2);
    for tolerance in [1e-6, 1e-12, 1e-20, 1e-40, 1e-300] {
        let report = assert_kept(&splats, tolerance, None);
        assert_eq!(report.escapes, 300, "tolerance {tolerance:e}");
    }
    assert!(assert_kept(&splats, 0.02, Some(1)).escapes > 100, "one atom is not enough");
}

#[test]
fn a_tolerance_that_everything_meets_costs_nothing() {
    let splats = sample(300, 33, 2);
    for tolerance in [1e3, 1e38, 1e300] {
        assert_eq!(assert_kept(&splats, tolerance, None).mean_nonzeros, 0.0, "tolerance {tolerance:e}");
    }
}

/// Rows so long that no f16 value reaches them, that their squares leave f32, and up to the largest.
#[test]
fn huge_rows_are_exact_and_spoil_no_others() {
    let plain = sample(800, 34, 3);
    let usual = assert_kept(&plain, 0.05, None).escapes;
    let mut huge = plain.clone();
    let norms = [1e6, 1e10, 1e14, 1e18, 1e30, 3e38];
    for (i, norm) in norms.into_iter().enumerate() {
        // In every Gaussian's own direction.
        let row = &mut huge.sh_rest[i * 45..(i + 1) * 45];
        let most = row.iter().fold(0.0_f32, |most, v| most.max(v.abs()));
        row.iter_mut().for_each(|v| *v = *v / most * norm);
    }
    let report = assert_kept(&huge, 0.05, None);
    let found = report.escapes;
    assert!((norms.len() as u64..=norms.len() as u64 + usual + 8).contains(&found), "{found} escapes");

    // Without a promise too, since no picture survives an error of that size.
    let options = options(|o| o.keep_order = true);
    let (packed, report) = pack(&huge, STEP, &options);
    assert_eq!(report.escapes, norms.len() as u64);
    assert!(packed.head().record.max_residual < 1.0, "{}", packed.head().record.max_residual);
    let back = packed.unpack().unwrap().into_splats();
    assert!((0..norms.len()).all(|i| back.rest(i) == huge.rest(i)), "an escape is exact");
}

#[test]
fn escapes_come_back_without_an_order_too() {
    let mut splats = sample(200, 35, 1);
    let row: Vec<f32> = (1..=9_u8).map(|d| 1e4 * f32::from(d)).collect();
    splats.sh_rest[90 * 9..91 * 9].copy_from_slice(&row);
    let (packed, report) = pack(&splats, STEP, &options(|o| o.tolerance = Some(0.1)));
    assert_eq!(report.escapes, 1);
    let model = packed.unpack().unwrap();
    assert_eq!(model.codes().escapes().rows, row);
}
