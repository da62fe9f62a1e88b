//! The inner loop of the pursuit: choosing atoms for one vector.

use super::lanes::{LANES, Lane, ZERO, accumulate, blocks_of, first_maximum, transposed};
use crate::scene::sh::MAX_REST;
use crate::sparse::atoms::Atoms;
use crate::sparse::model::Pursuit;

/// Squared distance to the chosen span below which an atom counts as part of the span. The f32 recurrences hold only noise
/// about the direction of such an atom.
const MIN_SPAN_DISTANCE: f32 = 1e-5;
/// The value of `BLOCKS` that stands for any number of lanes. A number of lanes that is constant makes loops faster.
pub(super) const ANY: usize = 0;
/// Number of lanes of the longest atoms of a dictionary. The lanes of longer atoms are summed in groups of this many.
const MOST_BLOCKS: usize = MAX_REST.div_ceil(LANES);
/// A lane of ones.
const ONES: Lane = Lane([1.0; LANES]);

/// Atoms prepared for pursuit: their transpose, their Gram matrix, and padded atoms.
#[derive(Debug)]
pub(super) struct Plan {
    /// Number of lanes of one per-atom array.
    blocks: usize,
    /// Number of lanes of one atom.
    atom_blocks: usize,
    pub(super) dim: usize,
    /// Number of atoms.
    pub(super) atoms: usize,
    /// `dim` rows of `blocks` lanes: entry (d, j) is coefficient d of atom j.
    transposed: Vec<Lane>,
    /// `atoms` rows of `blocks` lanes: inner products of atoms, 0 in the padding.
    gram: Vec<Lane>,
    /// `atoms` rows of `atom_blocks` lanes: the atoms, 0 in the padding.
    padded: Vec<Lane>,
}

/// Working memory for one vector at a time.
#[derive(Debug)]
pub(super) struct Scratch {
    /// Inner products of the residual with every atom.
    correlations: Vec<Lane>,
    /// Squared distance of every atom to the chosen span; infinite for atoms that are chosen or in the span.
    distances: Vec<Lane>,
    /// Row k: inner products of every atom with the k-th orthonormal direction.
    directions: Vec<Lane>,
    /// Column l: coordinates of the l-th chosen atom in the orthonormal basis, without the last coordinate.
    triangle: Vec<f32>,
    /// Last coordinate of each chosen atom.
    diagonal: Vec<f32>,
    /// Coordinates of the signal in the orthonormal basis.
    amplitudes: Vec<f32>,
    /// The atoms chosen so far, in order, and their number.
    pub(super) chosen: Vec<u16>,
    pub(super) len: usize,
    /// Squared norm of the residual, by the recurrence.
    pub(super) energy: f64,
    work: Vec<f32>,
    /// The vector that [`Plan::error`] reconstructed last, padded with zeros.
    pub(super) reconstruction: Vec<f32>,
}

impl Plan {
    pub(super) fn new(atoms: &Atoms) -> Self {
        let (dim, count) = (atoms.dim(), atoms.len());
        let (blocks, atom_blocks) = (blocks_of(count), dim.div_ceil(LANES));
        let mut gram = vec![ZERO; count * blocks];
        let mut padded = vec![ZERO; count * atom_blocks];
        for j in 0..count {
            let atom = atoms.atom(j);
            for (d, &value) in atom.iter().enumerate() {
                padded[j * atom_blocks + d / LANES].0[d % LANES] = value;
            }
            // Products are summed in f64 and rounded once. `packed::codebook` sums its products in f32 instead, which costs
            // that codec nothing, and its files depend on it.
            for i in 0..count {
                let product: f64 =
                    atom.iter().zip(atoms.atom(i)).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
                #[expect(clippy::cast_possible_truncation, reason = "the Gram matrix is kept in f32")]
                let product = product as f32;
                gram[j * blocks + i / LANES].0[i % LANES] = product;
            }
        }
        Self {
            blocks,
            atom_blocks,
            dim,
            atoms: count,
            transposed: transposed(dim, atoms.as_slice()),
            gram,
            padded,
        }
    }

    /// Returns the number of lanes of one per-atom array, which is `BLOCKS` unless that is [`ANY`].
    #[inline(always)]
    fn blocks<const BLOCKS: usize>(&self) -> usize {
        if BLOCKS == ANY { self.blocks } else { BLOCKS }
    }

    /// Returns whether every per-atom array has `blocks` lanes.
    pub(super) fn has_blocks(&self, blocks: usize) -> bool {
        self.blocks == blocks
    }

