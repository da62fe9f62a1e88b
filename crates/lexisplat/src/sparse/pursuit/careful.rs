//! A pursuit in f64, for the rows that the fast pursuit in f32 leaves over the tolerance.
//!
//! It first takes the atoms that the fast pursuit took, in the same order. Their values are refitted at every step, and the
//! pursuit ends at the first atom with which the row is within the tolerance. After these atoms, it chooses further atoms
//! by itself. In the end, the residual is only the part of the row outside the span of all atoms. A row that stays over the
//! tolerance therefore has no code within it, unless the number of nonzeros is capped.
//!
//! Rows are scaled by a power of two to values below 1, so that rows of any size have the same codes up to that factor.

use super::ValueType;
use super::engine::Coder;
use crate::sparse::model::Pursuit;
use crate::sparse::row_value::RowValue;

/// Squared distance to the chosen span below which an atom counts as part of the span. Two atoms that differ at all in f32
/// are farther apart.
const MIN_SPAN_DISTANCE: f64 = 1e-16;
/// Share of the row's energy. An atom that lowers the squared residual by no more than this share would only add rounding
/// noise of f64.
const NOISE_GAIN: f64 = 1e-30;
/// Number of partial sums of an inner product. With several sums, additions need not wait for each other.
const SUMS: usize = 8;

/// The atoms of a coder in f64.
#[derive(Debug)]
pub(super) struct Careful<'a> {
    coder: &'a Coder,
    dim: usize,
    /// All atoms, one after the other.
    atoms: Vec<f64>,
}

/// Working memory for one row at a time.
#[derive(Debug, Default)]
pub(super) struct Work {
    /// The row, scaled.
    row: Vec<f64>,
    /// The residual of the row over the chosen atoms.
    residual: Vec<f64>,
    /// Orthonormal directions of the chosen span, one after the other.
    basis: Vec<f64>,
    /// Coordinates of each chosen atom in the basis. The first atom has one coordinate, the second two, and so on.
    triangle: Vec<f64>,
    /// Coordinates of the row in the basis.
    amplitudes: Vec<f64>,
    /// The chosen atoms, in order.
    chosen: Vec<u16>,
    /// For each atom, whether it is chosen or was found to be in the span.
    taken: Vec<bool>,
    /// Squared distance of every atom to the span of the first `measured` directions.
    distances: Vec<f64>,
    measured: usize,
    /// Scratch space for an atom on its way into the basis, or for the residual of a row.
    scratch: Vec<f64>,
}

/// A code, and the un-squared L2 norm of its error.
#[derive(Debug)]
pub(super) struct Found<T> {
    /// Pairs (atom, value), by ascending atom.
    pub(super) code: Vec<(u16, T)>,
    pub(super) error: f64,
}

impl<'a> Careful<'a> {
    pub(super) fn new(coder: &'a Coder) -> Self {
        let atoms = (0..coder.atoms()).flat_map(|j| coder.atom(j)).map(f64::from).collect();
        Self { coder, dim: coder.dim(), atoms }
    }

    fn atom(&self, j: usize) -> &[f64] {
        &self.atoms[j * self.dim..(j + 1) * self.dim]
    }

    /// Returns the un-squared L2 norm of the error of `code`. Values times atoms are subtracted in f64, in the order of the
    /// pairs.
    pub(super) fn error<T: RowValue>(&self, row: &[T], code: &[(u16, T)], work: &mut Work) -> f64 {
        let left = &mut work.scratch;
        left.clear();
        left.extend(row.iter().map(|x| x.wide()));
        for &(atom, value) in code {
            subtract(left, value.wide(), self.atom(atom.into()));
        }
        dot(left, left).sqrt()
    }

    /// Codes `row`, beginning with the atoms `first`. If no code is within the tolerance, returns the nearest code found.
    /// This code is empty if no error is below the row's norm.
    pub(super) fn code<T: RowValue>(&self, row: &[T], first: &[u16], work: &mut Work) -> Found<T> {
        let largest = row.iter().map(|x| x.wide().abs()).fold(0.0, f64::max);
        let (_, exponent) = libm::frexp(largest);
        let norm = work.start(row, exponent, self.coder.atoms());
        let mut found = Found { code: Vec::new(), error: norm };
        let promise = libm::scalbn(self.coder.promise(), -exponent);
        let cap = self.coder.max_nonzeros().unwrap_or(self.dim).min(self.dim);
        let mut first = first.iter();
        loop {
            let is_within = dot(&work.residual, &work.residual).sqrt() <= promise;
            let is_full = work.chosen.len() >= cap;
            let is_last = is_full || (!is_within && !self.take_next(&mut first, norm, work));
            if is_within || is_last {
                let next = self.solve(exponent, work);
                if next.error < found.error {
                    found = next;
                }
                // Rounding may have raised the error above the tolerance. More atoms may then lower the error.
                if is_last || found.error <= promise || !self.take_next(&mut first, norm, work) {
                    break;
                }
            }
        }
        Found { error: libm::scalbn(found.error, exponent), ..found }
    }

    /// Takes one more atom: the next of `first`, or else the atom that helps most. Returns whether there was such an atom.
    fn take_next(&self, first: &mut std::slice::Iter<'_, u16>, norm: f64, work: &mut Work) -> bool {
        loop {
            let next = first.next().map(|&atom| usize::from(atom)).or_else(|| self.best(norm, work));
            match next {
                None => return false,
                Some(atom) if self.take(atom, work) => return true,
                // The atom is in the span, and is not chosen again.
                Some(_) => {}
            }
        }
    }

