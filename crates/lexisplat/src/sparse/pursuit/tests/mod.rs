//! Tests of the pursuit against a naive pursuit in f64.

mod careful;
mod lengths;
pub(in crate::sparse) mod oracle;
mod rows;

use crate::scene::sh::ShDegree;
use crate::sparse::codes::reconstruct;
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::Pursuit;
use crate::sparse::pursuit::{Coder, Encoded, StopRule, ValueType};
use crate::support::rng::SplitMix64;
use crate::support::simd::Simd;
use oracle::{basis_of, check_agreement, dot, off, random_atoms, random_rows, wide};
use proptest::prelude::*;

fn random_dictionary(degree: ShDegree, atoms: usize, rng: &mut SplitMix64) -> Dictionary {
    Dictionary::of(degree, random_atoms(degree.rest(), atoms, rng)).unwrap()
}

fn random_signals(degree: ShDegree, count: usize, scale: f32, rng: &mut SplitMix64) -> Vec<f32> {
    random_rows(degree.rest(), count, scale, rng)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn engine_agrees_with_the_oracle(
        seed in any::<u64>(),
        degree in 1_u8..=4,
        atoms in 20_usize..120,
        tol in 0.05_f64..0.8,
    ) {
        let degree = ShDegree::new(degree).unwrap();
        let mut rng = SplitMix64::new(seed);
        let dictionary = random_dictionary(degree, atoms.max(degree.rest() * 3 / 2), &mut rng);
        for signal in random_signals(degree, 3, 0.2, &mut rng).chunks_exact(degree.rest()) {
            for pursuit in [Pursuit::Omp, Pursuit::Ols] {
                check_agreement(dictionary.atoms(), signal, pursuit, tol);
            }
        }
    }

    /// Every code is within the tolerance, and would not be without the atom of the last step.
    #[test]
    fn codes_end_at_the_tolerance(seed in any::<u64>(), degree in 1_u8..=4, tol in 0.05_f64..0.8) {
        let degree = ShDegree::new(degree).unwrap();
        let mut rng = SplitMix64::new(seed);
        let dictionary = random_dictionary(degree, 2 * degree.rest(), &mut rng);
        let all: Vec<Vec<f64>> = (0..dictionary.len()).map(|j| wide(dictionary.atom(j))).collect();
        let signals = random_signals(degree, 6, 0.2, &mut rng);
        for pursuit in [Pursuit::Omp, Pursuit::Ols] {
            let stop = StopRule::new(Some(tol), None).unwrap();
            let coder = Coder::new(&dictionary, pursuit, stop, ValueType::F32);
            let mut seen = 0;
            coder.encode(&signals, |visit| {
                let Encoded::Code { error } = visit.outcome else { panic!("escape") };
                assert!(error <= tol, "{error} {tol}");
                // A code does not tell which atom came last. Without that atom, the error is above the tolerance, so the
                // largest error without one of the atoms is too.
                let without = |skip: usize| {
                    let kept = visit.code.iter().enumerate().filter(move |p| p.0 != skip);
                    let basis = basis_of(&all, kept.map(|(_, p)| usize::from(p.0)));
                    let left = off(&basis, &wide(visit.signal));
                    dot(&left, &left).sqrt()
                };
                let worst = (0..visit.code.len()).map(without).fold(0.0, f64::max);
                assert!(visit.code.is_empty() || worst > tol * 0.9999, "{worst} {tol}");
                seen += 1;
            });
            prop_assert_eq!(seen, 6);
        }
    }

    /// The reported error is the error of the very values that a decoder reconstructs.
    #[test]
    fn reported_error_is_the_decoders(seed in any::<u64>(), f16 in any::<bool>(), scale in 0.01_f32..3.0) {
        let degree = ShDegree::THREE;
        let mut rng = SplitMix64::new(seed);
        let dictionary = random_dictionary(degree, 90, &mut rng);
        let signals = random_signals(degree, 20, scale, &mut rng);
        let values = if f16 { ValueType::F16 } else { ValueType::F32 };
        let coder = Coder::new(&dictionary, Pursuit::Ols, StopRule::new(Some(0.1), None).unwrap(), values);
        coder.encode(&signals, |visit| {
            let Encoded::Code { error } = visit.outcome else { return };
            let mut out = vec![0.0; degree.rest()];
            let code = visit.code.iter().map(|&(atom, value)| (usize::from(atom), value));
            reconstruct(&dictionary, code, &mut out);
            assert_eq!(out, visit.reconstruction());
            let naive: f64 = visit.signal.iter().zip(&out).map(|(x, y)| {
                let d = f64::from(*x) - f64::from(*y);
                d * d
            }).sum::<f64>().sqrt();
            assert!((naive - error).abs() <= 1e-14 * (1.0 + naive), "{naive} {error}");
            assert!(naive <= 0.1, "{naive}");
        });
    }
}

