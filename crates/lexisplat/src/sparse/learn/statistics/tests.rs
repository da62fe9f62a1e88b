//! Tests of statistics against naive sums, of the groupings that keep all bits, and of the atoms that updates return.

use super::super::learn_atoms;
use super::super::tests::{cost, random_atoms, sparse_rows, tolerance};
use super::{ROWS_PER_BLOCK, Statistics, triangle};
use crate::sparse::atoms::Atoms;
use crate::sparse::learn::LearnOptions;
use crate::sparse::model::Pursuit;
use crate::sparse::pursuit::{Coder, RowCodes, StopRule, ValueType, encode_rows};
use crate::support::error::Error;
use crate::support::progress::{Progress, Silent};
use crate::support::rng::SplitMix64;

const DIM: usize = 7;
const ATOMS: usize = 11;
const TOLERANCE: f64 = 0.2;

fn coder(atoms: &Atoms, tol: f64) -> Coder {
    Coder::over(atoms, Pursuit::Ols, tolerance(tol), ValueType::F32)
}

/// Returns random atoms, and rows that are sums of other atoms.
fn example(rows: usize) -> (Atoms, Vec<f32>) {
    let mut rng = SplitMix64::new(41);
    let atoms = random_atoms(DIM, ATOMS, &mut rng);
    let rows = sparse_rows(&random_atoms(DIM, 9, &mut rng), 3, rows, &mut rng);
    (atoms, rows)
}

/// Returns a rule of at most 3 nonzeros, which is as many as the atoms that each row is made of.
fn few() -> StopRule {
    StopRule::new(None, Some(3)).unwrap()
}

fn few_coder(atoms: &Atoms) -> Coder {
    Coder::over(atoms, Pursuit::Ols, few(), ValueType::F32)
}

fn statistics(atoms: &Atoms, rows: &[f32]) -> Statistics {
    Statistics::of(&coder(atoms, TOLERANCE), rows, &Silent).unwrap()
}

/// Returns the codes as full vectors.
fn dense(codes: &RowCodes, atoms: usize) -> Vec<Vec<f64>> {
    let full = |i: usize| {
        let mut out = vec![0.0; atoms];
        codes.row(i).for_each(|(atom, value)| out[atom] = f64::from(value));
        out
    };
    (0..codes.len()).map(full).collect()
}

/// Returns all bits of `statistics`.
fn bits(statistics: &Statistics) -> Vec<u8> {
    statistics.to_bytes()
}

#[test]
fn sums_are_those_of_full_matrices() {
    // The second case has few atoms for long rows, so that rows are out of reach.
    for (dim, count) in [(DIM, ATOMS), (9, 4), (1, 1)] {
        let mut rng = SplitMix64::new(42);
        let atoms = random_atoms(dim, count, &mut rng);
        let rows = sparse_rows(&random_atoms(dim, 9, &mut rng), 3, 600, &mut rng);
        let coder = coder(&atoms, 0.1);
        let codes = encode_rows(&coder, &rows, &Silent).unwrap();
        assert_eq!(codes.escapes.is_empty(), dim != 9);
        let full = dense(&codes, count);
        let sums = Statistics::of(&coder, &rows, &Silent).unwrap();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-11 * (1.0 + b.abs()), "{a} {b}");
        for j in 0..count {
            for k in 0..count {
                near(sums.pair(j, k), full.iter().map(|g| g[j] * g[k]).sum());
            }
            near(sums.energy(j), full.iter().map(|g| g[j] * g[j]).sum());
            for d in 0..dim {
                let naive = full.iter().zip(rows.chunks_exact(dim)).map(|(g, x)| g[j] * f64::from(x[d]));
                near(sums.products[j * dim + d], naive.sum());
            }
        }
        assert_eq!((sums.rows(), sums.nonzeros()), (600.0, codes.atoms.len() as f64));
        near(sums.squared_error(), codes.errors.iter().map(|e| e * e).sum());
        assert_eq!((sums.dim(), sums.atoms()), (dim, count));
    }
}

