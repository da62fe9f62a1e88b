//! Tests that many rows at once have the same codes as one row at a time, if these codes are within the tolerance.

use super::oracle::{random_atoms, random_rows};
use crate::sparse::model::Pursuit;
use crate::sparse::pursuit::{Coder, Encoded, StopRule, ValueType, encode_rows};
use crate::support::error::Error;
use crate::support::progress::{Progress, Silent, Stage};
use crate::support::rng::SplitMix64;
use std::sync::atomic::{AtomicU64, Ordering};

fn coder(dim: usize, atoms: usize, tolerance: f64, rng: &mut SplitMix64) -> Coder {
    let stop = StopRule::new(Some(tolerance), None).unwrap();
    Coder::over(&random_atoms(dim, atoms, rng), Pursuit::Ols, stop, ValueType::F32)
}

/// Returns the codes of [`Coder::encode`], and whether each code is within the tolerance.
fn one_by_one(coder: &Coder, rows: &[f32]) -> Vec<(Vec<(usize, f32)>, bool)> {
    let mut out = Vec::new();
    coder.encode(rows, |visit| {
        let code = visit.code.iter().map(|&(atom, value)| (usize::from(atom), value)).collect();
        out.push((code, visit.outcome != Encoded::Escape));
    });
    out
}

fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

#[test]
fn all_rows_are_coded_in_order_on_any_number_of_threads() {
    let mut rng = SplitMix64::new(21);
    // The first case has rows in several batches. In the second case, some rows are out of reach, and some are not.
    for (dim, atoms, count, tolerance) in [(2, 3, 66_000, 0.3), (20, 15, 1500, 1.2), (300, 4, 5, 0.1)] {
        let coder = coder(dim, atoms, tolerance, &mut rng);
        let rows = random_rows(dim, count, 1.0, &mut rng);
        let found = on_threads(1, || encode_rows(&coder, &rows, &Silent).unwrap());
        for threads in [2, 7] {
            let again = on_threads(threads, || encode_rows(&coder, &rows, &Silent).unwrap());
            assert!(again == found, "{threads} threads, {dim} values");
        }
        assert_eq!(found.len(), count);
        assert!(dim != 20 || (1..count).contains(&found.escapes.len()), "{}", found.escapes.len());
        for (i, (code, is_within)) in one_by_one(&coder, &rows).into_iter().enumerate() {
            // An error in f32 and the error in f64 may lie on two sides of the tolerance.
            if is_within && found.errors[i] < tolerance * (1.0 - 1e-6) {
                assert!(found.row(i).eq(code), "row {i}");
            }
            assert_eq!(found.escapes.binary_search(&i).is_ok(), found.errors[i] > tolerance);
        }
    }
}

#[test]
fn odd_rows_are_refused_or_coded() {
    let coder = coder(3, 5, 0.1, &mut SplitMix64::new(22));
    let none = encode_rows::<f32>(&coder, &[], &Silent).unwrap();
    assert!(none.is_empty() && none.starts == [0]);
    let zeros = encode_rows(&coder, &[0.0; 6], &Silent).unwrap();
    assert_eq!((&zeros.starts[..], &zeros.errors[..]), (&[0, 0, 0][..], &[0.0, 0.0][..]));
    assert!(matches!(encode_rows(&coder, &[0.0; 4], &Silent), Err(Error::Parameter { .. })));
    let mut rows = vec![0.0; 3000];
    rows[3 * 700 + 1] = f32::NAN;
    rows[3 * 900] = f32::INFINITY;
    let error = encode_rows(&coder, &rows, &Silent).unwrap_err().to_string();
    assert!(error.contains("row 700"), "{error}");
}

/// A progress that cancels after some rows.
#[derive(Default)]
struct Impatient {
    begun: AtomicU64,
    done: AtomicU64,
}

impl Progress for Impatient {
    fn begin(&self, stage: Stage, total: u64) {
        assert_eq!(stage, Stage::Code);
        self.begun.store(total, Ordering::Relaxed);
    }

    fn advance(&self, units: u64) {
        self.done.fetch_add(units, Ordering::Relaxed);
    }

    fn is_cancelled(&self) -> bool {
        self.done.load(Ordering::Relaxed) > 1000
    }
}

#[test]
fn coding_can_be_cancelled() {
    let coder = coder(3, 5, 0.1, &mut SplitMix64::new(23));
    let progress = Impatient::default();
    let cancelled = on_threads(2, || encode_rows(&coder, &vec![0.1; 3 * 200_000], &progress));
    assert!(matches!(cancelled, Err(Error::Cancelled)));
    assert_eq!(progress.begun.into_inner(), 200_000);
    assert!(progress.done.into_inner() < 60_000, "it ends soon");
}
