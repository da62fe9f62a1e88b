//! The sufficient statistics of online dictionary learning (Mairal et al. 2010), which add up over rows and machines.

mod bytes;
#[cfg(test)]
mod tests;

use std::ops::Range;

use super::update::normalised_over;
use crate::sparse::atoms::{Atoms, check_finite, count_rows};
use crate::sparse::pursuit::{Coder, RowCoder, RowValue};
use crate::support::error::{Error, Result};
use crate::support::parallel::map_vec;
use crate::support::progress::{Progress, Stage};

/// Rows whose sums are added up by themselves, from 0, before they are added to those of the rows before them.
pub const ROWS_PER_BLOCK: usize = 256;
/// Most bytes of blocks that wait to be added, and most blocks. The result depends on neither.
const WAITING_BYTES: usize = 64 << 20;
const WAITING_BLOCKS: usize = 256;
/// A new direction shorter than this share of an atom's energy is rounding noise, and the atom stays as it is.
const NOISE: f64 = 1e-9;

/// What online dictionary learning needs to know of coded rows: with codes `g` of rows `x`, the sums of `g g^T` and of
/// `g x^T`, and the number of rows, their nonzeros and squared errors.
///
/// All sums are f64. **The order of additions is fixed.** [`Statistics::of`] cuts rows into blocks of
/// [`ROWS_PER_BLOCK`], sums each block by itself in the order of its rows, and adds the sums of the blocks in order to
/// sums of 0. The bits of the result therefore do not depend on threads or CPU. Statistics of single blocks, made
/// anywhere and added one at a time in the order of the blocks ([`Statistics::add`]), have the same bits as those of
/// all rows at once. Sums of several blocks that are then added to others, such as those of two halves, are grouped
/// differently and may differ in the last bits. Their result depends only on how rows are cut into such groups and on
/// the order of the groups, not on who sums them.
#[derive(Debug, Clone, PartialEq)]
pub struct Statistics {
    dim: usize,
    atoms: usize,
    rows: f64,
    nonzeros: f64,
    squared_error: f64,
    /// The lower triangle of the sum of `g g^T`, row by row: entry (j, k) with k <= j is at `j (j + 1) / 2 + k`.
    pairs: Vec<f64>,
    /// The sum of `g x^T`: `atoms` rows of `dim` values.
    products: Vec<f64>,
}

impl Statistics {
    /// Sums of 0, for codes over as many atoms as `atoms` and of the same length.
    #[must_use]
    pub fn zero(atoms: &Atoms) -> Self {
        Self::zeros(atoms.dim(), atoms.len())
    }

    fn zeros(dim: usize, atoms: usize) -> Self {
        Self {
            dim,
            atoms,
            rows: 0.0,
            nonzeros: 0.0,
            squared_error: 0.0,
            pairs: vec![0.0; triangle(atoms)],
            products: vec![0.0; atoms * dim],
        }
    }

    /// Codes `rows` with `coder`, one after the other, and sums their statistics. A row that no code brings within the
    /// tolerance counts with the code that comes nearest, as [`encode_rows`](crate::pursuit::encode_rows) has them.
    /// `progress` is told of [`Stage::Code`].
    ///
    /// Atoms learn from what codes leave. Codes to a small tolerance leave little, and atoms that are far from good ones
    /// then move slowly. A cap on nonzeros in the coder's [`StopRule`](crate::pursuit::StopRule) leaves more.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `rows` are not a whole number of finite rows, or if there are no atoms (SH degree 0).
    /// [`Error::Cancelled`] if `progress` cancels.
    pub fn of<V: RowValue>(coder: &Coder, rows: &[V], progress: &dyn Progress) -> Result<Self> {
        let count = count_rows(coder.dim(), rows)?;
        let mut sum = Self::zeros(coder.dim(), coder.atoms());
        let block_bytes = size_of::<f64>() * (sum.pairs.len() + sum.products.len());
        let at_once = (WAITING_BYTES / block_bytes).clamp(1, WAITING_BLOCKS);
        let blocks: Vec<Range<usize>> = (0..count)
            .step_by(ROWS_PER_BLOCK)
            .map(|start| start..count.min(start + ROWS_PER_BLOCK))
            .collect();
        let (coder, size) = (&RowCoder::new(coder), [coder.dim(), coder.atoms()]);
        progress.begin(Stage::Code, count as u64);
        for blocks in blocks.chunks(at_once) {
            for block in map_vec(blocks.to_vec(), |range| Self::of_block(coder, size, rows, range, progress))
            {
                sum.add_sums(&block?);
            }
        }
        progress.end();
        Ok(sum)
    }