#[test]
fn threads_and_the_place_of_blocks_do_not_change_bits() {
    // There are more blocks than may wait at once.
    let (atoms, rows) = example(300 * ROWS_PER_BLOCK + 50);
    let whole = statistics(&atoms, &rows);
    for threads in [1, 2, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert!(bits(&pool.install(|| statistics(&atoms, &rows))) == bits(&whole), "{threads} threads");
    }
    let mut sum = Statistics::zero(&atoms);
    for block in rows.chunks(ROWS_PER_BLOCK * DIM) {
        let sent = statistics(&atoms, block).to_bytes();
        sum.add(&Statistics::from_bytes(&sent).unwrap()).unwrap();
    }
    assert!(bits(&sum) == bits(&whole));
    // The first half may also be summed as a whole, since the sum of all rows begins with it.
    let (first, second) = rows.split_at(150 * ROWS_PER_BLOCK * DIM);
    let mut sum = statistics(&atoms, first);
    for block in second.chunks(ROWS_PER_BLOCK * DIM) {
        sum.add(&statistics(&atoms, block)).unwrap();
    }
    assert!(bits(&sum) == bits(&whole));
    // The sums of two halves are grouped differently. They are the same sums but for rounding.
    let mut halves = statistics(&atoms, first);
    halves.add(&statistics(&atoms, second)).unwrap();
    assert_eq!((halves.rows(), halves.nonzeros()), (whole.rows(), whole.nonzeros()));
    let scale = whole.energy(0);
    for (a, b) in halves.products.iter().zip(&whole.products).chain(halves.pairs.iter().zip(&whole.pairs)) {
        assert!((a - b).abs() < 1e-10 * scale, "{a} {b}");
    }
}

#[test]
fn older_rows_are_forgotten() {
    let (atoms, rows) = example(100);
    let whole = statistics(&atoms, &rows);
    let half = whole.clone().scaled(0.5).unwrap();
    assert_eq!(half.rows(), 50.0);
    assert_eq!(half.energy(3), whole.energy(3) * 0.5);
    assert_eq!(half.products[5], whole.products[5] * 0.5);
    assert!(whole.clone().scaled(0.0).unwrap().products.iter().all(|p| *p == 0.0));
    for factor in [-0.1, 1.1, f64::NAN] {
        assert!(matches!(whole.clone().scaled(factor), Err(Error::Parameter { .. })));
    }
}

/// Returns the squared error of `rows` as sums of `atoms` with the values of `codes`.
fn misfit(atoms: &Atoms, codes: &RowCodes, rows: &[f32]) -> f64 {
    let mut sum = 0.0;
    for (i, row) in rows.chunks_exact(atoms.dim()).enumerate() {
        let mut left: Vec<f64> = row.iter().map(|&x| f64::from(x)).collect();
        for (atom, value) in codes.row(i) {
            for (l, a) in left.iter_mut().zip(atoms.atom(atom)) {
                *l -= f64::from(value) * f64::from(*a);
            }
        }
        sum += left.iter().map(|l| l * l).sum::<f64>();
    }
    sum
}

