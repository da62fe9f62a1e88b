//! Many rows at once give what one row at a time gives.

use super::oracle::{random_atoms, random_rows};
use crate::sparse::model::Pursuit;
use crate::sparse::pursuit::{Coder, Encoded, RowCodes, StopRule, ValueType, encode_rows};
use crate::support::error::Error;
use crate::support::progress::{Progress, Silent, Stage};
use crate::support::rng::SplitMix64;
use std::sync::atomic::{AtomicU64, Ordering};

fn coder(dim: usize, atoms: usize, tolerance: f64, rng: &mut SplitMix64) -> Coder {
    let stop = StopRule::new(Some(tolerance), None).unwrap();
    Coder::over(&random_atoms(dim, atoms, rng), Pursuit::Ols, stop, ValueType::F32)
}

fn one_by_one(coder: &Coder, rows: &[f32]) -> RowCodes {
    let mut out = RowCodes::default();
    for row in rows.chunks_exact(coder.dim()) {
        coder.encode(row, |visit| {
            let (code, error) = visit.nearest();
            if visit.outcome == Encoded::Escape {
                out.escapes.push(out.errors.len());
            }
            for &(atom, value) in code {
                out.atoms.push(atom);
                out.values.push(value);
            }
            out.starts.push(out.atoms.len());
            out.errors.push(error);
        });
    }
    out
}

fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

#[test]
fn all_rows_are_coded_in_order_on_any_number_of_threads() {
    let mut rng = SplitMix64::new(21);
    // The first has rows in several batches; of the second some rows are out of reach, and some are not.
    for (dim, atoms, count, tolerance) in [(2, 3, 66_000, 0.3), (20, 15, 1500, 1.2), (300, 4, 5, 0.1)] {
        let coder = coder(dim, atoms, tolerance, &mut rng);
        let rows = random_rows(dim, count, 1.0, &mut rng);
        let expected = one_by_one(&coder, &rows);
        for threads in [1, 2, 7] {
            let all = on_threads(threads, || encode_rows(&coder, &rows, &Silent).unwrap());
            assert!(all == expected, "{threads} threads, {dim} values");
        }
        assert_eq!(expected.len(), count);
        assert!(dim != 20 || (1..count).contains(&expected.escapes.len()), "{}", expected.escapes.len());
        let last: Vec<(usize, f32)> = expected.row(count - 1).collect();
        let start = expected.starts[count - 1];
        assert_eq!(last.len(), expected.atoms.len() - start);
        assert_eq!(last[0], (usize::from(expected.atoms[start]), expected.values[start]));
    }
}

#[test]
fn odd_rows_are_refused_or_coded() {
    let coder = coder(3, 5, 0.1, &mut SplitMix64::new(22));
    let none = encode_rows(&coder, &[], &Silent).unwrap();
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

/// Cancels after some rows.
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
