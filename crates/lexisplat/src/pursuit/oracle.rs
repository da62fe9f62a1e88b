//! The naive truth: OMP and OLS in f64 by normal equations solved afresh at every step.

use crate::model::Pursuit;

/// Least-squares coefficients of `chosen` atoms for `signal`, by Gaussian elimination with pivoting.
fn least_squares(atoms: &[Vec<f64>], chosen: &[usize], signal: &[f64]) -> Vec<f64> {
    let k = chosen.len();
    let mut system: Vec<Vec<f64>> = chosen
        .iter()
        .map(|&i| {
            let mut row: Vec<f64> = chosen.iter().map(|&j| dot(&atoms[i], &atoms[j])).collect();
            row.push(dot(&atoms[i], signal));
            row
        })
        .collect();
    for c in 0..k {
        let pivot = (c..k).max_by(|&a, &b| system[a][c].abs().total_cmp(&system[b][c].abs())).unwrap();
        system.swap(c, pivot);
        for r in 0..k {
            if r != c {
                let factor = system[r][c] / system[c][c];
                let pivot_row = system[c].clone();
                for (value, pivot) in system[r].iter_mut().zip(&pivot_row).skip(c) {
                    *value -= factor * pivot;
                }
            }
        }
    }
    (0..k).map(|i| system[i][k] / system[i][i]).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// What is left of `signal` after projecting on `chosen`.
fn residual(atoms: &[Vec<f64>], chosen: &[usize], signal: &[f64]) -> Vec<f64> {
    let mut left = signal.to_vec();
    for (&j, c) in chosen.iter().zip(least_squares(atoms, chosen, signal)) {
        for (l, a) in left.iter_mut().zip(&atoms[j]) {
            *l -= c * a;
        }
    }
    left
}

/// Atoms chosen for `signal`, in order, until the residual is at most `tolerance`.
pub(super) fn pursue(
    pursuit: Pursuit,
    atoms: &[Vec<f64>],
    signal: &[f64],
    tolerance: f64,
) -> (Vec<usize>, Vec<f64>) {
    let mut chosen = Vec::new();
    let mut left = signal.to_vec();
    while dot(&left, &left).sqrt() > tolerance && chosen.len() < signal.len() {
        let gain = |j: usize| match pursuit {
            Pursuit::Omp => dot(&atoms[j], &left).abs(),
            Pursuit::Ols => {
                let mut with = chosen.clone();
                with.push(j);
                let rest = residual(atoms, &with, signal);
                -dot(&rest, &rest)
            }
        };
        let free = (0..atoms.len()).filter(|j| !chosen.contains(j));
        let best = free.max_by(|&a, &b| gain(a).total_cmp(&gain(b))).unwrap();
        chosen.push(best);
        left = residual(atoms, &chosen, signal);
    }
    let values = least_squares(atoms, &chosen, signal);
    (chosen, values)
}

mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::codes::reconstruct;
    use crate::dictionary::Dictionary;
    use crate::pursuit::path::Path;
    use crate::pursuit::{Coder, Encoded, Stop, ValueType};
    use crate::rng::SplitMix64;
    use crate::sh::ShDegree;

    #[expect(clippy::cast_possible_truncation, reason = "test data are small")]
    fn uniform(rng: &mut SplitMix64) -> f32 {
        ((rng.next() >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0) as f32
    }

    fn random_dictionary(degree: ShDegree, atoms: usize, rng: &mut SplitMix64) -> Dictionary {
        let mut values = Vec::new();
        for _ in 0..atoms {
            let atom: Vec<f32> = (0..degree.rest()).map(|_| uniform(rng)).collect();
            let norm = atom.iter().map(|x| x * x).sum::<f32>().sqrt();
            values.extend(atom.iter().map(|x| x / norm));
        }
        Dictionary::new(degree, values).unwrap()
    }

    fn random_signals(degree: ShDegree, count: usize, scale: f32, rng: &mut SplitMix64) -> Vec<f32> {
        (0..count * degree.rest()).map(|_| scale * uniform(rng)).collect()
    }

    fn wide(values: &[f32]) -> Vec<f64> {
        values.iter().map(|&x| f64::from(x)).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Same atoms and values as the oracle, unless two candidates are closer than f32 can tell: then
        /// the number of atoms may differ by one, and the error must still keep the promise.
        #[test]
        fn engine_agrees_with_the_oracle(seed in any::<u64>(), degree in 1_u8..=4, atoms in 20_usize..120, tol in 0.05_f64..0.8) {
            let degree = ShDegree::new(degree).unwrap();
            let mut rng = SplitMix64::new(seed);
            let dictionary = random_dictionary(degree, atoms.max(degree.rest() + 1), &mut rng);
            let signals = random_signals(degree, 6, 0.2, &mut rng);
            let all: Vec<Vec<f64>> = (0..dictionary.len()).map(|j| wide(dictionary.atom(j))).collect();
            for pursuit in [Pursuit::Omp, Pursuit::Ols] {
                let stop = Stop::new(Some(tol), None).unwrap();
                let coder = Coder::new(&dictionary, pursuit, stop, ValueType::F32);
                let mut same = 0;
                let mut seen = 0;
                coder.encode(&signals, |visit| {
                    let (mut chosen, values) = pursue(pursuit, &all, &wide(visit.signal), tol);
                    let mut pairs: Vec<(usize, f64)> = chosen.drain(..).zip(values).collect();
                    pairs.sort_by_key(|p| p.0);
                    let Encoded::Code { error } = visit.outcome else { panic!("escape") };
                    assert!(error <= tol, "{error} {tol}");
                    assert!(visit.code.len().abs_diff(pairs.len()) <= 1, "{} {}", visit.code.len(), pairs.len());
                    let close = visit.code.len() == pairs.len()
                        && visit.code.iter().zip(&pairs).all(|(a, b)| {
                            usize::from(a.0) == b.0 && (f64::from(a.1) - b.1).abs() < 1e-3
                        });
                    same += usize::from(close);
                    seen += 1;
                });
                prop_assert_eq!(seen, 6);
                prop_assert!(same >= 5, "{} of 6 agree ({})", same, pursuit);
            }
        }

        /// The error reported is that of the very values a decoder reconstructs.
        #[test]
        fn reported_error_is_the_decoders(seed in any::<u64>(), f16 in any::<bool>(), scale in 0.01_f32..3.0) {
            let degree = ShDegree::THREE;
            let mut rng = SplitMix64::new(seed);
            let dictionary = random_dictionary(degree, 90, &mut rng);
            let signals = random_signals(degree, 20, scale, &mut rng);
            let values = if f16 { ValueType::F16 } else { ValueType::F32 };
            let coder = Coder::new(&dictionary, Pursuit::Ols, Stop::new(Some(0.1), None).unwrap(), values);
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
                let stop = Stop::new(Some(0.05), None).unwrap();
                let coder = |path| Coder::with_path(&dictionary, pursuit, stop, ValueType::F16, path);
                let plain = bits(&coder(Path::Plain), &signals);
                assert!(plain.iter().any(|(code, _)| code.len() > 2));
                for path in Path::available() {
                    assert_eq!(bits(&coder(path), &signals), plain, "{path:?} {pursuit} {atoms} atoms");
                }
            }
        }
    }

    #[test]
    fn atoms_that_do_not_span_escape_unless_capped() {
        let mut rng = SplitMix64::new(2);
        let dictionary = random_dictionary(ShDegree::THREE, 3, &mut rng);
        let signals = random_signals(ShDegree::THREE, 10, 1.0, &mut rng);
        let outcomes = |stop: Stop| {
            let coder = Coder::new(&dictionary, Pursuit::Ols, stop, ValueType::F32);
            let mut out = Vec::new();
            coder.encode(&signals, |visit| out.push((visit.code.len(), visit.outcome)));
            out
        };
        let promised = outcomes(Stop::new(Some(0.1), None).unwrap());
        assert!(promised.iter().all(|o| o.1 == Encoded::Escape));
        let capped = outcomes(Stop::new(Some(0.1), Some(2)).unwrap());
        assert!(capped.iter().all(|o| o.0 == 2 && matches!(o.1, Encoded::Code { error } if error > 0.1)));
    }

    #[test]
    fn extreme_vectors_are_stored_exactly_or_coded_true() {
        let mut rng = SplitMix64::new(3);
        let dictionary = random_dictionary(ShDegree::ONE, 18, &mut rng);
        let stop = Stop::new(Some(0.01), None).unwrap();
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
                Coder::new(&dictionary, pursuit, Stop::new(Some(1e-3), None).unwrap(), ValueType::F32);
            coder.encode(&signal, |visit| {
                let atoms: Vec<u16> = visit.code.iter().map(|p| p.0).collect();
                assert_eq!(atoms, [7, 33], "{pursuit}");
                assert!((visit.code[0].1 - 0.8).abs() < 1e-5 && (visit.code[1].1 + 0.5).abs() < 1e-5);
            });
        }
    }
}
