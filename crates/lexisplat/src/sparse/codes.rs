//! Sparse codes: a few pairs (atom, value) for every Gaussian. They are a sparse column of a matrix.

use half::f16;
use half::slice::HalfFloatSliceExt;

use crate::sparse::dictionary::Dictionary;
use crate::support::error::{Error, Result};
use crate::support::maths::name_of;

/// Number of Gaussians between two stored offsets. To find a column, fewer counts than this are added up.
const GAUSSIANS_PER_CHECKPOINT: usize = 64;

/// Precision of the stored values. The error is verified after the values are rounded to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ValueType {
    /// 32-bit float.
    F32,
    /// 16-bit float.
    F16,
}

/// Atom numbers. Each takes one byte if the dictionary has at most 256 atoms, otherwise two.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Indices {
    /// Numbers for dictionaries of up to 256 atoms.
    U8(Vec<u8>),
    /// Numbers for larger dictionaries.
    U16(Vec<u16>),
}

/// Coefficients of the atoms.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Full precision.
    F32(Vec<f32>),
    /// Half precision.
    F16(Vec<f16>),
}

impl Indices {
    /// Creates an empty list for a dictionary of `atoms` atoms.
    #[must_use]
    pub fn for_atoms(atoms: usize) -> Self {
        if atoms <= 256 { Self::U8(Vec::new()) } else { Self::U16(Vec::new()) }
    }

    /// Returns the number of indices.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) => v.len(),
        }
    }

    /// Returns the index at `k`.
    ///
    /// # Panics
    /// If `k` is not below the number of indices.
    #[must_use]
    #[inline]
    pub fn get(&self, k: usize) -> usize {
        match self {
            Self::U8(v) => usize::from(v[k]),
            Self::U16(v) => usize::from(v[k]),
        }
    }

    /// Returns all indices as they lie in memory.
    pub(crate) fn as_bytes(&self) -> &[u8] {
        match self {
            Self::U8(v) => v,
            Self::U16(v) => bytemuck::cast_slice(v),
        }
    }

    /// Returns whether each Gaussian has at most `dim` indices, and they are ascending and below `atoms`. The sum of
    /// `counts` must be the number of indices.
    fn are_sound(&self, counts: &[u8], dim: usize, atoms: usize) -> bool {
        fn sound<T: Copy + Ord + Into<usize>>(
            indices: &[T],
            counts: &[u8],
            dim: usize,
            atoms: usize,
        ) -> bool {
            let mut rest = indices;
            let ascending = |column: &[T]| column.iter().zip(&column[1..]).all(|(a, b)| a < b);
            indices.iter().max().is_none_or(|&last| last.into() < atoms)
                && counts.iter().all(|&count| {
                    let column = rest.split_off(..usize::from(count)).unwrap_or_default();
                    usize::from(count) <= dim && (column.len() < 2 || ascending(column))
                })
        }
        match self {
            Self::U8(v) => sound(v, counts, dim, atoms),
            Self::U16(v) => sound(v, counts, dim, atoms),
        }
    }

    /// Returns the number of bytes of one index.
    #[must_use]
    pub fn width(&self) -> usize {
        match self {
            Self::U8(_) => 1,
            Self::U16(_) => 2,
        }
    }
}

impl Values {
    /// Creates an empty list of values of type `value_type`.
    #[must_use]
    pub fn empty(value_type: ValueType) -> Self {
        match value_type {
            ValueType::F32 => Self::F32(Vec::new()),
            ValueType::F16 => Self::F16(Vec::new()),
        }
    }

    /// Returns the type of the values.
    #[must_use]
    pub fn value_type(&self) -> ValueType {
        match self {
            Self::F32(_) => ValueType::F32,
            Self::F16(_) => ValueType::F16,
        }
    }