    /// Returns the values of atom `j`.
    pub(super) fn atom(&self, j: usize) -> impl Iterator<Item = f32> {
        let lanes = &self.padded[j * self.atom_blocks..(j + 1) * self.atom_blocks];
        lanes.iter().flat_map(|lane| lane.0).take(self.dim)
    }

    pub(super) fn scratch(&self) -> Scratch {
        Scratch {
            correlations: vec![ZERO; self.blocks],
            distances: vec![ZERO; self.blocks],
            directions: vec![ZERO; self.dim * self.blocks],
            triangle: vec![0.0; self.dim * self.dim],
            diagonal: vec![0.0; self.dim],
            amplitudes: vec![0.0; self.dim],
            chosen: vec![0; self.dim],
            len: 0,
            energy: 0.0,
            work: vec![0.0; self.dim],
            reconstruction: vec![0.0; self.atom_blocks * LANES],
        }
    }

    /// Starts on `signal`, whose squared norm is `energy`.
    #[inline(always)]
    pub(super) fn start<const BLOCKS: usize>(&self, s: &mut Scratch, signal: &[f32], energy: f64) {
        let blocks = self.blocks::<BLOCKS>();
        let correlations = &mut s.correlations[..blocks];
        accumulate(correlations, |_| ZERO, signal, &self.transposed, |sum, x, t| sum + x * t);
        s.distances.fill(ONES);
        s.len = 0;
        s.energy = energy;
    }

    /// Chooses one more atom. Returns `false` if no atom helps, or if `dim` atoms are chosen already.
    #[inline(always)]
    pub(super) fn step<const BLOCKS: usize>(&self, s: &mut Scratch, pursuit: Pursuit) -> bool {
        let (k, blocks) = (s.len, self.blocks::<BLOCKS>());
        if k >= self.dim {
            return false;
        }
        let Some(best) = (match pursuit {
            Pursuit::Ols => best_ratio(&s.correlations, s.distances.iter()),
            // OMP looks at the correlation alone. Atoms in the span have a correlation of 0.
            Pursuit::Omp => best_ratio(&s.correlations, std::iter::repeat(&ONES)),
        }) else {
            return false;
        };
        let (correlations, distances) = (&mut s.correlations[..blocks], &mut s.distances[..blocks]);
        let (block, lane) = (best / LANES, best % LANES);
        let length = distances[block].0[lane].sqrt();
        let amplitude = correlations[block].0[lane] / length;
        let column = &mut s.triangle[k * self.dim..k * self.dim + k];
        let (previous, new) = s.directions.split_at_mut(k * blocks);
        for (coordinate, direction) in column.iter_mut().zip(previous.iter().skip(block).step_by(blocks)) {
            *coordinate = direction.0[lane];
        }
        let new = &mut new[..blocks];
        let gram = &self.gram[best * blocks..(best + 1) * blocks];
        accumulate(new, |block| gram[block], column, previous, |sum, c, u| sum - c * u);
        // The chosen atom is in the span now, which the recurrence alone might not show because of rounding. The whole lane
        // is written, since a processor waits long to read a lane of which it has just written a part.
        let chosen = Lane(std::array::from_fn(|i| if i == lane { f32::INFINITY } else { 0.0 }));
        distances[block] = distances[block].zip(chosen, |n, chosen| n - chosen);
        let inverse = 1.0 / length;
        for ((u, r), n) in new.iter_mut().zip(correlations).zip(distances) {
            *u = u.map(|x| x * inverse);
            let distance = n.zip(*u, |n, x| n - x * x);
            let correlation = r.zip(*u, |r, x| r - amplitude * x);
            *n = distance.map(|n| if n > MIN_SPAN_DISTANCE { n } else { f32::INFINITY });
            *r = correlation.zip(distance, |r, n| if n > MIN_SPAN_DISTANCE { r } else { 0.0 });
        }
        s.diagonal[k] = length;
        s.amplitudes[k] = amplitude;
        #[expect(clippy::cast_possible_truncation, reason = "there are at most 1024 atoms")]
        {
            s.chosen[k] = best as u16;
        }
        s.len = k + 1;
        s.energy -= f64::from(amplitude) * f64::from(amplitude);
        true
    }

