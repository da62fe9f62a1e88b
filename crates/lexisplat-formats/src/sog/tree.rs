//! Groups similar rows: splits the group of the largest error until there are enough groups.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::ops::Range;

use lexisplat::{Progress, Result};

use super::vectors::{LANES, Rows, add, distance};

/// Number of steps of the search for the direction of the largest spread.
const POWER_STEPS: usize = 3;

/// A group of similar rows.
#[derive(Debug)]
struct Group {
    /// Indices of the group's rows in the order.
    range: Range<usize>,
    mean: Vec<f64>,
    /// Sum of the squared distances to the mean.
    error: f64,
}

impl PartialEq for Group {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Group {}

impl PartialOrd for Group {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Groups are ordered by their error. Groups of equal error are ordered by their ranges, which differ.
impl Ord for Group {
    fn cmp(&self, other: &Self) -> Ordering {
        self.error.total_cmp(&other.error).then_with(|| other.range.start.cmp(&self.range.start))
    }
}

/// Returns the means of at most `most` groups of `rows`, one after the other. Returns an error once `progress` cancels.
pub(super) fn split(rows: Rows<'_>, most: usize, progress: &dyn Progress) -> Result<Vec<f32>> {
    let mut order: Vec<usize> = (0..rows.len()).collect();
    let mut scratch = Vec::with_capacity(rows.len());
    let mut heap = BinaryHeap::from([group(rows, &order, 0..rows.len())]);
    let mut done = Vec::new();
    while heap.len() + done.len() < most {
        progress.check()?;
        let Some(worst) = heap.pop() else { break };
        match cut(rows, &mut order[worst.range.clone()], &worst.mean, &mut scratch) {
            0 => done.push(worst),
            first => {
                let Range { start, end } = worst.range;
                heap.push(group(rows, &order, start..start + first));
                heap.push(group(rows, &order, start + first..end));
            }
        }
    }
    let mut groups = heap.into_vec();
    groups.append(&mut done);
    groups.sort_by_key(|group| group.range.start);
    #[expect(clippy::cast_possible_truncation, reason = "values are in single precision")]
    let means = groups.iter().flat_map(|group| group.mean.iter().map(|v| *v as f32)).collect();
    Ok(means)
}

/// Returns the group of the rows `order[range]`.
fn group(rows: Rows<'_>, order: &[usize], range: Range<usize>) -> Group {
    let members = &order[range.clone()];
    let mut mean = vec![0.0; rows.width];
    members.iter().for_each(|&i| add(&mut mean, rows.get(i)));
    let count = members.len().max(1) as f64;
    mean.iter_mut().for_each(|v| *v /= count);
    #[expect(clippy::cast_possible_truncation, reason = "values are in single precision")]
    let middle: Vec<f32> = mean.iter().map(|v| *v as f32).collect();
    let error = members.iter().map(|&i| f64::from(distance(rows.get(i), &middle))).sum();
    Group { range, mean, error }
}

/// Orders `members` by their side of the mean, along the direction of their largest spread. Returns the number of rows on
/// the first side, or 0 if all rows are equal.
fn cut(rows: Rows<'_>, members: &mut [usize], mean: &[f64], scratch: &mut Vec<usize>) -> usize {
    #[expect(clippy::cast_possible_truncation, reason = "values are in single precision")]
    let mean: Vec<f32> = mean.iter().map(|v| *v as f32).collect();
    let mut spread = vec![0.0_f32; rows.width];
    for &i in members.iter() {
        for ((sum, v), m) in spread.iter_mut().zip(rows.get(i)).zip(&mean) {
            *sum += (v - m) * (v - m);
        }
    }
    let widest = (0..rows.width).fold(0, |best, k| if spread[k] > spread[best] { k } else { best });
    let mut direction = vec![0.0_f32; rows.width];
    direction[widest] = 1.0;
    for _ in 0..POWER_STEPS {
        let mut next = vec![0.0_f32; rows.width];
        for &i in members.iter() {
            let along = along(rows.get(i), &mean, &direction);
            for ((sum, v), m) in next.iter_mut().zip(rows.get(i)).zip(&mean) {
                *sum += along * (v - m);
            }
        }
        let length = next.iter().map(|v| v * v).sum::<f32>().sqrt();
        if !(length > 0.0 && length.is_finite()) {
            break;
        }
        direction = next.iter().map(|v| v / length).collect();
    }
    scratch.clear();
    let mut first = 0;
    for j in 0..members.len() {
        let i = members[j];
        if along(rows.get(i), &mean, &direction) < 0.0 {
            members[first] = i;
            first += 1;
        } else {
            scratch.push(i);
        }
    }
    members[first..].copy_from_slice(scratch);
    if scratch.is_empty() { 0 } else { first }
}

/// Returns the distance of `row` from `mean` along `direction`.
fn along(row: &[f32], mean: &[f32], direction: &[f32]) -> f32 {
    let mut sums = [0.0_f32; LANES];
    let lanes = row.as_chunks().0.iter().zip(mean.as_chunks().0).zip(direction.as_chunks().0);
    for ((row, mean), direction) in lanes {
        for k in 0..sums.len() {
            let [row, mean, direction]: [&[f32; LANES]; 3] = [row, mean, direction];
            sums[k] += (row[k] - mean[k]) * direction[k];
        }
    }
    sums.iter().sum()
}