    /// Returns the number of values.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::F32(v) => v.len(),
            Self::F16(v) => v.len(),
        }
    }

    /// Returns the value at `k`.
    ///
    /// # Panics
    /// If `k` is not below the number of values.
    #[must_use]
    #[inline]
    pub fn get(&self, k: usize) -> f32 {
        match self {
            Self::F32(v) => v[k],
            Self::F16(v) => v[k].to_f32(),
        }
    }

    /// Returns whether all values are finite.
    fn are_finite(&self) -> bool {
        // The loop has no early exit, so that it is vectorised.
        match self {
            Self::F32(v) => v.iter().fold(true, |good, v| good & v.is_finite()),
            Self::F16(v) => v.iter().fold(true, |good, v| good & v.is_finite()),
        }
    }

    /// Returns all values as they lie in memory.
    pub(crate) fn as_bytes(&self) -> &[u8] {
        match self {
            Self::F32(v) => bytemuck::cast_slice(v),
            // `bytemuck` casts half floats only as integers.
            Self::F16(v) => bytemuck::cast_slice::<u16, u8>(v.reinterpret_cast()),
        }
    }

    /// Returns the number of bytes of one value.
    #[must_use]
    pub fn width(&self) -> usize {
        match self {
            Self::F32(_) => 4,
            Self::F16(_) => 2,
        }
    }
}

/// Gaussians whose SH-rest is stored exactly, because no code reaches the tolerance.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Escapes {
    /// Numbers of these Gaussians, strictly ascending.
    pub gaussians: Vec<u32>,
    /// SH-rest rows of these Gaussians, one after the other.
    pub rows: Vec<f32>,
}

/// The sparse codes of a whole scene.
///
/// [`SparseCodes::new`] checks these invariants: atom numbers are strictly ascending within a Gaussian and below the
/// dictionary's length, values are finite, and an escaped Gaussian has no nonzeros.
#[derive(Debug, Clone, PartialEq)]
pub struct SparseCodes {
    counts: Vec<u8>,
    checkpoints: Vec<u64>,
    indices: Indices,
    values: Values,
    escapes: Escapes,
    dim: usize,
    /// Number of atoms of the dictionary that the codes were made for.
    atoms: usize,
}

/// The stored form of one Gaussian's SH-rest.
#[derive(Debug, Clone, Copy)]
pub enum CodedRest<'a> {
    /// A sparse code.
    Code(Column<'a>),
    /// The exact coefficients.
    Exact(&'a [f32]),
}

/// The nonzeros of one Gaussian.
#[derive(Debug, Clone, Copy)]
pub struct Column<'a> {
    codes: &'a SparseCodes,
    start: usize,
    len: usize,
}

impl<'a> Column<'a> {
    /// Returns the number of nonzeros.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Returns whether there are no nonzeros.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns the pairs (atom, value), by ascending atom.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = (usize, f32)> + use<'a> {
        let codes = self.codes;
        (self.start..self.start + self.len).map(move |k| (codes.indices.get(k), codes.values.get(k)))
    }

    /// Calls `take` with each atom and value, by ascending atom. It is faster than [`Self::iter`], since the types of indices and
    /// values are looked up once.
    #[inline(always)]
    pub fn each(&self, take: impl FnMut(usize, f32)) {
        fn all<I: Copy, V: Copy>(
            (indices, values): (&[I], &[V]),
            index: impl Fn(I) -> usize,
            value: impl Fn(V) -> f32,
            mut take: impl FnMut(usize, f32),
        ) {
            indices.iter().zip(values).for_each(|(&i, &v)| take(index(i), value(v)));
        }
        let own = self.start..self.start + self.len;
        match (&self.codes.indices, &self.codes.values) {
            (Indices::U8(i), Values::F16(v)) => all((&i[own.clone()], &v[own]), usize::from, widened, take),
            (Indices::U8(i), Values::F32(v)) => all((&i[own.clone()], &v[own]), usize::from, |v| v, take),
            (Indices::U16(i), Values::F16(v)) => all((&i[own.clone()], &v[own]), usize::from, widened, take),
            (Indices::U16(i), Values::F32(v)) => all((&i[own.clone()], &v[own]), usize::from, |v| v, take),
        }
    }
}

