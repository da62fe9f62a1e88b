//! Decoding of the chunks of a file.

use crate::packed::bitstream::atoms::WholeAtoms;
use crate::packed::bitstream::broken::{Broken, BrokenHead, must};
use crate::packed::bitstream::chunk::{InRange, Want};
use crate::packed::bitstream::head::Head;
use crate::packed::bitstream::index::{Chunk, Index};
use crate::packed::bitstream::points_of_view::SeenAtoms;
use crate::packed::bitstream::stream::BitCounts;
use crate::packed::bitstream::streams::Stream;
use crate::packed::decode::available_ranges::{Data, DecodeOptions};
use crate::packed::decode::chunk_unpack::{Refusal, Unpacker};
use crate::packed::decode::outline::RangeKind;
use crate::packed::decode::output::{ChunkOutput, Piece};
use crate::packed::entropy::tables::{Lookup, Tables};
use crate::packed::scene::PackedHead;
use crate::scene::sh::ShDegree;
use crate::sparse::dictionary::Dictionary;
use crate::support::crc32;
use crate::support::error::{Error, FormatError, Result};
use crate::support::limits::Limits;
use crate::support::memory_budget::MemoryBudget;

/// The head of a file, prepared for decoding its chunks.
#[derive(Debug)]
pub(in crate::packed) struct BitstreamDecoder {
    file: String,
    limits: Limits,
    head: Head,
    unpacker: Unpacker,
    pub(in crate::packed) dictionary_bits: BitCounts,
}

impl BitstreamDecoder {
    /// Reads the head of a packed scene.
    pub(in crate::packed) fn new(packed: &PackedHead) -> Result<Self> {
        let file = packed.file.clone();
        let bad = |rule: BrokenHead| Error::malformed(&file, format!("packed.head: {rule}"));
        let head = Head::read(&packed.bytes, packed.degree.rest()).map_err(bad)?;
        let gaussians = head.index.gaussians();
        must(gaussians == packed.gaussians, || {
            format!("its chunks have {gaussians} Gaussians, and metadata 'gaussians' is {}", packed.gaussians)
        })
        .map_err(bad)?;
        let tables = Tables::read(&head.tables).map_err(bad)?;
        let lookup = Lookup::new(&tables);
        let (dictionary, dictionary_bits) = dictionary(&head, packed.degree).map_err(bad)?;
        let unpacker = Unpacker {
            seen_atoms: SeenAtoms::new(&head.points_of_view, &dictionary),
            form: head.form(),
            frame: head.frame.clone(),
            points_of_view: head.points_of_view.clone(),
            lookup,
            dictionary,
        };
        Ok(Self { file, limits: packed.limits, head, unpacker, dictionary_bits })
    }

    pub(in crate::packed) fn dictionary(&self) -> &Dictionary {
        &self.unpacker.dictionary
    }

    /// Drops all interim changes but those of scales.
    pub(in crate::packed) fn grow_only(&mut self) {
        let [growth, ..] = self.unpacker.frame.interim;
        self.unpacker.frame.interim = [growth, 0, 0];
    }

    /// Returns the index: layers, chunks and ranges.
    pub(in crate::packed) fn index(&self) -> &Index {
        &self.head.index
    }

