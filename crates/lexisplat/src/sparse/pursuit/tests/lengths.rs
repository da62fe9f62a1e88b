//! Tests of the pursuit of rows of any length over any number of atoms.

use super::oracle::{basis_of, check_agreement, dot, off, random_atoms, random_rows, wide};
use crate::sparse::atoms::{Atoms, MAX_DIM};
use crate::sparse::model::Pursuit;
use crate::sparse::pursuit::{Coder, Encoded, StopRule, ValueType};
use crate::support::rng::SplitMix64;
use crate::support::simd::Simd;
use proptest::prelude::*;

const BOTH: [Pursuit; 2] = [Pursuit::Omp, Pursuit::Ols];

fn tolerance(tolerance: f64) -> StopRule {
    StopRule::new(Some(tolerance), None).unwrap()
}

/// Returns the code of `row` as it is visited, and its error. The error is `None` for an escape.
fn coded(coder: &Coder, row: &[f32]) -> (Vec<(u16, f32)>, Option<f64>) {
    let mut out = Vec::new();
    coder.encode(row, |visit| {
        let error = match visit.outcome {
            Encoded::Code { error } => Some(error),
            Encoded::Escape => None,
        };
        out.push((visit.code.to_vec(), error));
    });
    assert_eq!(out.len(), 1);
    out.remove(0)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn engine_agrees_with_the_oracle_at_any_length(
        seed in any::<u64>(),
        dim in 1_usize..=100,
        atoms in 1_usize..150,
        tol in 0.05_f64..0.8,
    ) {
        let mut rng = SplitMix64::new(seed);
        let atoms = random_atoms(dim, atoms, &mut rng);
        for row in random_rows(dim, 2, 0.2, &mut rng).chunks_exact(dim) {
            for pursuit in BOTH {
                check_agreement(&atoms, row, pursuit, tol);
            }
        }
    }

    /// The reported error is the error of the row that the atoms reconstruct from the code, also for rows out of reach.
    #[test]
    fn reported_error_is_that_of_the_reconstruction(
        seed in any::<u64>(),
        dim in 1_usize..=100,
        atoms in 1_usize..300,
        tol in 0.01_f64..0.5,
    ) {
        let mut rng = SplitMix64::new(seed);
        let atoms = random_atoms(dim, atoms, &mut rng);
        let rows = random_rows(dim, 8, 0.3, &mut rng);
        for pursuit in BOTH {
            let coder = Coder::over(&atoms, pursuit, tolerance(tol), ValueType::F32);
            coder.encode(&rows, |visit| {
                let (code, error) = visit.nearest();
                let mut out = vec![f32::NAN; dim];
                atoms.reconstruct(code.iter().map(|&(atom, value)| (atom.into(), value)), &mut out);
                let difference: Vec<f64> = wide(visit.signal).iter().zip(wide(&out)).map(|(x, y)| x - y).collect();
                let naive = dot(&difference, &difference).sqrt();
                assert!((naive - error).abs() <= 1e-13 * (1.0 + naive), "{naive} {error}");
                assert_eq!(error > tol, visit.outcome == Encoded::Escape);
                assert!(code.windows(2).all(|pair| pair[0].0 < pair[1].0));
            });
        }
    }
}

#[test]
fn engine_agrees_with_the_oracle_on_long_rows() {
    let mut rng = SplitMix64::new(8);
    for (dim, atoms) in [(300, 260), (64, 257), (257, 3), (81, 1)] {
        let atoms = random_atoms(dim, atoms, &mut rng);
        for row in random_rows(dim, 2, 0.2, &mut rng).chunks_exact(dim) {
            let norm = dot(&wide(row), &wide(row)).sqrt();
            for pursuit in BOTH {
                check_agreement(&atoms, row, pursuit, 0.7 * norm);
            }
        }
    }
}