/// Reads rows of Gaussians that are near each other. It remembers where the columns of 64 Gaussians start.
#[derive(Debug, Clone)]
pub struct CodedRows<'a> {
    codes: &'a SparseCodes,
    /// The block of which `starts` is.
    block: usize,
    /// Number of nonzeros of the block before each of its Gaussians: a sum of less than 64 bytes.
    starts: [u16; GAUSSIANS_PER_CHECKPOINT],
}

impl<'a> CodedRows<'a> {
    /// Returns the stored form of Gaussian `i`, as [`SparseCodes::row`] does.
    ///
    /// # Panics
    /// If `i` is not below the number of Gaussians.
    #[inline(always)]
    pub fn row(&mut self, i: usize) -> CodedRest<'a> {
        let codes = self.codes;
        let len = usize::from(codes.counts[i]);
        if len == 0
            && let Some(row) = codes.escape(i)
        {
            return CodedRest::Exact(row);
        }
        let (block, within) = (i / GAUSSIANS_PER_CHECKPOINT, i % GAUSSIANS_PER_CHECKPOINT);
        if block != self.block {
            self.block = block;
            let mut sum = 0;
            for (start, &count) in self.starts.iter_mut().zip(&codes.counts[i - within..]) {
                *start = sum;
                sum += u16::from(count);
            }
        }
        CodedRest::Code(Column {
            codes,
            start: codes.checkpoint(block) + usize::from(self.starts[within]),
            len,
        })
    }
}

/// Returns a finite half as a single, which has the same value. `f16::to_f32` looks up the processor's instructions at each call.
#[inline(always)]
fn widened(half: f16) -> f32 {
    /// Bits by which the fraction of a single is longer.
    const LONGER: u32 = 13;
    /// 2 to the power of the difference of the biases of the two exponents, 127 - 15. The exponent of a single begins at bit 23.
    const BIAS: f32 = f32::from_bits((127 + 127 - 15) << 23);
    let bits = u32::from(half.to_bits());
    // The product is exact, also that of a subnormal half, whose bits are a subnormal single.
    let size = f32::from_bits((bits & 0x7fff) << LONGER) * BIAS;
    f32::from_bits(size.to_bits() | (bits & 0x8000) << 16)
}

impl SparseCodes {
    /// Creates codes, after it has checked all invariants.
    ///
    /// # Errors
    /// [`Error::Parameter`] that names the array and its first invalid entry.
    pub fn new(
        dictionary: &Dictionary,
        counts: Vec<u8>,
        indices: Indices,
        values: Values,
        escapes: Escapes,
    ) -> Result<Self> {
        Self::part(dictionary, 0, counts, indices, values, escapes)
    }