    /// Decodes chunk `c` into `output`, from the ranges that `data` has. The escapes in the result are numbered from
    /// `first`.
    #[expect(clippy::too_many_arguments, reason = "what is decoded, from what and where to")]
    pub(in crate::packed) fn piece(
        &self,
        data: Data<'_>,
        c: usize,
        first: usize,
        options: DecodeOptions,
        output: &mut ChunkOutput<'_>,
        budget: &MemoryBudget<'_>,
        count_bits: bool,
    ) -> Result<Piece> {
        let damaged = |rule: &str| Error::malformed(&self.file, format!("packed.data: chunk {c} {rule}"));
        let index = &self.head.index;
        let chunk = index.chunks.get(c).ok_or_else(|| damaged("is not in the index"))?;
        let form = index.layer(chunk.layer);
        let uncovered = index.uncovered(chunk.layer, |range| data.came(range.start, range.length));
        let is_wanted = |k| !matches!(RangeKind::of(form, k), RangeKind::Sh(k) if k >= options.sh_parts);
        let mut ranges = self.checked(data, c, chunk, is_wanted)?;
        if uncovered.is_empty()
            && !count_bits
            && !options.verify
            && let Some(interim) = ranges.get_mut(form.interim_range())
        {
            *interim = None;
        }
        let want = Want { sums: options.verify, bits: count_bits };
        let piece = self.unpacker.chunk(form, chunk.cell, &uncovered, &ranges, want, output, budget);
        let (mut piece, sums) = piece.map_err(|refusal| match refusal {
            Refusal::Damaged(InRange { range, broken: Broken(rule) }) => {
                let kind = RangeKind::of(form, range);
                Error::malformed(&self.file, format!("packed.data: {kind} of chunk {c} {rule}"))
            }
            Refusal::Full => budget.full(),
        })?;
        for (k, (sum, _)) in sums.iter().zip(&ranges).enumerate().filter(|(_, (_, range))| range.is_some()) {
            if chunk.ranges.get(k).is_none_or(|range| range.integers != *sum) {
                let covered = format!("the integers of range {k} of chunk {c}");
                return Err(Error::format(&self.file, FormatError::Checksum { covered }));
            }
        }
        for escape in &mut piece.escapes.gaussians {
            *escape = u32::try_from(first + *escape as usize)
                .map_err(|_| damaged("has exact rows of more than 2^32 Gaussians"))?;
        }
        let most = output.counts.iter().copied().max().unwrap_or(0);
        if u64::from(most) > self.limits.nonzeros {
            let i = output.counts.iter().position(|&count| count == most).unwrap_or(0);
            self.limits.check_nonzeros(&self.file, chunk.first + i, most.into())?;
        }
        if piece.atoms.iter().max().is_some_and(|&atom| usize::from(atom) >= self.dictionary().len()) {
            return Err(damaged("has an atom that is not below 'm'"));
        }
        Ok(piece)
    }

    /// Returns the ranges of a chunk that are there and for which `is_wanted` is true, and verifies their checksums.
    /// Refinements after a missing refinement are left out, and so are SH parts after a missing one.
    fn checked<'d>(
        &self,
        data: Data<'d>,
        c: usize,
        chunk: &Chunk,
        is_wanted: impl Fn(usize) -> bool,
    ) -> Result<Vec<Option<&'d [u8]>>> {
        let form = self.head.index.layer(chunk.layer);
        let mut ranges: Vec<Option<&[u8]>> = Vec::with_capacity(chunk.ranges.len());
        for (k, range) in chunk.ranges.iter().enumerate() {
            let is_needed = match RangeKind::of(form, k) {
                RangeKind::Refinement(1..) | RangeKind::Sh(1..) => ranges.last().is_some_and(Option::is_some),
                _ => true,
            };
            let wanted = data.range(range.start, range.length).filter(|_| is_needed && is_wanted(k));
            if wanted.is_some_and(|bytes| !data.is_verified() && crc32::hash(bytes) != range.checksum) {
                let covered = format!("range {k} of chunk {c}");
                return Err(Error::format(&self.file, FormatError::Checksum { covered }));
            }
            ranges.push(wanted);
        }
        Ok(ranges)
    }
}

fn dictionary(head: &Head, degree: ShDegree) -> Result<(Dictionary, BitCounts), BrokenHead> {
    let learned = head.rest.atoms.saturating_sub(if head.with_axes { degree.rest() } else { 0 });
    let atoms = WholeAtoms::read(&head.dictionary, degree, learned, head.with_axes)?;
    if degree.rest() == 0 {
        return Ok((Dictionary::empty(), BitCounts::default()));
    }
    let mut bits = BitCounts::zeros();
    bits.0[Stream::Dictionary as usize] = 8.0 * head.dictionary.len() as f64;
    let dictionary = Dictionary::decoded(degree, atoms.rows())
        .ok_or_else(|| BrokenHead("the dictionary has an atom that is not of norm 1".to_owned()))?;
    Ok((dictionary, bits))
}

#[cfg(test)]
mod tests;
