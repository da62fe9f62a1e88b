//! Tests of rows for which f32 is not enough, against least squares in f64.

use super::oracle::{basis_of, dot, off, random_atoms, wide};
use crate::sparse::atoms::Atoms;
use crate::sparse::model::Pursuit;
use crate::sparse::pursuit::{Coder, Encoded, RowCodes, RowValue, StopRule, ValueType, encode_rows};
use crate::support::progress::Silent;
use crate::support::rng::SplitMix64;
use proptest::prelude::*;

/// Largest distance of an atom to the span of other atoms at which [`span`] leaves the atom out.
const IN_SPAN: f64 = 1e-7;

/// Returns a number that is about normally distributed: the sum of twelve uniform numbers, less its mean.
fn normal(rng: &mut SplitMix64) -> f64 {
    (0..12).map(|_| (rng.next() >> 11) as f64 / (1_u64 << 53) as f64).sum::<f64>() - 6.0
}

fn rows(dim: usize, count: usize, offset: f64, scale: f64, rng: &mut SplitMix64) -> Vec<f64> {
    (0..dim * count).map(|_| (normal(rng) + offset) * scale).collect()
}

fn coder(atoms: &Atoms, pursuit: Pursuit, tolerance: f64) -> Coder {
    Coder::over(atoms, pursuit, StopRule::new(Some(tolerance), None).unwrap(), ValueType::F32)
}

/// Returns an orthonormal basis of the span of all atoms.
fn span(atoms: &Atoms) -> Vec<Vec<f64>> {
    let all: Vec<Vec<f64>> = (0..atoms.len()).map(|j| wide(atoms.atom(j))).collect();
    let mut chosen: Vec<usize> = Vec::new();
    for j in 0..all.len() {
        let left = off(&basis_of(&all, chosen.iter().copied()), &all[j]);
        if dot(&left, &left).sqrt() > IN_SPAN {
            chosen.push(j);
        }
    }
    basis_of(&all, chosen)
}