    /// Creates codes as [`Self::new`] does, for a part of a scene. In errors, the part's first Gaussian has the number
    /// `first`. Escapes are numbered from the start of the part.
    pub(crate) fn part(
        dictionary: &Dictionary,
        first: usize,
        counts: Vec<u8>,
        indices: Indices,
        values: Values,
        escapes: Escapes,
    ) -> Result<Self> {
        let (dim, atoms) = (dictionary.dim(), dictionary.len());
        let total: u64 = counts.iter().map(|&c| u64::from(c)).sum();
        let lengths = [("codes.indices", indices.len()), ("codes.values", values.len())];
        for (name, len) in lengths {
            if len as u64 != total {
                return Err(Error::parameter(name, len, format!("{total} entries, the sum of codes.counts")));
            }
        }
        if escapes.rows.len() != escapes.gaussians.len() * dim {
            let expected = format!("{dim} values for each of {} escapes", escapes.gaussians.len());
            return Err(Error::parameter("escapes.rows", escapes.rows.len(), expected));
        }
        if escapes.rows.iter().any(|v| !v.is_finite()) {
            return Err(Error::parameter("escapes.rows", "NaN or infinity", "finite values"));
        }
        for (k, &g) in escapes.gaussians.iter().enumerate() {
            let ascending = k == 0 || escapes.gaussians[k - 1] < g;
            let empty = counts.get(g as usize) == Some(&0);
            if !ascending || !empty {
                let expected = "strictly ascending Gaussians without nonzeros";
                return Err(Error::parameter("escapes.gaussians", first + g as usize, expected));
            }
        }
        let mut start = 0;
        let unsound = if indices.are_sound(&counts, dim, atoms) { &[][..] } else { &counts };
        for (i, &count) in unsound.iter().enumerate() {
            let end = start + usize::from(count);
            if usize::from(count) > dim {
                return Err(Error::parameter(
                    "codes.counts",
                    count,
                    format!("at most {dim} (Gaussian {})", first + i),
                ));
            }
            for k in start..end {
                let index = indices.get(k);
                if index >= atoms || (k > start && indices.get(k - 1) >= index) {
                    let expected = format!("ascending atoms below {atoms} (Gaussian {})", first + i);
                    return Err(Error::parameter("codes.indices", index, expected));
                }
            }
            start = end;
        }
        if !values.are_finite()
            && let Some(k) = (0..values.len()).find(|&k| !values.get(k).is_finite())
        {
            return Err(Error::parameter("codes.values", name_of(values.get(k)), "finite values"));
        }
        let mut checkpoints = Vec::with_capacity(counts.len().div_ceil(GAUSSIANS_PER_CHECKPOINT));
        let mut offset = 0_u64;
        for block in counts.chunks(GAUSSIANS_PER_CHECKPOINT) {
            checkpoints.push(offset);
            offset += block.iter().map(|&c| u64::from(c)).sum::<u64>();
        }
        Ok(Self { counts, checkpoints, indices, values, escapes, dim, atoms })
    }

    /// Returns whether the codes were made for a dictionary of this size.
    pub(crate) fn fit(&self, dictionary: &Dictionary) -> bool {
        (self.dim, self.atoms) == (dictionary.dim(), dictionary.len())
    }

    /// Returns the number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        self.counts.len()
    }

    /// Returns whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.counts.is_empty()
    }

    /// Returns the number of nonzeros of all Gaussians together.
    #[must_use]
    pub fn nonzeros(&self) -> usize {
        self.indices.len()
    }

    /// Returns the number of nonzeros of each Gaussian; 0 for an escape.
    #[must_use]
    pub fn counts(&self) -> &[u8] {
        &self.counts
    }

    /// Returns the atom numbers of all Gaussians, in order.
    #[must_use]
    pub fn indices(&self) -> &Indices {
        &self.indices
    }

    /// Returns the values of all Gaussians, in order.
    #[must_use]
    pub fn values(&self) -> &Values {
        &self.values
    }

    /// Returns the number of bytes of memory that the codes take: counts, offsets, indices, values and escapes.
    #[must_use]
    pub fn resident_bytes(&self) -> usize {
        self.counts.len()
            + Self::checkpoint_bytes(self.counts.len())
            + self.nonzeros() * (self.indices.width() + self.values.width())
            + size_of_val(self.escapes.gaussians.as_slice())
            + size_of_val(self.escapes.rows.as_slice())
    }

    /// Returns the number of bytes of memory that the offsets of `gaussians` Gaussians take.
    pub(crate) fn checkpoint_bytes(gaussians: usize) -> usize {
        gaussians.div_ceil(GAUSSIANS_PER_CHECKPOINT) * size_of::<u64>()
    }

    /// Returns the Gaussians that are stored exactly.
    #[must_use]
    pub fn escapes(&self) -> &Escapes {
        &self.escapes
    }

    /// Returns the stored form of Gaussian `i`.
    ///
    /// # Panics
    /// If `i` is not below [`Self::len`].
    #[must_use]
    #[inline]
    pub fn row(&self, i: usize) -> CodedRest<'_> {
        let len = usize::from(self.counts[i]);
        if len == 0
            && let Some(row) = self.escape(i)
        {
            return CodedRest::Exact(row);
        }
        let start = self.checkpoint(i / GAUSSIANS_PER_CHECKPOINT);
        let own = i - i % GAUSSIANS_PER_CHECKPOINT..i;
        let before: usize = self.counts[own].iter().map(|&c| usize::from(c)).sum();
        CodedRest::Code(Column { codes: self, start: start + before, len })
    }

    /// Returns the exact coefficients of Gaussian `i`, if they are stored.
    #[inline]
    fn escape(&self, i: usize) -> Option<&[f32]> {
        // The conversion keeps the number, since a scene has fewer than 2^32 Gaussians.
        let k = self.escapes.gaussians.binary_search_by(|&g| (g as usize).cmp(&i)).ok()?;
        Some(&self.escapes.rows[k * self.dim..(k + 1) * self.dim])
    }

    /// Returns the number of nonzeros before a block of [`GAUSSIANS_PER_CHECKPOINT`] Gaussians.
    #[inline(always)]
    fn checkpoint(&self, block: usize) -> usize {
        #[expect(clippy::cast_possible_truncation, reason = "bounded by a Vec's length")]
        let start = self.checkpoints[block] as usize;
        start
    }

    /// Returns a reader of rows of Gaussians that are near each other.
    #[must_use]
    pub fn rows(&self) -> CodedRows<'_> {
        CodedRows { codes: self, block: usize::MAX, starts: [0; GAUSSIANS_PER_CHECKPOINT] }
    }

    /// Writes the SH-rest of Gaussian `i` into `out`. The values are exactly those of the decompressed scene.
    ///
    /// # Panics
    /// If `i` is out of range or `out` is not `dictionary.dim()` long.
    pub fn reconstruct(&self, dictionary: &Dictionary, i: usize, out: &mut [f32]) {
        match self.row(i) {
            CodedRest::Exact(row) => out.copy_from_slice(row),
            CodedRest::Code(column) => reconstruct(dictionary, column.iter(), out),
        }
    }
}

