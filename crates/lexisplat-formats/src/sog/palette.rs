//! A palette of SH: rows of coefficients that represent many rows.
//!
//! First the group of the largest error is split, until there are enough groups ([`super::tree`]). Then a few rounds of
//! Lloyd's algorithm move the entries. An exact search for the nearest of 65,536 entries would take minutes for each
//! round. Entries are therefore grouped, and a row is compared only with the entries of the groups nearest to it.
//!
//! All sums are taken in the same order for any number of threads.

use std::collections::HashMap;

use lexisplat::{Progress, Result};

use super::tree;
use super::vectors::{Rows, add, distance};

/// Number of rounds of Lloyd's algorithm.
const ROUNDS: usize = 6;
/// Number of groups of entries whose entries a row is compared with.
const PROBES: usize = 16;
/// Largest number of groups of entries.
const MOST_GROUPS: usize = 512;
/// Largest number of rows from which the entries are found. Of more rows every second, every third and so on is used.
const MOST_TRAINING: usize = 1 << 20;
/// Number of rows of one task.
const ROWS_PER_TASK: usize = 1024;

/// The entries, and the index of each row's entry.
#[derive(Debug, PartialEq)]
pub(super) struct Palette {
    /// Entries, which have the width of the rows. They are in the order in which the rows of the scene first use them.
    pub(super) entries: Vec<f32>,
    pub(super) labels: Vec<u32>,
}

/// Returns a palette of at most `most` entries for `rows`. If there are at most `most` different rows, the entries are
/// these rows.
///
/// # Errors
/// [`Error::Cancelled`](lexisplat::Error::Cancelled) soon after `progress` cancels. Every split and every task asks it.
pub(super) fn palette(rows: Rows<'_>, most: usize, progress: &dyn Progress) -> Result<Palette> {
    if let Some(palette) = distinct(rows, most) {
        return Ok(palette);
    }
    let step = rows.len().div_ceil(MOST_TRAINING).max(1);
    let sample: Vec<f32> = (0..rows.len()).step_by(step).flat_map(|i| rows.get(i)).copied().collect();
    let sample = Rows { values: &sample, width: rows.width };
    let mut entries = tree::split(sample, most, progress)?;
    let mut labels = vec![0; sample.len()];
    for _ in 0..ROUNDS {
        let distances = assign(sample, &entries, &mut labels, progress)?;
        update(sample, &labels, &distances, &mut entries);
    }
    labels = vec![0; rows.len()];
    assign(rows, &entries, &mut labels, progress)?;
    Ok(by_appearance(&entries, labels, rows.width))
}

/// Returns a palette of the different rows; `None` if there are more than `most`.
fn distinct(rows: Rows<'_>, most: usize) -> Option<Palette> {
    let mut seen = HashMap::new();
    let mut palette = Palette { entries: Vec::new(), labels: Vec::with_capacity(rows.len()) };
    for row in rows.values.chunks_exact(rows.width) {
        let bits: Vec<u32> = row.iter().map(|v| v.to_bits()).collect();
        let next = u32::try_from(seen.len()).ok()?;
        let label = *seen.entry(bits).or_insert(next);
        if label == next {
            palette.entries.extend_from_slice(row);
        }
        if seen.len() > most {
            return None;
        }
        palette.labels.push(label);
    }
    Some(palette)
}

/// Sorts entries into the order in which rows first use them, and removes unused entries.
fn by_appearance(entries: &[f32], mut labels: Vec<u32>, width: usize) -> Palette {
    let entries = Rows { values: entries, width };
    let mut new_labels = vec![u32::MAX; entries.len()];
    let mut ordered = Vec::with_capacity(entries.values.len());
    let mut count = 0;
    for label in &mut labels {
        let entry = &mut new_labels[*label as usize];
        if *entry == u32::MAX {
            *entry = count;
            count += 1;
            ordered.extend_from_slice(entries.get(*label as usize));
        }
        *label = *entry;
    }
    Palette { entries: ordered, labels }
}

/// Entries in groups of similar entries.
struct Groups {
    means: Vec<f32>,
    /// Entries group by group. Below: their indices in the palette.
    entries: Vec<f32>,
    numbers: Vec<u32>,
    /// Start of each group, and the end of the last.
    starts: Vec<usize>,
}

