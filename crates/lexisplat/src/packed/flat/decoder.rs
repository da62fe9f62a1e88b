//! Decoding the chunks of a file of version 2, each without the others.

use std::ops::Range;

use half::f16;

use super::streams::Stream;
use super::symbols::{SymbolDecoder, unzigzag};
use super::tables::Tables;
use super::walk::Walk;
use crate::packed::CHUNK;
use crate::packed::atoms::{MAX_ATOM_BITS, resident, rounded_atoms};
use crate::packed::parameters::Parameters;
use crate::packed::place::{Piece, Place, indices};
use crate::packed::scene::{Flat, PackedHead};
use crate::packed::stream::BitCounts;
use crate::sparse::dictionary::Dictionary;
use crate::support::error::{Error, Result};
use crate::support::limits::{Limits, MAX_ATOMS};
use crate::support::memory_budget::MemoryBudget;

/// Gaussians after which the decoder checks that bits and memory are left.
const LOOK_AFTER: usize = 256;

/// The error about a part of `file` that no encoder writes so.
fn bad(file: &str, what: &str) -> Error {
    Error::malformed(file, format!("packed {what} is damaged: no encoder writes it"))
}

/// What all chunks of a file of version 2 are decoded with, and where they are.
#[derive(Debug)]
pub(crate) struct FlatDecoder {
    /// The file, as the caller named it.
    pub(in crate::packed) file: String,
    limits: Limits,
    pub(in crate::packed) dictionary: Dictionary,
    pub(in crate::packed) dictionary_bits: BitCounts,
    parameters: Parameters,
    tables: Tables,
    /// The parts of the data: two for the dictionary and two for each chunk.
    parts: Vec<Range<usize>>,
    gaussians: usize,
}

impl FlatDecoder {
    /// Reads what all chunks need from `head` and from the start of `data`.
    pub(in crate::packed) fn new(head: &PackedHead, flat: &Flat, data: &[u8]) -> Result<Self> {
        let (file, limits, gaussians) = (head.file.clone(), head.limits, head.gaussians);
        let bad = |what| bad(&file, what);
        limits.check_gaussians(&file, gaussians as u64)?;
        limits.check_atoms(&file, head.atoms as u64)?;
        let parameters = Parameters::from_list(&flat.parameters).ok_or_else(|| bad("parameters"))?;
        let tables = Tables::read(&flat.tables, Stream::ALL.len()).ok_or_else(|| bad("tables"))?;
        let parts = parts(gaussians, &flat.lengths, data.len()).ok_or_else(|| bad("lengths"))?;
        let part = |k: usize| parts.get(k).and_then(|range| data.get(range.clone()));
        let dictionary = part(0).zip(part(1)).and_then(|parts| dictionary(head, flat, &tables, parts));
        let (dictionary, dictionary_bits) = dictionary.ok_or_else(|| bad("dictionary"))?;
        Ok(Self { file, limits, dictionary, dictionary_bits, parameters, tables, parts, gaussians })
    }

    fn bad_chunk(&self, c: usize) -> Error {
        bad(&self.file, &format!("chunk {c}"))
    }

    /// The Gaussians of each chunk.
    pub(in crate::packed) fn spans(&self) -> Vec<Range<usize>> {
        let n = self.gaussians;
        (0..n).step_by(CHUNK).map(|first| first..n.min(first + CHUNK)).collect()
    }