/// Writes the sum of `value * atom` over the pairs of `code` into `out`. Terms are added in the order given, with one f32
/// multiplication and one f32 addition at a time.
///
/// This order and rounding are part of the promise: the encoder verifies exactly these values.
#[inline]
pub fn reconstruct(dictionary: &Dictionary, code: impl Iterator<Item = (usize, f32)>, out: &mut [f32]) {
    dictionary.atoms().reconstruct(code, out);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ShDegree;

    #[test]
    fn every_finite_half_is_widened_to_its_value() {
        for half in (0..=u16::MAX).map(f16::from_bits).filter(|half| half.is_finite()) {
            assert_eq!(widened(half).to_bits(), half.to_f32().to_bits(), "{half}");
        }
    }

    #[test]
    fn a_reader_finds_the_rows_of_any_order() {
        // The unit vectors of degree 1.
        let atoms: Vec<f32> = (0..81).map(|k| f32::from(u8::from(k % 10 == 0))).collect();
        let dictionary = Dictionary::new(ShDegree::ONE, atoms).unwrap();
        let n = 5 * GAUSSIANS_PER_CHECKPOINT + 7;
        let counts: Vec<u8> = (0..n).map(|i| if i % 11 == 0 { 0 } else { [0, 2, 4, 1, 3][i % 5] }).collect();
        let indices: Vec<u8> = counts.iter().flat_map(|&count| 0..count).collect();
        let values = (0..indices.len()).map(|k| k as f32).collect();
        let escapes = Escapes { gaussians: vec![0, 66, 132], rows: (0..27_u8).map(f32::from).collect() };
        let codes = SparseCodes::new(&dictionary, counts, Indices::U8(indices), Values::F32(values), escapes)
            .unwrap();
        let told = |row: CodedRest<'_>| match row {
            CodedRest::Exact(row) => (true, row.to_vec()),
            CodedRest::Code(column) => (false, column.iter().map(|(_, value)| value).collect()),
        };
        let mut rows = codes.rows();
        for i in (0..n).chain((0..n).rev().step_by(3)).chain((0..n).map(|k| k * 101 % n)) {
            assert_eq!(told(rows.row(i)), told(codes.row(i)), "{i}");
        }
    }
}
