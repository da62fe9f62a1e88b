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

/// Number of rows in a block. The sums of a block are added up from 0, and then added to the sums of the blocks before it.
pub const ROWS_PER_BLOCK: usize = 256;
/// Largest number of bytes of blocks that wait to be added, and largest number of such blocks. The result depends on
/// neither.
const WAITING_BYTES: usize = 64 << 20;
const WAITING_BLOCKS: usize = 256;
/// Smallest norm of a new direction of an atom, as a share of the atom's energy. A shorter direction is rounding noise, and
/// the atom stays as it is.
const NOISE: f64 = 1e-9;

/// The sums over coded rows that online dictionary learning needs. With codes `g` of rows `x`, they are the sums of `g g^T`
/// and of `g x^T`, the number of rows, their nonzeros and their squared errors.
///
/// All sums are f64. **The order of additions is fixed.** [`Statistics::of`] cuts rows into blocks of [`ROWS_PER_BLOCK`],
/// sums each block by itself in the order of its rows, and adds the sums of the blocks in order to sums of 0. The bits of
/// the result therefore do not depend on threads or CPU.
///
/// Statistics of single blocks can be made anywhere. If they are added one at a time in the order of the blocks
/// ([`Statistics::add`]), the result has the same bits as the statistics of all rows at once. Sums of several blocks that
/// are then added to other sums, such as the sums of two halves, are grouped differently and may differ in the last bits.
/// Their result depends only on how rows are cut into such groups and on the order of the groups, not on who sums them.
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
    /// Returns sums of 0, for codes over atoms of the number and length of `atoms`.
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

    /// Codes `rows`, which lie one after the other, with `coder` and sums their statistics. A row that no code brings
    /// within the tolerance counts with the code that comes nearest, as in [`encode_rows`](crate::pursuit::encode_rows).
    /// `progress` is told of [`Stage::Code`].
    ///
    /// Atoms learn from the residuals of codes. Codes to a small tolerance leave small residuals, and atoms that are far
    /// from good atoms then move slowly. A cap on nonzeros in the coder's [`StopRule`](crate::pursuit::StopRule) leaves
    /// larger residuals.
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

    /// Returns the statistics of the rows of `range`, summed in order on the calling thread.
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
                // Atoms ascend within a code, so `other` is never above `atom`.
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

    /// Adds the sums of `other`, element by element.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the atoms of `other` differ in number or length.
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

    /// Multiplies all sums by `factor`, so that older rows are forgotten.
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

    /// Returns better atoms, by one pass of block coordinate descent. The pass refits each of `atoms` in turn to the sums,
    /// with the codes as they are, and scales the atom to unit norm. Later atoms see the new values of earlier atoms. An
    /// atom that no code uses stays as it is. More passes bring the atoms nearer to the best atoms for these codes.
    ///
    /// The sums need not come from codes over `atoms`. In Mairal's method, they come from codes of earlier batches over
    /// earlier atoms.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `atoms` differ in number or length from the atoms of the statistics.
    pub fn update(&self, atoms: &Atoms) -> Result<Atoms> {
        self.check_size("atoms", atoms.len(), atoms.dim())?;
        let dim = self.dim;
        let mut values = atoms.as_slice().to_vec();
        for j in 0..self.atoms {
            let energy = self.energy(j);
            if energy.is_nan() || energy <= 0.0 {
                continue;
            }
            // The target is the sum over rows of `g_j (x - sum_k g_k d_k)`, with k over all other atoms. It is `energy`
            // times the best atom.
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

    /// Returns the sum over codes of the product of the values of atoms `j` and `k`.
    fn pair(&self, j: usize, k: usize) -> f64 {
        self.pairs[triangle(j.max(k)) + j.min(k)]
    }

    /// Returns the sum over codes of the squared value of atom `j`; 0 if no code uses the atom.
    ///
    /// # Panics
    /// If `j` is not below [`Self::atoms`].
    #[must_use]
    pub fn energy(&self, j: usize) -> f64 {
        self.pair(j, j)
    }

    /// Returns the number of values of a row.
    #[must_use]
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Returns the number of atoms.
    #[must_use]
    pub fn atoms(&self) -> usize {
        self.atoms
    }

    /// Returns the number of rows. It is whole unless [`Self::scaled`] changed it.
    #[must_use]
    pub fn rows(&self) -> f64 {
        self.rows
    }

    /// Returns the number of nonzeros of all codes.
    #[must_use]
    pub fn nonzeros(&self) -> f64 {
        self.nonzeros
    }

    /// Returns the sum of the squared L2 norms of the errors of all rows.
    #[must_use]
    pub fn squared_error(&self) -> f64 {
        self.squared_error
    }
}

/// Returns the number of entries in the first `rows` rows of a lower triangle.
fn triangle(rows: usize) -> usize {
    rows * (rows + 1) / 2
}
