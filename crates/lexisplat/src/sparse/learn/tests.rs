//! Tests of learning from rows of any length.

use super::{LearnOptions, LearnedAtoms, learn, learn_atoms};
use crate::scene::sh::ShDegree;
use crate::sparse::atoms::{Atoms, MAX_DIM};
use crate::sparse::model::Pursuit;
pub(super) use crate::sparse::pursuit::tests::oracle::{random_atoms, uniform};
use crate::sparse::pursuit::{Coder, StopRule, ValueType, encode_rows};
use crate::support::error::Error;
use crate::support::limits::MAX_ATOMS;
use crate::support::progress::{Progress, Silent};
use crate::support::rng::SplitMix64;

/// Returns rows that are sums of `nonzeros` of `atoms` and a little noise.
pub(super) fn sparse_rows(atoms: &Atoms, nonzeros: usize, count: usize, rng: &mut SplitMix64) -> Vec<f32> {
    let mut rows = Vec::new();
    for _ in 0..count {
        let mut row: Vec<f32> = (0..atoms.dim()).map(|_| 0.005 * uniform(rng)).collect();
        for _ in 0..nonzeros {
            let value = uniform(rng);
            let atom = atoms.atom(rng.below(atoms.len()));
            row.iter_mut().zip(atom).for_each(|(r, a)| *r += value * a);
        }
        rows.extend(row);
    }
    rows
}

pub(super) fn tolerance(tolerance: f64) -> StopRule {
    StopRule::new(Some(tolerance), None).unwrap()
}

/// Returns the mean nonzeros and the root of the mean squared error of `rows` over `atoms`.
pub(super) fn cost(atoms: &Atoms, rows: &[f32], stop: StopRule) -> [f64; 2] {
    let codes = encode_rows(&Coder::over(atoms, Pursuit::Ols, stop, ValueType::F32), rows, &Silent).unwrap();
    let count = codes.len() as f64;
    let squares: f64 = codes.errors.iter().map(|error| error * error).sum();
    [codes.atoms.len() as f64 / count, (squares / count).sqrt()]
}

fn learned(rows: &[f32], dim: usize, atoms: usize, stop: StopRule) -> LearnedAtoms {
    learn_atoms(dim, rows, &LearnOptions::new(stop).with_atoms(Some(atoms)), &Silent).unwrap()
}

#[test]
fn odd_rows_and_sizes_give_unit_atoms() {
    let mut rng = SplitMix64::new(31);
    for (dim, counts) in
        [(1, vec![1, 3, 300]), (2, vec![1, 3, 300]), (3, vec![1, 2, 7]), (64, vec![3, 100]), (300, vec![3])]
    {
        let random: Vec<f32> = (0..20 * dim).map(|_| uniform(&mut rng)).collect();
        let twins = random[..dim].repeat(15);
        let sets =
            [vec![], vec![0.0; 12 * dim], vec![0.7; 12 * dim], random[..dim].to_vec(), twins, random.clone()];
        for (set, rows) in sets.iter().enumerate() {
            for &count in &counts {
                for stop in [tolerance(0.05), StopRule::new(None, Some(2)).unwrap()] {
                    let learned = learned(rows, dim, count, stop);
                    let case = format!("set {set}, {count} atoms of {dim}");
                    assert_eq!((learned.atoms.len(), learned.atoms.dim()), (count, dim), "{case}");
                    assert!(learned.held_out_nonzeros.is_finite(), "{case}");
                }
            }
        }
    }
}

#[test]
fn the_size_of_rows_does_not_change_the_atoms() {
    let mut rng = SplitMix64::new(35);
    let rows = sparse_rows(&random_atoms(9, 14, &mut rng), 3, 400, &mut rng);
    let learned = |exponent: i32| {
        let scaled: Vec<f64> = rows.iter().map(|&x| libm::scalbn(f64::from(x), exponent)).collect();
        let stop = tolerance(libm::scalbn(0.1, exponent));
        learn_atoms(9, &scaled, &LearnOptions::new(stop), &Silent).unwrap()
    };
    let plain = learned(0);
    assert!(plain.atoms == learn_atoms(9, &rows, &LearnOptions::new(tolerance(0.1)), &Silent).unwrap().atoms);
    for exponent in [-60, 900] {
        let other = learned(exponent);
        assert!(other.atoms == plain.atoms, "2 to the power {exponent}");
        assert_eq!(other.held_out_nonzeros.to_bits(), plain.held_out_nonzeros.to_bits());
    }
}