    /// Returns the atom that lowers the residual most by the rule of the pursuit; `None` if no atom lowers it.
    fn best(&self, norm: f64, work: &mut Work) -> Option<usize> {
        let Work { basis, distances, measured, taken, residual, .. } = work;
        if self.coder.pursuit() == Pursuit::Ols {
            distances.resize(taken.len(), 1.0);
            for direction in basis[*measured * self.dim..].chunks_exact(self.dim) {
                for (distance, atom) in distances.iter_mut().zip(self.atoms.chunks_exact(self.dim)) {
                    let along = dot(direction, atom);
                    *distance -= along * along;
                }
            }
            *measured = basis.len() / self.dim;
        }
        let mut best = (NOISE_GAIN * norm * norm, None);
        for (j, atom) in self.atoms.chunks_exact(self.dim).enumerate().filter(|&(j, _)| !taken[j]) {
            let correlation = dot(atom, residual);
            let gain = match distances.get(j) {
                Some(distance) => correlation * correlation / distance.max(MIN_SPAN_DISTANCE),
                None => correlation * correlation,
            };
            if gain > best.0 {
                best = (gain, Some(j));
            }
        }
        best.1
    }

    /// Adds `atom` to the basis. Returns `false` if the atom is in the span, or was taken before.
    fn take(&self, atom: usize, work: &mut Work) -> bool {
        if std::mem::replace(&mut work.taken[atom], true) {
            return false;
        }
        let (new, begin) = (&mut work.scratch, work.triangle.len());
        new.clear();
        new.extend_from_slice(self.atom(atom));
        work.triangle.resize(begin + work.chosen.len(), 0.0);
        // The second projection removes the part that rounding left in the first.
        for _ in 0..2 {
            let directions = work.basis.chunks_exact(self.dim);
            for (coordinate, direction) in work.triangle[begin..].iter_mut().zip(directions) {
                let along = dot(direction, new);
                subtract(new, along, direction);
                *coordinate += along;
            }
        }
        let distance = dot(new, new);
        if distance < MIN_SPAN_DISTANCE {
            work.triangle.truncate(begin);
            return false;
        }
        let length = distance.sqrt();
        new.iter_mut().for_each(|x| *x /= length);
        let amplitude = dot(new, &work.residual);
        subtract(&mut work.residual, amplitude, new);
        work.basis.extend_from_slice(new);
        work.triangle.push(length);
        work.amplitudes.push(amplitude);
        #[expect(clippy::cast_possible_truncation, reason = "there are at most 1024 atoms")]
        work.chosen.push(atom as u16);
        true
    }

    /// Returns the code with the least-squares values of the chosen atoms, and its error. The values are those of the
    /// scaled row, times two to the power `exponent`, rounded as they are stored. The error is that of the scaled row. Each
    /// value is rounded before the next value is solved for, so that the next value makes up for the rounding.
    fn solve<T: RowValue>(&self, exponent: i32, work: &mut Work) -> Found<T> {
        let mut right = work.amplitudes.clone();
        let mut code = Vec::with_capacity(right.len());
        let mut end = work.triangle.len();
        for l in (0..right.len()).rev() {
            let column = &work.triangle[end - l - 1..end];
            end -= l + 1;
            let stored: T = self.rounded(libm::scalbn(right[l] / column[l], exponent));
            let value = libm::scalbn(stored.wide(), -exponent);
            subtract(&mut right[..l], value, column);
            code.push((work.chosen[l], stored));
        }
        code.retain(|&(_, value)| value != T::default());
        code.sort_unstable_by_key(|&(atom, _)| atom);
        let left = &mut work.scratch;
        left.clone_from(&work.row);
        for &(atom, value) in &code {
            subtract(left, libm::scalbn(value.wide(), -exponent), self.atom(atom.into()));
        }
        Found { code, error: dot(left, left).sqrt() }
    }

    /// Returns `value` rounded as it is stored.
    fn rounded<T: RowValue>(&self, value: f64) -> T {
        T::nearest(match self.coder.value_type() {
            ValueType::F16 => half::f16::from_f64(value).to_f64(),
            ValueType::F32 => value,
        })
    }
}

impl Work {
    /// Starts on `row`, scaled by two to the power `-exponent`. Returns its norm.
    fn start<T: RowValue>(&mut self, row: &[T], exponent: i32, atoms: usize) -> f64 {
        self.row.clear();
        self.row.extend(row.iter().map(|x| libm::scalbn(x.wide(), -exponent)));
        self.residual.clone_from(&self.row);
        self.basis.clear();
        self.triangle.clear();
        self.amplitudes.clear();
        self.chosen.clear();
        self.taken.clear();
        self.taken.resize(atoms, false);
        self.distances.clear();
        self.measured = 0;
        dot(&self.row, &self.row).sqrt()
    }
}

/// Returns the inner product of `a` and `b`, in fixed partial sums.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; SUMS];
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<SUMS>(), b.as_chunks::<SUMS>());
    for (a, b) in a.iter().zip(b) {
        for k in 0..SUMS {
            sums[k] += a[k] * b[k];
        }
    }
    for ((sum, a), b) in sums.iter_mut().zip(a_rest).zip(b_rest) {
        *sum += a * b;
    }
    ((sums[0] + sums[4]) + (sums[2] + sums[6])) + ((sums[1] + sums[5]) + (sums[3] + sums[7]))
}

/// Subtracts `factor` times `row` from `values`. `row` may be longer.
fn subtract(values: &mut [f64], factor: f64, row: &[f64]) {
    values.iter_mut().zip(row).for_each(|(v, r)| *v -= factor * r);
}