/// A row without zeros needs all axes if the atoms are the axes.
#[test]
fn codes_of_more_than_255_nonzeros_are_whole() {
    for dim in [255, 256, 300, MAX_DIM] {
        let axes: Vec<f32> = (0..dim * dim).map(|i| if i / dim == i % dim { 1.0 } else { 0.0 }).collect();
        let atoms = Atoms::new(dim, axes).unwrap();
        let row: Vec<f32> = (0_u16..).take(dim).map(|i| 1.0 + f32::from(i * 37 % 64) / 64.0).collect();
        let exact: Vec<(u16, f32)> = (0_u16..).zip(row.iter().copied()).collect();
        for pursuit in BOTH {
            let coder = Coder::over(&atoms, pursuit, tolerance(1e-6), ValueType::F32);
            assert_eq!(coded(&coder, &row), (exact.clone(), Some(0.0)), "{dim} {pursuit}");
            let cap = StopRule::new(Some(1e-6), Some(dim - 3)).unwrap();
            let (code, error) = coded(&Coder::over(&atoms, pursuit, cap, ValueType::F32), &row);
            assert_eq!(code.len(), dim - 3);
            assert!(error.unwrap() >= 1.0, "three values of at least 1 are left");
        }
    }
}

/// The code that an escape ends with is the projection of the row on all atoms.
#[test]
fn rows_out_of_reach_keep_the_nearest_code() {
    let mut rng = SplitMix64::new(9);
    for (dim, count) in [(2, 1), (3, 2), (45, 3), (64, 20), (300, 31)] {
        let atoms = random_atoms(dim, count, &mut rng);
        let all: Vec<Vec<f64>> = (0..count).map(|j| wide(atoms.atom(j))).collect();
        let basis = basis_of(&all, 0..count);
        for row in random_rows(dim, 5, 1.0, &mut rng).chunks_exact(dim) {
            let left = off(&basis, &wide(row));
            let least = dot(&left, &left).sqrt();
            for pursuit in BOTH {
                let coder = Coder::over(&atoms, pursuit, tolerance(1e-3), ValueType::F32);
                coder.encode(row, |visit| {
                    assert_eq!(visit.outcome, Encoded::Escape);
                    let (code, error) = visit.nearest();
                    assert!(!code.is_empty());
                    assert!((error - least).abs() < 1e-4, "{dim} {count} {pursuit}: {error} {least}");
                });
            }
        }
    }
}

#[test]
fn rows_too_large_for_f32_keep_no_code() {
    let atoms = Atoms::new(2, vec![1.0, 0.0, 0.0, 1.0]).unwrap();
    for scale in [1e16, 1e20, f32::MAX] {
        let coder = Coder::over(&atoms, Pursuit::Ols, tolerance(0.1), ValueType::F32);
        coder.encode(&[scale, 0.0], |visit| {
            assert_eq!(visit.outcome, Encoded::Escape);
            assert_eq!(visit.nearest(), (&[][..], f64::from(scale)));
        });
    }
}

#[test]
fn every_instruction_set_gives_the_same_bits_at_any_length() {
    let mut rng = SplitMix64::new(12);
    for (dim, atoms) in [(1, 2), (3, 3), (17, 40), (64, 128), (81, 90), (300, 280)] {
        let atoms = random_atoms(dim, atoms, &mut rng);
        let rows = random_rows(dim, 20, 0.5, &mut rng);
        for pursuit in BOTH {
            let coder = Coder::over(&atoms, pursuit, tolerance(0.5), ValueType::F32);
            let bits = |simd: Simd| {
                simd.scope(|| {
                    let mut out = Vec::new();
                    coder.encode(&rows, |visit| {
                        let (code, error) = visit.nearest();
                        out.push(error.to_bits());
                        out.extend(
                            code.iter()
                                .map(|&(atom, value)| u64::from(atom) << 32 | u64::from(value.to_bits())),
                        );
                    });
                    out
                })
            };
            let plain = bits(Simd::PLAIN);
            for simd in Simd::available() {
                assert_eq!(bits(simd), plain, "{simd:?} {pursuit} {dim}");
            }
        }
    }
}