#[test]
fn arguments_are_checked() {
    let options = LearnOptions::new(tolerance(0.1));
    let refused = |dim: usize, rows: &[f32], options: &LearnOptions| {
        let error = learn_atoms(dim, rows, options, &Silent).unwrap_err();
        assert!(matches!(error, Error::Parameter { .. }));
        error.to_string()
    };
    assert!(refused(0, &[], &options).starts_with("dim = 0"));
    assert!(refused(MAX_DIM + 1, &[], &options).starts_with("dim = 1025"));
    assert!(refused(3, &[0.0; 4], &options).starts_with("rows = 4 values"));
    // The sample alone would leave out the row with a NaN, since its norm is not above the tolerance.
    assert!(refused(2, &[0.0, 1.0, f32::NAN, 0.0], &options).contains("row 1"));
    assert!(refused(2, &[], &options.clone().with_atoms(Some(0))).starts_with("atoms = 0"));
    assert!(refused(2, &[], &options.clone().with_atoms(Some(MAX_ATOMS + 1))).starts_with("atoms = 1025"));
    assert!(refused(2, &[], &options.with_momentum(1.0)).starts_with("momentum = 1"));
}

#[test]
fn rows_of_sh_give_atoms_as_good_as_their_dictionary() {
    let mut rng = SplitMix64::new(32);
    let degree = ShDegree::new(2).unwrap();
    let rows = sparse_rows(&random_atoms(24, 30, &mut rng), 3, 800, &mut rng);
    let options = LearnOptions::new(tolerance(0.1));
    let dictionary = learn(degree, &rows, &options, &Silent).unwrap();
    let atoms = learn_atoms(24, &rows, &options, &Silent).unwrap();
    assert_eq!((dictionary.sample, dictionary.rounds + 10), (atoms.sample, atoms.rounds));
    let [expected, _] = cost(dictionary.dictionary.atoms(), &rows, tolerance(0.1));
    let [nonzeros, _] = cost(&atoms.atoms, &rows, tolerance(0.1));
    assert!(nonzeros < 1.05 * expected, "{nonzeros} {expected}");
}

#[test]
fn atoms_of_any_length_are_learned() {
    let mut rng = SplitMix64::new(33);
    for (dim, count) in [(10, 15), (31, 40), (64, 70)] {
        let hidden = random_atoms(dim, count, &mut rng);
        let rows = sparse_rows(&hidden, 2, 40 * count, &mut rng);
        let learned = learned(&rows, dim, count, tolerance(0.1));
        let [best, _] = cost(&hidden, &rows, tolerance(0.1));
        let [random, _] = cost(&random_atoms(dim, count, &mut rng), &rows, tolerance(0.1));
        let [nonzeros, error] = cost(&learned.atoms, &rows, tolerance(0.1));
        assert!(error <= 0.1);
        assert!(nonzeros < 2.5 * best, "{dim}: {nonzeros} nonzeros, {best} with the hidden atoms");
        assert!(nonzeros < 0.6 * random, "{dim}: {nonzeros} nonzeros, {random} with random atoms");
    }
}

/// With few atoms for long rows, no code reaches the tolerance. The atoms still come to span the space that the rows span.
#[test]
fn atoms_are_learned_from_rows_out_of_reach() {
    let mut rng = SplitMix64::new(34);
    let hidden = random_atoms(40, 6, &mut rng);
    let rows = sparse_rows(&hidden, 6, 500, &mut rng);
    let stop = tolerance(0.001);
    let [_, least] = cost(&hidden, &rows, stop);
    let learned = learned(&rows, 40, 6, stop);
    let [nonzeros, error] = cost(&learned.atoms, &rows, stop);
    assert!(error < 1.1 * least, "{error} {least}");
    assert!(nonzeros > 5.9, "every row needs all: {nonzeros}");
}

#[test]
fn threads_do_not_change_the_atoms() {
    let mut rng = SplitMix64::new(35);
    let rows = sparse_rows(&random_atoms(13, 20, &mut rng), 3, 3000, &mut rng);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| learned(&rows, 13, 20, tolerance(0.1)).atoms)
    };
    let one = on(1);
    assert_eq!(on(2), one);
    assert_eq!(on(7), one);
}

struct Cancelled;

impl Progress for Cancelled {
    fn is_cancelled(&self) -> bool {
        true
    }
}

#[test]
fn learning_can_be_cancelled() {
    let options = LearnOptions::new(tolerance(0.1));
    let result = learn_atoms(2, &[0.5; 100], &options, &Cancelled);
    assert!(matches!(result, Err(Error::Cancelled)));
}