type Bits = (Vec<(u16, u32)>, Option<u64>);

fn bits(coder: &Coder, signals: &[f32]) -> Vec<Bits> {
    let mut out = Vec::new();
    coder.encode(signals, |visit| {
        let code = visit.code.iter().map(|&(a, v)| (a, v.to_bits())).collect();
        let error = match visit.outcome {
            Encoded::Code { error } => Some(error.to_bits()),
            Encoded::Escape => None,
        };
        out.push((code, error));
    });
    out
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    let mut rng = SplitMix64::new(11);
    for (degree, atoms) in [(1, 5), (2, 48), (3, 90), (3, 257), (4, 144)] {
        let degree = ShDegree::new(degree).unwrap();
        let dictionary = random_dictionary(degree, atoms, &mut rng);
        let signals = random_signals(degree, 200, 0.2, &mut rng);
        for pursuit in [Pursuit::Omp, Pursuit::Ols] {
            let stop = StopRule::new(Some(0.05), None).unwrap();
            let coder = Coder::new(&dictionary, pursuit, stop, ValueType::F16);
            let coded = |simd: Simd| simd.scope(|| bits(&coder, &signals));
            let plain = coded(Simd::PLAIN);
            assert!(plain.iter().any(|(code, _)| code.len() > 2));
            for simd in Simd::available() {
                assert_eq!(coded(simd), plain, "{simd:?} {pursuit} {atoms} atoms");
            }
        }
    }
}

#[test]
fn atoms_that_do_not_span_escape_unless_capped() {
    let mut rng = SplitMix64::new(2);
    let dictionary = random_dictionary(ShDegree::THREE, 3, &mut rng);
    let signals = random_signals(ShDegree::THREE, 10, 1.0, &mut rng);
    let outcomes = |stop: StopRule| {
        let coder = Coder::new(&dictionary, Pursuit::Ols, stop, ValueType::F32);
        let mut out = Vec::new();
        coder.encode(&signals, |visit| out.push((visit.code.len(), visit.outcome)));
        out
    };
    let promised = outcomes(StopRule::new(Some(0.1), None).unwrap());
    assert!(promised.iter().all(|o| o.1 == Encoded::Escape));
    let capped = outcomes(StopRule::new(Some(0.1), Some(2)).unwrap());
    assert!(capped.iter().all(|o| o.0 == 2 && matches!(o.1, Encoded::Code { error } if error > 0.1)));
}

#[test]
fn extreme_vectors_are_stored_exactly_or_coded_true() {
    let mut rng = SplitMix64::new(3);
    let dictionary = random_dictionary(ShDegree::ONE, 18, &mut rng);
    let stop = StopRule::new(Some(0.01), None).unwrap();
    for (scale, escapes) in [(1e6, true), (1e20, true), (f32::MAX, true), (1e-30, false), (0.0, false)] {
        let signals = random_signals(ShDegree::ONE, 4, scale, &mut rng);
        let coder = Coder::new(&dictionary, Pursuit::Ols, stop, ValueType::F16);
        coder.encode(&signals, |visit| {
            assert_eq!(visit.outcome == Encoded::Escape, escapes, "scale {scale}: {:?}", visit.outcome);
            assert!(escapes || visit.code.is_empty());
        });
    }
}

#[test]
fn a_signal_made_of_atoms_is_found() {
    let mut rng = SplitMix64::new(4);
    let dictionary = random_dictionary(ShDegree::THREE, 90, &mut rng);
    let mut signal = vec![0.0; 45];
    reconstruct(&dictionary, [(7, 0.8), (33, -0.5)].into_iter(), &mut signal);
    for pursuit in [Pursuit::Omp, Pursuit::Ols] {
        let coder =
            Coder::new(&dictionary, pursuit, StopRule::new(Some(1e-3), None).unwrap(), ValueType::F32);
        coder.encode(&signal, |visit| {
            let atoms: Vec<u16> = visit.code.iter().map(|p| p.0).collect();
            assert_eq!(atoms, [7, 33], "{pursuit}");
            assert!((visit.code[0].1 - 0.8).abs() < 1e-5 && (visit.code[1].1 + 0.5).abs() < 1e-5);
        });
    }
}