/// Checks the errors and escapes of `codes`. `epsilon` is half the distance from 1 to the next number in the type of the
/// values.
fn check<V: RowValue>(
    atoms: &Atoms,
    rows: &[V],
    codes: &RowCodes<V>,
    tolerance: f64,
    epsilon: f64,
) -> Result<(), TestCaseError> {
    let basis = span(atoms);
    for (i, row) in rows.chunks_exact(atoms.dim()).enumerate() {
        let row: Vec<f64> = row.iter().map(|x| x.wide()).collect();
        let norm = dot(&row, &row).sqrt();
        let (mut left, mut sizes) = (row.clone(), norm);
        for (atom, value) in codes.row(i) {
            let atom = wide(atoms.atom(atom));
            left.iter_mut().zip(&atom).for_each(|(x, a)| *x -= value.wide() * a);
            sizes += value.wide().abs();
        }
        let error = dot(&left, &left).sqrt();
        prop_assert!(
            (error - codes.errors[i]).abs() <= 1e-14 * sizes + 1e-9 * error,
            "{error} {:?}",
            codes.errors[i]
        );
        let is_escape = codes.escapes.binary_search(&i).is_ok();
        prop_assert_eq!(is_escape, codes.errors[i] > tolerance * (1.0 - 1e-12));
        if is_escape {
            let outside = off(&basis, &row);
            let least = dot(&outside, &outside).sqrt();
            prop_assert!(
                least + epsilon * sizes > tolerance,
                "error {error}, {least} by least squares, {tolerance}"
            );
            prop_assert!(
                error <= least * (1.0 + 1e-6) + epsilon * sizes,
                "error {error}, {least} by least squares"
            );
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_row_is_over_only_if_no_code_is_within(
        seed in any::<u64>(),
        dim in 1_usize..=30,
        atoms in 1_usize..=60,
        offset in prop::sample::select(vec![0.0, 0.0, 1e2, 1e4]),
        size in -30_i32..=30,
        share in -9.0_f64..-0.3,
        omp in any::<bool>(),
    ) {
        let mut rng = SplitMix64::new(seed);
        let atoms = random_atoms(dim, atoms, &mut rng);
        let wide = rows(dim, 6, offset, 10.0_f64.powi(size), &mut rng);
        let narrow: Vec<f32> = wide.iter().map(|&x| f32::nearest(x)).collect();
        let norm = dot(&wide[..dim], &wide[..dim]).sqrt();
        let tolerance = norm * 10.0_f64.powf(share);
        let coder = coder(&atoms, if omp { Pursuit::Omp } else { Pursuit::Ols }, tolerance);
        let codes = encode_rows(&coder, &wide, &Silent).unwrap();
        check(&atoms, &wide, &codes, tolerance, f64::EPSILON / 2.0)?;
        let codes = encode_rows(&coder, &narrow, &Silent).unwrap();
        check(&atoms, &narrow, &codes, tolerance, f64::from(f32::EPSILON) / 2.0)?;
    }
}

#[test]
fn rows_that_the_fast_pursuit_leaves_over_are_within() {
    for (offset, scale, tolerance) in
        [(0.0, 1.0, 1e-5), (1e4, 1.0, 0.1), (0.0, 1e15, 1e14), (0.0, 1e-20, 1e-22)]
    {
        let mut rng = SplitMix64::new(31);
        let atoms = random_atoms(45, 90, &mut rng);
        let wide = rows(45, 500, offset, scale, &mut rng);
        let narrow: Vec<f32> = wide.iter().map(|&x| f32::nearest(x)).collect();
        let coder = coder(&atoms, Pursuit::Ols, tolerance);
        let mut over = 0;
        coder.encode(&narrow, |visit| over += usize::from(visit.outcome == Encoded::Escape));
        // For tiny rows, the fast pursuit takes other atoms than those that help most, but it may reach the tolerance.
        assert!(over > 0 || scale < 1.0, "the fast pursuit is enough at {tolerance}");
        let codes = encode_rows(&coder, &wide, &Silent).unwrap();
        assert!(codes.escapes.is_empty() && codes.errors.iter().all(|&e| e <= tolerance), "{tolerance}");
        let codes = encode_rows(&coder, &narrow, &Silent).unwrap();
        assert!(codes.escapes.is_empty() && codes.errors.iter().all(|&e| e <= tolerance), "{tolerance}");
    }
}

#[test]
fn rows_of_any_size_have_the_same_codes_and_the_cap_is_kept() {
    let mut rng = SplitMix64::new(32);
    let atoms = random_atoms(12, 30, &mut rng);
    let rows = rows(12, 40, 0.0, 1.0, &mut rng);
    let stop = StopRule::new(None, Some(3)).unwrap();
    let coder = Coder::over(&atoms, Pursuit::Ols, stop, ValueType::F32);
    let plain = encode_rows(&coder, &rows, &Silent).unwrap();
    assert!(plain.escapes.is_empty() && plain.starts.windows(2).all(|s| s[1] - s[0] == 3));
    for exponent in [-1000, -60, 60, 900] {
        let scaled: Vec<f64> = rows.iter().map(|&x| libm::scalbn(x, exponent)).collect();
        let codes = encode_rows(&coder, &scaled, &Silent).unwrap();
        assert_eq!(codes.atoms, plain.atoms);
        for (a, b) in codes.values.iter().zip(&plain.values) {
            let a = libm::scalbn(*a, -exponent);
            assert!((a - b).abs() < 1e-5 * b.abs().max(1.0), "{a} {b}");
        }
    }
}

/// Two atoms differ in their last bits alone. Values along their difference are large, and f32 cannot hold them.
#[test]
fn values_of_half_precision_are_rounded_and_rows_still_coded() {
    let (a, b) = (0.6_f32, 0.8_f32);
    let atoms = Atoms::new(2, vec![a, b, a + 6e-8, b]).unwrap();
    let rows = [1.0_f64, -1.0];
    let codes = encode_rows(&coder(&atoms, Pursuit::Ols, 1e-6), &rows, &Silent).unwrap();
    assert!(codes.escapes.is_empty() && codes.values.iter().all(|v| v.abs() > 1e6), "{codes:?}");
    let stop = StopRule::new(Some(1e-2), None).unwrap();
    let half =
        Coder::over(&random_atoms(8, 20, &mut SplitMix64::new(33)), Pursuit::Ols, stop, ValueType::F16);
    let rows: Vec<f64> = (0..800).map(|k| f64::from(k % 7) * 0.3 - 0.9).collect();
    let codes = encode_rows(&half, &rows, &Silent).unwrap();
    assert!(codes.values.iter().all(|&v| half::f16::from_f64(v).to_f64() == v));
    assert!(codes.escapes.is_empty(), "{:?}", codes.escapes);
}
