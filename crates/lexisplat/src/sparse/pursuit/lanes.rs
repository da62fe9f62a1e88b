//! Per-atom arrays in lanes of fixed width, and the loops over them that both pursuits share.
//!
//! The pursuit of the exact codec is [`super::greedy`]. The pursuit of the packed codec is `packed::codebook`.

/// Number of atoms handled together, and the padding unit of every per-atom array. The number is fixed, so that results do
/// not depend on the width of the CPU's registers.
pub(crate) const LANES: usize = 16;
/// Numbers of lanes that [`accumulate`] keeps in registers at once: as many as fit, and fewer for the lanes that remain.
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

/// Returns the number of lanes of an array with an entry for each of `atoms`.
pub(crate) const fn blocks_of(atoms: usize) -> usize {
    atoms.div_ceil(LANES)
}

/// Returns the transpose of `atoms`, each of `dim` values: `dim` rows of lanes, in which entry (d, j) is coefficient d of
/// atom j.
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

/// Folds `rows` into lanes and writes the lanes to `sums`. Lane b begins as `from(b)`. For each l in order,
/// `f(entry, factors[l], x)` replaces every entry, where `x` is the entry at the same index in row l. Each row is as long
/// as `sums`.
///
/// Each group of lanes stays in registers for all of `factors`.
#[inline(always)]
pub(crate) fn accumulate(
    sums: &mut [Lane],
    from: impl Fn(usize) -> Lane + Copy,
    factors: &[f32],
    rows: &[Lane],
    f: impl Fn(f32, f32, f32) -> f32 + Copy,
) {
    let blocks = sums.len();
    let mut first = 0;
    while first + LARGE <= blocks {
        accumulate_group::<LARGE>(sums, from, factors, rows, first, f);
        first += LARGE;
    }
    while first + SMALL <= blocks {
        accumulate_group::<SMALL>(sums, from, factors, rows, first, f);
        first += SMALL;
    }
    if first < blocks {
        accumulate_group::<1>(sums, from, factors, rows, first, f);
    }
}

#[inline(always)]
fn accumulate_group<const GROUP: usize>(
    sums: &mut [Lane],
    from: impl Fn(usize) -> Lane,
    factors: &[f32],
    rows: &[Lane],
    first: usize,
    f: impl Fn(f32, f32, f32) -> f32 + Copy,
) {
    let blocks = sums.len();
    // Arrays of constant length stay in registers, and loops over them need no bounds checks.
    let Some(sums) = sums[first..].first_chunk_mut::<GROUP>() else { return };
    let mut group: [Lane; GROUP] = std::array::from_fn(|g| from(first + g));
    let mut rows = &rows[first.min(rows.len())..];
    for &factor in factors {
        let Some(row) = rows.first_chunk::<GROUP>() else { break };
        for g in 0..GROUP {
            for i in 0..LANES {
                group[g].0[i] = f(group[g].0[i], factor, row[g].0[i]);
            }
        }
        // Of the last row, only the lanes from `first` on are left, which may be fewer than `blocks`.
        rows = rows.get(blocks..).unwrap_or_default();
    }
    *sums = group;
}

/// Returns the largest of `values` and the atom of the first lane that holds it. `blocks` has the block that the value of
/// each lane is from. Returns `None` if a NaN hides the maximum.
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