#[test]
fn an_update_fits_the_atoms_to_the_codes() {
    let (atoms, rows) = example(500);
    let codes = encode_rows(&coder(&atoms, TOLERANCE), &rows, &Silent).unwrap();
    let sums = statistics(&atoms, &rows);
    let (mut last, mut current) = (misfit(&atoms, &codes, &rows), atoms.clone());
    let first = last;
    for pass in 0..5 {
        current = sums.update(&current).unwrap();
        let error = misfit(&current, &codes, &rows);
        assert!(error <= last * (1.0 + 1e-6), "pass {pass}: {error} {last}");
        last = error;
    }
    assert!(last < 0.98 * first, "{last} {first}");
    // The first atom after one pass is the best unit vector for the residuals that the other atoms leave of its rows.
    let full = dense(&codes, ATOMS);
    let mut target = vec![0.0; DIM];
    for (g, row) in full.iter().zip(rows.chunks_exact(DIM)) {
        for (d, t) in target.iter_mut().enumerate() {
            let others: f64 = (1..ATOMS).map(|k| g[k] * f64::from(atoms.atom(k)[d])).sum();
            *t += g[0] * (f64::from(row[d]) - others);
        }
    }
    let norm = target.iter().map(|t| t * t).sum::<f64>().sqrt();
    for (a, t) in sums.update(&atoms).unwrap().atom(0).iter().zip(&target) {
        assert!((f64::from(*a) - t / norm).abs() < 1e-6, "{a} {}", t / norm);
    }
}

#[test]
fn unused_atoms_stay_as_they_are() {
    let mut rng = SplitMix64::new(43);
    let atoms = random_atoms(DIM, ATOMS, &mut rng);
    let rows: Vec<f32> = (0..40).flat_map(|_| atoms.atom(4).to_vec()).collect();
    let sums = statistics(&atoms, &rows);
    let used: Vec<usize> = (0..ATOMS).filter(|&j| sums.energy(j) > 0.0).collect();
    assert_eq!(used, [4]);
    let new = sums.update(&atoms).unwrap();
    for j in (0..ATOMS).filter(|&j| j != 4) {
        assert_eq!(new.atom(j), atoms.atom(j), "atom {j}");
    }
    // Without rows, and with rows of zeros, no atom moves.
    assert_eq!(Statistics::zero(&atoms).update(&atoms).unwrap(), atoms);
    let zeros = statistics(&atoms, &[0.0; 10 * DIM]);
    assert_eq!((zeros.rows(), zeros.nonzeros()), (10.0, 0.0));
    assert_eq!(zeros.update(&atoms).unwrap(), atoms);
    // The smallest and the largest rows give finite atoms.
    for scale in [1e-30, 1e14, 1e20] {
        let rows: Vec<f32> = rows.iter().map(|x| scale * x).collect();
        let sums = Statistics::of(&coder(&atoms, 1e-37), &rows, &Silent).unwrap();
        sums.update(&atoms).unwrap();
    }
}

/// Rounds of coding and updating, from random atoms, come near the error of atoms that are learned from all rows at once.
/// Codes with few nonzeros leave residuals that move the atoms far.
#[test]
fn rounds_learn_a_dictionary() {
    let mut rng = SplitMix64::new(44);
    let (dim, count) = (16, 24);
    let rows = sparse_rows(&random_atoms(dim, count, &mut rng), 3, 3000, &mut rng);
    let mut atoms = random_atoms(dim, count, &mut rng);
    let first = [cost(&atoms, &rows, few()), cost(&atoms, &rows, tolerance(0.1))];
    for _ in 0..60 {
        atoms = Statistics::of(&few_coder(&atoms), &rows, &Silent).unwrap().update(&atoms).unwrap();
    }
    let options = LearnOptions::new(few()).with_atoms(Some(count));
    let learned = learn_atoms(dim, &rows, &options, &Silent).unwrap().atoms;
    let (error, best) = (cost(&atoms, &rows, few())[1], cost(&learned, &rows, few())[1]);
    assert!(error < 0.5 * first[0][1], "{error} {first:?} {best}");
    assert!(error < 1.7 * best, "{error} {first:?} {best}");
    let [nonzeros, _] = cost(&atoms, &rows, tolerance(0.1));
    assert!(nonzeros < 0.7 * first[1][0], "{nonzeros} {first:?}");
}