impl Groups {
    fn new(entries: Rows<'_>, progress: &dyn Progress) -> Result<Self> {
        let count = entries.len().isqrt().saturating_mul(2).clamp(1, MOST_GROUPS);
        let means = tree::split(entries, count, progress)?;
        let of_means = Rows { values: &means, width: entries.width };
        let mut nearest = vec![0_u32; entries.len()];
        each_chunk(&mut nearest, progress, |first, nearest| {
            for (i, nearest) in (first..).zip(nearest) {
                let row = entries.get(i);
                *nearest = best((0_u32..).zip(of_means.values.chunks_exact(entries.width)), row).0;
            }
        })?;
        let mut numbers: Vec<u32> = (0_u32..).take(entries.len()).collect();
        numbers.sort_by_key(|&i| nearest[i as usize]);
        let values = numbers.iter().flat_map(|&i| entries.get(i as usize)).copied().collect();
        let group_of = |entry: &u32| nearest[*entry as usize] as usize;
        let starts = (0..=of_means.len()).map(|g| numbers.partition_point(|i| group_of(i) < g)).collect();
        Ok(Self { means, entries: values, numbers, starts })
    }

    /// Returns the index of an entry near to `row`, and its squared distance. `order` is scratch memory.
    fn nearest(&self, row: &[f32], order: &mut Vec<(f32, usize)>) -> (u32, f32) {
        let width = row.len();
        order.clear();
        order.extend(self.means.chunks_exact(width).enumerate().map(|(g, mean)| (distance(row, mean), g)));
        let compare = |a: &(f32, usize), b: &(f32, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if order.len() > PROBES {
            order.select_nth_unstable_by(PROBES, compare);
            order.truncate(PROBES);
        }
        order.sort_unstable_by(compare);
        let mut found = (0, f32::INFINITY);
        for &(_, g) in order.iter() {
            let range = self.starts[g]..self.starts[g + 1];
            let rows = self.entries[range.start * width..range.end * width].chunks_exact(width);
            let nearer = best(self.numbers[range].iter().copied().zip(rows), row);
            if nearer.1 < found.1 {
                found = nearer;
            }
        }
        found
    }
}

/// Returns the index of the first of the nearest `rows`, and its squared distance.
fn best<'a>(rows: impl Iterator<Item = (u32, &'a [f32])>, row: &[f32]) -> (u32, f32) {
    let mut found = (0, f32::INFINITY);
    for (number, other) in rows {
        let d = distance(row, other);
        if d < found.1 {
            found = (number, d);
        }
    }
    found
}

/// Assigns each row an entry near to it. Returns the squared distances.
fn assign(rows: Rows<'_>, entries: &[f32], labels: &mut [u32], progress: &dyn Progress) -> Result<Vec<f32>> {
    let groups = Groups::new(Rows { values: entries, width: rows.width }, progress)?;
    let mut found: Vec<(u32, f32)> = vec![(0, 0.0); rows.len()];
    each_chunk(&mut found, progress, |first, chunk| {
        let mut order = Vec::new();
        for (i, found) in (first..).zip(chunk) {
            *found = groups.nearest(rows.get(i), &mut order);
        }
    })?;
    labels.iter_mut().zip(&found).for_each(|(label, found)| *label = found.0);
    Ok(found.iter().map(|found| found.1).collect())
}

/// Moves each entry to the mean of its rows. Entries without rows move to the rows that are farthest from their entries.
fn update(rows: Rows<'_>, labels: &[u32], distances: &[f32], entries: &mut [f32]) {
    let width = rows.width;
    let mut sums = vec![0.0_f64; entries.len()];
    let mut counts = vec![0_u32; entries.len() / width];
    for (i, &label) in labels.iter().enumerate() {
        let at = label as usize;
        add(&mut sums[at * width..(at + 1) * width], rows.get(i));
        counts[at] += 1;
    }
    let mut far: Vec<usize> = Vec::new();
    if counts.contains(&0) {
        far = (0..rows.len()).collect();
        far.sort_by(|&a, &b| distances[b].total_cmp(&distances[a]));
    }
    let mut far = far.into_iter();
    for ((entry, sums), count) in entries.chunks_exact_mut(width).zip(sums.chunks_exact(width)).zip(counts) {
        if count > 0 {
            #[expect(clippy::cast_possible_truncation, reason = "values are in single precision")]
            entry.iter_mut().zip(sums).for_each(|(v, sum)| *v = (sum / f64::from(count)) as f32);
        } else if let Some(row) = far.next() {
            entry.copy_from_slice(rows.get(row));
        }
    }
}