    /// Writes the least-squares coefficients of the chosen atoms to `code`, by ascending atom.
    #[inline(always)]
    pub(super) fn solve(&self, s: &mut Scratch, code: &mut Vec<(u16, f32)>) {
        let k = s.len;
        let right = &mut s.work[..k];
        right.copy_from_slice(&s.amplitudes[..k]);
        code.clear();
        code.resize(k, (0, 0.0));
        for l in (0..k).rev() {
            let value = right[l] / s.diagonal[l];
            let column = &s.triangle[l * self.dim..l * self.dim + l];
            for (r, &c) in right[..l].iter_mut().zip(column) {
                *r -= c * value;
            }
            // The index of an atom in `code` is the number of chosen atoms below it. The count has no branch that depends
            // on the atoms.
            let atom = s.chosen[l];
            let before: u16 = s.chosen[..k].iter().map(|&other| u16::from(other < atom)).sum();
            code[usize::from(before)] = (atom, value);
        }
    }

    /// Returns the distance in f64 of `signal` from the vector that [`crate::sparse::codes::reconstruct`] makes of
    /// `code`.
    #[inline(always)]
    pub(super) fn error(&self, s: &mut Scratch, signal: &[f32], code: &[(u16, f32)]) -> f64 {
        match self.atom_blocks {
            1 => self.reconstruct::<1>(s, code, 0),
            2 => self.reconstruct::<2>(s, code, 0),
            3 => self.reconstruct::<3>(s, code, 0),
            _ => {
                for first in (0..self.atom_blocks).step_by(MOST_BLOCKS) {
                    self.reconstruct::<MOST_BLOCKS>(s, code, first);
                }
            }
        }
        squared_distance(signal, &s.reconstruction).sqrt()
    }

    /// Computes the sums of [`crate::sparse::codes::reconstruct`] in up to `BLOCKS` lanes, from lane `first`.
    #[inline(always)]
    fn reconstruct<const BLOCKS: usize>(&self, s: &mut Scratch, code: &[(u16, f32)], first: usize) {
        let mut sums = [ZERO; BLOCKS];
        let stride = self.atom_blocks;
        for &(atom, value) in code {
            let atom = &self.padded[usize::from(atom) * stride..][first..stride];
            for (sum, lane) in sums.iter_mut().zip(atom) {
                *sum = sum.zip(*lane, |s, a| s + value * a);
            }
        }
        for (out, sum) in s.reconstruction[first * LANES..].chunks_exact_mut(LANES).zip(&sums) {
            out.copy_from_slice(&sum.0);
        }
    }
}

/// Returns the sum of squared differences of `a` and `b` in f64, in eight fixed partial sums. `b` may be longer than `a`.
#[inline(always)]
pub(super) fn squared_distance(a: &[f32], b: &[f32]) -> f64 {
    const PARTS: usize = 8;
    let mut sums = [0.0_f64; PARTS];
    let b = &b[..a.len()];
    let (a_chunks, b_chunks) = (a.chunks_exact(PARTS), b.chunks_exact(PARTS));
    for (i, (x, y)) in a_chunks.remainder().iter().zip(b_chunks.remainder()).enumerate() {
        let difference = f64::from(*x) - f64::from(*y);
        sums[i] += difference * difference;
    }
    for (x, y) in a_chunks.zip(b_chunks) {
        for i in 0..PARTS {
            let difference = f64::from(x[i]) - f64::from(y[i]);
            sums[i] += difference * difference;
        }
    }
    ((sums[0] + sums[4]) + (sums[2] + sums[6])) + ((sums[1] + sums[5]) + (sums[3] + sums[7]))
}

/// Returns the atom with the largest `correlation^2 / distance`, which lowers the residual most; `None` if no quotient is
/// above 0.
///
/// Quotients are compared by cross-multiplication, which is cheaper than a division for every entry.
#[inline(always)]
fn best_ratio<'a>(correlations: &[Lane], distances: impl Iterator<Item = &'a Lane>) -> Option<usize> {
    let mut gains = [0.0_f32; LANES];
    let mut spans = [1.0_f32; LANES];
    let mut blocks = [0_u32; LANES];
    for (number, (r, n)) in (0_u32..).zip(correlations.iter().zip(distances)) {
        // The loop uses masks instead of conditions. The compiler would turn conditions into writes to memory, which the
        // next lane waits for.
        for i in 0..LANES {
            let gain = r.0[i] * r.0[i];
            let better = if gain * spans[i] > gains[i] * n.0[i] { u32::MAX } else { 0 };
            let select = |new: u32, old: u32| (new & better) | (old & !better);
            gains[i] = f32::from_bits(select(gain.to_bits(), gains[i].to_bits()));
            spans[i] = f32::from_bits(select(n.0[i].to_bits(), spans[i].to_bits()));
            blocks[i] = select(number, blocks[i]);
        }
    }
    for i in 0..LANES {
        gains[i] /= spans[i];
    }
    first_maximum(&gains, &blocks).filter(|&(gain, _)| gain > 0.0).map(|(_, atom)| atom)
}