/// Mairal's method: batches pass several times, and older sums fade.
#[test]
fn batches_learn_a_dictionary() {
    let mut rng = SplitMix64::new(45);
    let (dim, count) = (16, 24);
    let rows = sparse_rows(&random_atoms(dim, count, &mut rng), 3, 4096, &mut rng);
    let mut atoms = random_atoms(dim, count, &mut rng);
    let [_, first] = cost(&atoms, &rows, few());
    let mut memory = Statistics::zero(&atoms);
    for _ in 0..8 {
        for batch in rows.chunks(512 * dim) {
            memory = memory.scaled(0.8).unwrap();
            memory.add(&Statistics::of(&few_coder(&atoms), batch, &Silent).unwrap()).unwrap();
            atoms = memory.update(&atoms).unwrap();
        }
    }
    let [_, error] = cost(&atoms, &rows, few());
    assert!(error < 0.5 * first, "{error} {first}");
}

#[test]
fn other_sizes_are_refused() {
    let (atoms, rows) = example(10);
    let mut sums = statistics(&atoms, &rows);
    let mut rng = SplitMix64::new(46);
    for (dim, count) in [(DIM, ATOMS - 1), (DIM + 1, ATOMS), (ATOMS, DIM)] {
        let other = random_atoms(dim, count, &mut rng);
        assert!(matches!(sums.add(&Statistics::zero(&other)), Err(Error::Parameter { .. })));
        assert!(matches!(sums.update(&other), Err(Error::Parameter { .. })));
    }
    let of = |rows: &[f32]| Statistics::of(&coder(&atoms, TOLERANCE), rows, &Silent);
    assert!(matches!(of(&[0.0; DIM + 1]), Err(Error::Parameter { .. })));
    let error = of(&[f32::NAN; DIM]).unwrap_err().to_string();
    assert!(error.contains("row 0"), "{error}");
}

struct Cancelled;

impl Progress for Cancelled {
    fn is_cancelled(&self) -> bool {
        true
    }
}

#[test]
fn summing_can_be_cancelled() {
    let (atoms, rows) = example(10);
    let result = Statistics::of(&coder(&atoms, TOLERANCE), &rows, &Cancelled);
    assert!(matches!(result, Err(Error::Cancelled)));
}

#[test]
fn bytes_are_read_back_or_refused() {
    let (atoms, rows) = example(300);
    let sums = statistics(&atoms, &rows);
    let bytes = sums.to_bytes();
    assert_eq!(bytes.len(), 40 + 8 * (ATOMS * (ATOMS + 1) / 2 + ATOMS * DIM));
    assert_eq!(Statistics::from_bytes(&bytes).unwrap(), sums);
    for len in 0..bytes.len() {
        assert!(matches!(Statistics::from_bytes(&bytes[..len]), Err(Error::Parameter { .. })), "{len} bytes");
    }
    let refused = |at: usize, new: &[u8]| {
        let mut changed = bytes.clone();
        changed[at..at + new.len()].copy_from_slice(new);
        Statistics::from_bytes(&changed).unwrap_err().to_string()
    };
    assert!(refused(0, b"PNG").contains("LXST"));
    assert!(refused(4, &[2]).contains("version 2"));
    assert!(refused(8, &0_u32.to_le_bytes()).starts_with("dim = 0"));
    assert!(refused(8, &u32::MAX.to_le_bytes()).starts_with("dim = "));
    assert!(refused(8, &8_u32.to_le_bytes()).contains("bytes"));
    assert!(refused(12, &0_u32.to_le_bytes()).contains("0 atoms"));
    assert!(refused(12, &u32::MAX.to_le_bytes()).contains("atoms"));
    assert!(refused(16, &(-1.0_f64).to_le_bytes()).contains("negative"));
    let energy = 40 + 8 * (triangle(3) + 3);
    assert!(refused(energy, &(-1.0_f64).to_le_bytes()).contains("negative"));
    assert!(refused(bytes.len() - 8, &f64::NAN.to_le_bytes()).contains("NaN"));
    assert!(refused(24, &f64::INFINITY.to_le_bytes()).contains("NaN"));
    let longer = [&bytes[..], &[0]].concat();
    assert!(Statistics::from_bytes(&longer).is_err());
}