/// Processes `items` in chunks, on all cores if there are threads. `work` gets the index of the first item of a chunk. Once
/// `progress` cancels, no further chunks are begun.
fn each_chunk<T: Send>(
    items: &mut [T],
    progress: &dyn Progress,
    work: impl Fn(usize, &mut [T]) + Sync,
) -> Result<()> {
    let task = |(k, chunk): (usize, &mut [T])| {
        progress.check()?;
        work(k * ROWS_PER_TASK, chunk);
        Ok(())
    };
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        items.par_chunks_mut(ROWS_PER_TASK).enumerate().try_for_each(task)
    }
    #[cfg(not(feature = "parallel"))]
    items.chunks_mut(ROWS_PER_TASK).enumerate().try_for_each(task)
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use lexisplat::{Error, Silent};
    use lexisplat_testing::Random;

    use super::super::vectors::LANES;
    use super::*;

    fn rows(count: usize, width: usize) -> Vec<f32> {
        let mut random = Random::new(7);
        (0..count * width).map(|_| random.unit() * random.unit()).collect()
    }

    fn error(rows: Rows<'_>, palette: &Palette) -> f64 {
        let entries = Rows { values: &palette.entries, width: rows.width };
        let pairs = palette.labels.iter().enumerate();
        pairs.map(|(i, &label)| f64::from(distance(rows.get(i), entries.get(label as usize)))).sum()
    }

    /// Plain Lloyd from every eighth row, with all distances.
    fn plain(rows: Rows<'_>, most: usize) -> f64 {
        let step = rows.len() / most;
        let mut entries: Vec<f32> = (0..most).flat_map(|k| rows.get(k * step)).copied().collect();
        let mut labels = vec![0_u32; rows.len()];
        let mut error = 0.0;
        for _ in 0..10 {
            let width = rows.width;
            let found: Vec<(u32, f32)> =
                (0..rows.len()).map(|i| best((0..).zip(entries.chunks_exact(width)), rows.get(i))).collect();
            labels.iter_mut().zip(&found).for_each(|(label, found)| *label = found.0);
            let distances: Vec<f32> = found.iter().map(|found| found.1).collect();
            error = distances.iter().map(|v| f64::from(*v)).sum();
            update(rows, &labels, &distances, &mut entries);
        }
        error
    }

    #[test]
    fn palettes_are_as_near_as_plain_ones_on_any_number_of_threads() {
        let values = rows(4000, 16);
        let rows = Rows { values: &values, width: 16 };
        let found = palette(rows, 500, &Silent).unwrap();
        assert!(found.entries.len() / 16 <= 500);
        let [ours, theirs] = [error(rows, &found), plain(rows, 500)];
        assert!(ours < 1.03 * theirs, "{ours} {theirs}");
        #[cfg(feature = "parallel")]
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert!(pool.install(|| palette(rows, 500, &Silent).unwrap()) == found);
        }
    }

    #[test]
    fn few_rows_are_kept_in_their_order() {
        let values: Vec<f32> = [3.0, 1.0, 3.0, 2.0].iter().flat_map(|v| [*v; LANES]).collect();
        let rows = Rows { values: &values, width: LANES };
        let found = palette(rows, 3, &Silent).unwrap();
        assert_eq!((found.entries.len(), found.labels), (3 * LANES, vec![0, 1, 0, 2]));
        assert_eq!(palette(rows, 2, &Silent).unwrap().labels, [0, 1, 0, 1]);
        assert_eq!(palette(Rows { values: &[], width: LANES }, 1, &Silent).unwrap().labels, [0_u32; 0]);
    }

    /// Cancels when it is asked for the time number `patience`.
    struct Impatient {
        patience: usize,
        asked: AtomicUsize,
    }

    impl Progress for Impatient {
        fn is_cancelled(&self) -> bool {
            self.asked.fetch_add(1, Ordering::Relaxed) >= self.patience
        }
    }

    #[test]
    fn it_is_asked_often_whether_to_go_on_and_ends_where_it_is_not_to() {
        let values = rows(5000, 16);
        let ask = |patience: usize| {
            let progress = Impatient { patience, asked: AtomicUsize::new(0) };
            let outcome = palette(Rows { values: &values, width: 16 }, 300, &progress);
            (outcome.map(drop), progress.asked.into_inner())
        };
        let (whole, asked) = ask(usize::MAX);
        whole.unwrap();
        // Every split of the entries, and every task of every round.
        assert!(asked > 300 + 7 * 5000 / ROWS_PER_TASK, "{asked}");
        for patience in [0, 100, 300, asked - 1] {
            let (outcome, asked) = ask(patience);
            assert!(matches!(outcome, Err(Error::Cancelled)));
            // Tasks that other threads are about to begin ask too.
            assert!(asked < patience + 100, "{asked}");
        }
    }
}