    /// The statistics of the rows of `range`, summed in order on the calling thread.
    fn of_block<V: RowValue>(
        coder: &RowCoder<'_>,
        [dim, atoms]: [usize; 2],
        rows: &[V],
        range: Range<usize>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        progress.check()?;
        let rows = &rows[range.start * dim..range.end * dim];
        check_finite(dim, rows, range.start)?;
        let mut sum = Self::zeros(dim, atoms);
        coder.each(rows, |coded| {
            sum.rows += 1.0;
            sum.nonzeros += coded.code.len() as f64;
            sum.squared_error += coded.error * coded.error;
            for (i, &(atom, value)) in coded.code.iter().enumerate() {
                let (j, value) = (usize::from(atom), value.wide());
                let pairs = &mut sum.pairs[triangle(j)..triangle(j + 1)];
                // Atoms ascend, so none of these is above `atom`.
                for &(other, other_value) in &coded.code[..=i] {
                    pairs[usize::from(other)] += value * other_value.wide();
                }
                let products = &mut sum.products[j * dim..(j + 1) * dim];
                for (p, &x) in products.iter_mut().zip(coded.row) {
                    *p += value * x.wide();
                }
            }
        });
        progress.advance(range.len() as u64);
        Ok(sum)
    }

    /// Adds `other`, element by element.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `other` is of another number or length of atoms.
    pub fn add(&mut self, other: &Self) -> Result<()> {
        self.check_size("statistics", other.atoms, other.dim)?;
        self.add_sums(other);
        Ok(())
    }

    fn add_sums(&mut self, other: &Self) {
        self.rows += other.rows;
        self.nonzeros += other.nonzeros;
        self.squared_error += other.squared_error;
        self.pairs.iter_mut().zip(&other.pairs).for_each(|(a, b)| *a += b);
        self.products.iter_mut().zip(&other.products).for_each(|(a, b)| *a += b);
    }

    /// All sums times `factor`, by which older rows are forgotten.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `factor` is not from 0 to 1.
    pub fn scaled(mut self, factor: f64) -> Result<Self> {
        if !(0.0..=1.0).contains(&factor) {
            return Err(Error::parameter("factor", factor, "from 0 to 1"));
        }
        for sum in [&mut self.rows, &mut self.nonzeros, &mut self.squared_error] {
            *sum *= factor;
        }
        self.pairs.iter_mut().chain(&mut self.products).for_each(|sum| *sum *= factor);
        Ok(self)
    }

    /// Returns better atoms: one pass of block coordinate descent, which refits each of `atoms` in turn to the sums,
    /// with the codes as they are, and scales it to unit norm. Later atoms see the new ones. An atom that no code uses
    /// stays as it is. More passes bring the atoms nearer to the best for these codes.
    ///
    /// The sums need not be those of codes over `atoms`. Codes of earlier batches over earlier atoms are what Mairal's
    /// method remembers.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `atoms` are of another number or length.
    pub fn update(&self, atoms: &Atoms) -> Result<Atoms> {
        self.check_size("atoms", atoms.len(), atoms.dim())?;
        let dim = self.dim;
        let mut values = atoms.as_slice().to_vec();
        for j in 0..self.atoms {
            let energy = self.energy(j);
            if energy.is_nan() || energy <= 0.0 {
                continue;
            }
            // The sum of g_j (x - sum_k g_k d_k) over all other atoms k, which is `energy` times the best atom.
            let mut target = self.products[j * dim..(j + 1) * dim].to_vec();
            for (k, other) in values.chunks_exact(dim).enumerate() {
                let pair = self.pair(j, k);
                if k != j && pair != 0.0 {
                    target.iter_mut().zip(other).for_each(|(t, d)| *t -= pair * f64::from(*d));
                }
            }
            if let Some(new) = normalised_over(&target, NOISE * energy) {
                values[j * dim..(j + 1) * dim].copy_from_slice(&new);
            }
        }
        Atoms::checked(dim, values)
    }

    fn check_size(&self, name: &'static str, atoms: usize, dim: usize) -> Result<()> {
        if (atoms, dim) == (self.atoms, self.dim) && dim > 0 {
            return Ok(());
        }
        let expected = format!("{} atoms of {} values, as the statistics are", self.atoms, self.dim);
        Err(Error::parameter(name, format!("{atoms} atoms of {dim} values"), expected))
    }

    /// The sum of the products of the values of atoms `j` and `k`.
    fn pair(&self, j: usize, k: usize) -> f64 {
        self.pairs[triangle(j.max(k)) + j.min(k)]
    }

    /// The sum of the squared values of atom `j`; 0 if no code uses it.
    ///
    /// # Panics
    /// If `j` is not below [`Self::atoms`].
    #[must_use]
    pub fn energy(&self, j: usize) -> f64 {
        self.pair(j, j)
    }

    /// Values of a row.
    #[must_use]
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Number of atoms.
    #[must_use]
    pub fn atoms(&self) -> usize {
        self.atoms
    }

    /// Number of rows. It is whole unless [`Self::scaled`] changed it.
    #[must_use]
    pub fn rows(&self) -> f64 {
        self.rows
    }

    /// Nonzeros of all codes.
    #[must_use]
    pub fn nonzeros(&self) -> f64 {
        self.nonzeros
    }

    /// Sum of the squared L2 norms of the errors of all rows.
    #[must_use]
    pub fn squared_error(&self) -> f64 {
        self.squared_error
    }
}

/// Entries of the first `rows` rows of a lower triangle.
fn triangle(rows: usize) -> usize {
    rows * (rows + 1) / 2
}