    /// Decodes chunk `c` of `data` to `place`. Escapes are numbered from `first`.
    pub(in crate::packed) fn piece(
        &self,
        data: &[u8],
        c: usize,
        first: usize,
        place: &mut Place<'_>,
        budget: &MemoryBudget<'_>,
        count_bits: bool,
    ) -> Result<Piece> {
        let damaged = || self.bad_chunk(c);
        let part = |k: usize| self.parts.get(k).and_then(|range| data.get(range.clone()));
        let parts = part(2 * c + 2).zip(part(2 * c + 3));
        let player = parts.and_then(|(symbols, raw)| SymbolDecoder::new(&self.tables, symbols, raw));
        let mut player = player.ok_or_else(damaged)?;
        player.bit_counts = count_bits.then(|| BitCounts::zeros(Stream::ALL.len()));
        let (parameters, dictionary) = (&self.parameters, &self.dictionary);
        let mut piece = Piece::default();
        let mut walk = Walk::new(parameters, dictionary.dim());
        let mut code = Vec::with_capacity(dictionary.dim());
        let width = indices(dictionary, Vec::new()).width() + size_of::<f16>();
        let row = size_of::<u32>() + dictionary.dim() * size_of::<f32>();
        let (mut nonzeros, mut rows) = (0, 0);
        for i in 0..place.counts.len() {
            let decoded = walk.step(&mut player).ok_or_else(damaged)?;
            place.positions[i] = decoded.position;
            place.dc[i] = decoded.dc;
            place.opacities[i] = decoded.opacity;
            place.scales[i] = decoded.scales;
            place.rotations[i] = decoded.rotation;
            if !walk.exact.is_empty() {
                rows += 1;
                piece.escapes.gaussians.push(u32::try_from(first + i).map_err(|_| damaged())?);
                piece.escapes.rows.extend_from_slice(&walk.exact);
            }
            resident(&walk.code, parameters.value_step(decoded.colour_class), &mut code);
            place.counts[i] = u8::try_from(code.len()).map_err(|_| damaged())?;
            if code.len() as u64 > self.limits.nonzeros {
                self.limits.check_nonzeros(&self.file, c * CHUNK + i, code.len() as u64)?;
            }
            nonzeros += code.len();
            for &(atom, value) in &code {
                if usize::from(atom) >= dictionary.len() || !value.is_finite() {
                    return Err(damaged());
                }
                piece.atoms.push(atom);
                piece.values.push(value);
            }
            // A damaged file could decode to more than it holds, or to more than fits in memory.
            if i % LOOK_AFTER == LOOK_AFTER - 1 || i + 1 == place.counts.len() {
                if player.overrun() {
                    return Err(damaged());
                }
                if !(budget.grow(nonzeros, width) && budget.grow(rows, row)) {
                    return Err(budget.full());
                }
                (nonzeros, rows) = (0, 0);
            }
        }
        piece.bit_counts = player.bit_counts.take().unwrap_or_default();
        if player.exhausted() { Ok(piece) } else { Err(damaged()) }
    }
}

/// The parts of data of `len` bytes: two for the dictionary and two for each chunk. `None` if `lengths` do not
/// fit.
fn parts(gaussians: usize, lengths: &[u32], len: usize) -> Option<Vec<Range<usize>>> {
    let total: u64 = lengths.iter().map(|&l| u64::from(l)).sum();
    if lengths.len() != 2 * (gaussians.div_ceil(CHUNK) + 1) || total != len as u64 {
        return None;
    }
    let ends = lengths.iter().scan(0, |end, &length| {
        let start = *end;
        *end += length as usize;
        Some(start..*end)
    });
    Some(ends.collect())
}

fn dictionary(
    head: &PackedHead,
    flat: &Flat,
    tables: &Tables,
    (symbols, raw): (&[u8], &[u8]),
) -> Option<(Dictionary, BitCounts)> {
    if head.degree.rest() == 0 {
        return (head.atoms == 0 && symbols.is_empty() && raw.is_empty())
            .then(|| (Dictionary::empty(), BitCounts::default()));
    }
    if !(1..=MAX_ATOMS).contains(&head.atoms) || flat.atom_bits > MAX_ATOM_BITS {
        return None;
    }
    let mut player = SymbolDecoder::new(tables, symbols, raw)?;
    player.bit_counts = Some(BitCounts::zeros(Stream::ALL.len()));
    let rows = rounded_atoms(head.degree, head.atoms, flat.atom_bits, |context, _| {
        unzigzag(player.integer(Stream::Dictionary, context))
    });
    if !player.exhausted() {
        return None;
    }
    Some((Dictionary::new(head.degree, rows).ok()?, player.bit_counts.unwrap_or_default()))
}
