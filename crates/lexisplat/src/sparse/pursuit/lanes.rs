//! Per-atom arrays in lanes of fixed width, and the loops over them that both pursuits share.
//!
//! The pursuit of the exact codec is [`super::greedy`], that of the packed codec `packed::codebook`.

/// Atoms handled together; the padding unit of every per-atom array. The width is fixed, so that results do not depend
/// on the width of the CPU's registers.
pub(crate) const LANES: usize = 16;
/// Lanes that [`accumulate`] keeps in registers at once: as many as fit, and what is used for the rest.
const LARGE: usize = 6;
const SMALL: usize = 2;

/// `LANES` neighbouring entries of a per-atom array, aligned to a cache line.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Lane(pub(crate) [f32; LANES]);

/// A lane of zeros.
pub(crate) const ZERO: Lane = Lane([0.0; LANES]);

impl Lane {
    /// Applies `f` to every entry. The compiler vectorises loops of one operation over one array at a time.
    #[inline(always)]
    pub(crate) fn map(mut self, f: impl Fn(f32) -> f32) -> Self {
        for x in &mut self.0 {
            *x = f(*x);
        }
        self
    }

    /// Applies `f` to every pair of entries.
    #[inline(always)]
    pub(crate) fn zip(mut self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        for (x, y) in self.0.iter_mut().zip(&other.0) {
            *x = f(*x, *y);
        }
        self
    }
}

/// Number of lanes of an array with an entry for each of `atoms`.
pub(crate) fn blocks_of(atoms: usize) -> usize {
    atoms.div_ceil(LANES)
}

/// Transposes `atoms`, each `dim` long: `dim` rows of lanes, in which entry (d, j) is coefficient d of atom j.
pub(crate) fn transposed(dim: usize, atoms: &[f32]) -> Vec<Lane> {
    let blocks = blocks_of(atoms.len().checked_div(dim).unwrap_or(0));
    let mut out = vec![ZERO; dim * blocks];
    for (j, atom) in atoms.chunks_exact(dim.max(1)).enumerate() {
        for (d, &value) in atom.iter().enumerate() {
            out[d * blocks + j / LANES].0[j % LANES] = value;
        }
    }
    out
}

/// Folds `factors[l]` and row l of `rows`, each `blocks` lanes long, into `sums`, in order of l.
///
/// Each group of lanes stays in registers for all of `factors`, so that `sums` is read and written once.
#[inline(always)]
pub(crate) fn accumulate(
    sums: &mut [Lane],
    factors: &[f32],
    rows: &[Lane],
    blocks: usize,
    f: impl Fn(f32, f32, f32) -> f32 + Copy,
) {
    let mut done = 0;
    while done + LARGE <= sums.len() {
        accumulate_group::<LARGE>(&mut sums[done..], factors, rows, blocks, done, f);
        done += LARGE;
    }
    while done + SMALL <= sums.len() {
        accumulate_group::<SMALL>(&mut sums[done..], factors, rows, blocks, done, f);
        done += SMALL;
    }
    if done < sums.len() {
        accumulate_group::<1>(&mut sums[done..], factors, rows, blocks, done, f);
    }
}

#[inline(always)]
fn accumulate_group<const GROUP: usize>(
    sums: &mut [Lane],
    factors: &[f32],
    rows: &[Lane],
    blocks: usize,
    offset: usize,
    f: impl Fn(f32, f32, f32) -> f32 + Copy,
) {
    // Arrays of constant length stay in registers, and the loop over them needs no bounds checks.
    let Some(sums) = sums.first_chunk_mut::<GROUP>() else { return };
    let mut group = *sums;
    for (l, &factor) in factors.iter().enumerate() {
        let Some(row) = rows.get(l * blocks + offset..).and_then(<[Lane]>::first_chunk::<GROUP>) else {
            return;
        };
        for g in 0..GROUP {
            for i in 0..LANES {
                group[g].0[i] = f(group[g].0[i], factor, row[g].0[i]);
            }
        }
    }
    *sums = group;
}

/// Returns the largest of `values` and the atom of the first lane that holds it, where `blocks` says which block each
/// lane's value is from; `None` if a NaN hides the maximum.
#[inline(always)]
pub(crate) fn first_maximum(values: &[f32; LANES], blocks: &[u32; LANES]) -> Option<(f32, usize)> {
    let mut fold = *values;
    let mut width = LANES / 2;
    while width > 0 {
        for i in 0..width {
            fold[i] = if fold[i + width] > fold[i] { fold[i + width] } else { fold[i] };
        }
        width /= 2;
    }
    let maximum = fold[0];
    let mut mask = 0_u32;
    for (i, &value) in values.iter().enumerate() {
        mask |= u32::from(value == maximum) << i;
    }
    if mask == 0 {
        return None;
    }
    let lane = mask.trailing_zeros() as usize;
    Some((maximum, blocks[lane % LANES] as usize * LANES + lane))
}
