//! The encoder of packed scenes: it counts the symbols of all chunks, makes tables of the counts, and codes the chunks with
//! them.

use serde::{Deserialize, Serialize};

use super::appearance::STEPS;
use super::coder::ChunkCoder;
use super::layering::Layering;
use super::options::PackOptions;
use crate::packed::bitstream::stream::BitCounts;
use crate::packed::bitstream::{
    Chunk, CodedChunk, Form, Head, Index, LayerForm, Range, RangeId, RecordedRange, Stream, WholeAtoms,
    lanes, stream_of,
};
use crate::packed::entropy::tables::{ALL_CONTEXTS, Histogram, Lookup, Tables};
use crate::packed::scene::{PackedHead, UNNAMED};
use crate::scene::splats::SceneMeta;
use crate::sparse::model::Record;
use crate::sparse::tally::{CompressReport, Tally};
use crate::support::crc32;
use crate::support::error::{Error, Result};
use crate::support::limits::Limits;
use crate::support::spill::{Spill, SpillTo, Woven};
use crate::support::stopwatch::Stopwatch;

/// The counts of symbols over chunks, which are taken before any chunk is coded.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Counts {
    tally: Tally,
    histograms: Vec<Histogram>,
    raw_bits: BitCounts,
}

impl Counts {
    /// Counts the symbols and the raw bits of one chunk or of the dictionary.
    pub(in crate::packed) fn of<'r>(
        tally: Tally,
        ranges: impl IntoIterator<Item = &'r RecordedRange>,
    ) -> Self {
        let mut histograms = vec![Histogram::default(); ALL_CONTEXTS];
        let mut raw_bits = BitCounts::zeros();
        for range in ranges {
            range.symbols.each(
                |context, symbol| histograms[context].add(symbol),
                |stream, bits| raw_bits.0[stream] += f64::from(bits),
            );
        }
        Self { tally, histograms, raw_bits }
    }

    /// Adds the counts `other` of other chunks.
    pub(in crate::packed) fn add(&mut self, other: &Self) {
        self.tally.add(&other.tally);
        self.histograms.iter_mut().zip(&other.histograms).for_each(|(sum, more)| sum.merge(more));
        self.raw_bits.add(&other.raw_bits);
    }

    /// Returns the number of bits of each stream if it is coded with `tables`.
    fn bits(&self, tables: &Tables) -> BitCounts {
        let mut bit_counts = self.raw_bits.clone();
        for (context, histogram) in self.histograms.iter().enumerate() {
            bit_counts.0[stream_of(context) as usize] += tables.bits(context, histogram);
        }
        bit_counts
    }
}

/// A chunk whose ranges are coded.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::packed) struct Written {
    pub(in crate::packed) layer: usize,
    pub(in crate::packed) gaussians: usize,
    cell: u64,
    bounds: [[f32; 3]; 2],
    energy: f64,
    pub(in crate::packed) ranges: Vec<WrittenRange>,
}

/// The bytes of a range.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::packed) struct WrittenRange {
    pub(in crate::packed) bytes: Vec<u8>,
    /// CRC-32 of the integers that the bytes decode to.
    integers: u32,
}

impl Written {
    pub(in crate::packed) fn new(layer: usize, chunk: &CodedChunk, tables: &Tables) -> Self {
        let lanes = lanes(chunk.gaussians);
        let written = |range: &RecordedRange| WrittenRange {
            bytes: range.symbols.finish(tables, lanes),
            integers: range.integers,
        };
        Self {
            layer,
            gaussians: chunk.gaussians,
            cell: chunk.cell,
            bounds: chunk.bounds,
            energy: chunk.energy,
            ranges: chunk.ranges.iter().map(written).collect(),
        }
    }

    /// Returns the same chunk coded with `tables`. Its ranges are now coded with the tables of `lookup`. `None` if the
    /// ranges are not the output of an encoder, or if `tables` lack one of their symbols.
    pub(in crate::packed) fn recoded(
        &self,
        form: &Form,
        layer: LayerForm,
        lookup: &Lookup,
        tables: &Tables,
    ) -> Option<Self> {
        let own: Vec<&[u8]> = self.ranges.iter().map(|range| range.bytes.as_slice()).collect();
        let symbols = form.transcribe(layer, self.gaussians, lookup, &own)?;
        if !symbols.iter().all(|range| range.is_within(tables)) {
            return None;
        }
        let lanes = lanes(self.gaussians);
        let coded = symbols.iter().map(|range| range.finish(tables, lanes));
        let ranges = coded.zip(&self.ranges).map(|(bytes, own)| WrittenRange { bytes, ..*own });
        Some(Self { ranges: ranges.collect(), ..self.clone() })
    }
}

/// A function that takes the next coded chunk of its layer.
pub(in crate::packed) type WriteChunk<'a> = dyn FnMut(Written) -> Result<()> + 'a;
/// A function that codes all chunks with the given tables.
type CodeChunks<'a> = dyn FnMut(&Tables, &mut WriteChunk<'_>) -> Result<()> + 'a;

/// A scene that is being packed.
#[derive(Debug, Clone)]
pub(in crate::packed) struct Encoding {
    pub(in crate::packed) coder: ChunkCoder,
    pub(in crate::packed) layering: Layering,
    /// The head without tables, dictionary and index.
    pub(in crate::packed) head: Head,
    pub(in crate::packed) form: Form,
    pub(in crate::packed) counts: Counts,
    learn_seconds: f64,
    /// Runs since the start of learning.
    clock: Stopwatch,
}

/// A packed scene whose data are in spill files.
pub(in crate::packed) struct Finished {
    pub(in crate::packed) head: PackedHead,
    pub(in crate::packed) data: Woven,
    pub(in crate::packed) report: CompressReport,
}

impl Encoding {
    /// Creates an encoding. The coder and its atoms were learned since the start of `clock`. `most_dc` is the largest
    /// coordinate of a base colour.
    pub(in crate::packed) fn new(
        (coder, atoms): (ChunkCoder, WholeAtoms),
        layering: Layering,
        most_dc: f64,
        clock: Stopwatch,
    ) -> Self {
        let mut counts = Counts::of(Tally::new(coder.dictionary.dim()), []);
        let rest = layering.rest(coder.dictionary.dim(), coder.dictionary.len());
        let points_of_view = coder.points_of_view.clone();
        let mut head = Head::new(&coder.parameters, most_dc, rest, &atoms, points_of_view);
        if layering.layers() > 1 {
            head = head.with_interim(STEPS);
        }
        counts.raw_bits.0[Stream::Dictionary as usize] = 8.0 * head.dictionary.len() as f64;
        let form = head.form();
        Self { coder, layering, head, form, counts, learn_seconds: clock.seconds(), clock }
    }

    /// Codes all chunks. All chunks of the `gaussians` Gaussians must be counted.
    pub(in crate::packed) fn finish(
        self,
        gaussians: usize,
        options: &PackOptions,
        meta: SceneMeta,
        to: SpillTo<'_>,
        code_chunks: &mut CodeChunks<'_>,
    ) -> Result<Finished> {
        let tables = Tables::of(&self.counts)?;
        let mut ranges = Ranges::new(to)?;
        code_chunks(&tables, &mut |written| ranges.push(written))?;
        self.assemble(gaussians, options, meta, &tables, ranges)
    }

    /// Makes the head of the file. All chunks of the `gaussians` Gaussians must be counted and coded with `tables`.
    pub(in crate::packed) fn assemble(
        self,
        gaussians: usize,
        options: &PackOptions,
        meta: SceneMeta,
        tables: &Tables,
        ranges: Ranges,
    ) -> Result<Finished> {
        let Self { coder, layering, mut head, counts, learn_seconds, clock, .. } = self;
        let stream_bits = counts.bits(tables).named();
        let sh_parts = head.rest.least.len();
        let forms = layering.forms(sh_parts);
        let Ranges { spill, mut chunks, .. } = ranges;
        chunks.sort_by_key(|(chunk, _): &(Chunk, f64)| chunk.layer);
        let (chunks, energies): (Vec<Chunk>, Vec<f64>) = chunks.into_iter().unzip();
        let order = layering.order(&chunks, &energies, sh_parts);
        let piece = |id: &RangeId| {
            let range = &chunks[id.chunk as usize].ranges[usize::from(id.kind)];
            (range.start, range.length as usize)
        };
        let pieces = order.iter().map(piece).collect();
        head.index = Index { layers: forms, chunks, order };
        let too_long = || Error::parameter("data", "too long", "as many bytes as memory counts");
        head.index.lay_out().ok_or_else(too_long)?;
        let data = Woven::new(spill.finish()?, pieces);
        head.tables = tables.write();
        let record = Record { tolerance: options.tolerance, seed: options.seed, ..Record::default() };
        let (record, mut report) = counts.tally.into_report(record, gaussians);
        report.learn_seconds = learn_seconds;
        report.code_seconds = clock.seconds() - learn_seconds;
        report.stream_bits = stream_bits;
        let head = PackedHead {
            file: UNNAMED.to_owned(),
            degree: coder.dictionary.degree(),
            gaussians,
            removed: 0,
            atoms: coder.dictionary.len(),
            record: record.shortened(),
            meta,
            target: None,
            reached: None,
            device: None,
            bytes: head.write(),
            limits: Limits::default(),
        };
        Ok(Finished { head, data, report })
    }
}

impl Tables {
    /// Makes the tables for the counted symbols.
    pub(in crate::packed) fn of(counts: &Counts) -> Result<Self> {
        Self::new(&counts.histograms).ok_or_else(|| Error::parameter("tables", "none", "fewer symbols"))
    }
}

/// The coded ranges of chunks, in the order in which [`Self::push`] takes them.
#[derive(Debug)]
pub(in crate::packed) struct Ranges {
    spill: Spill,
    /// The offset in the spill where the next range starts.
    at: u64,
    /// Each chunk, and the squared change of pictures without it. The starts of its ranges are offsets in the spill.
    chunks: Vec<(Chunk, f64)>,
}

impl Ranges {
    /// Creates an empty list of ranges that spills to `to`.
    pub(in crate::packed) fn new(to: SpillTo<'_>) -> Result<Self> {
        Ok(Self { spill: Spill::new(to)?, at: 0, chunks: Vec::new() })
    }

    /// Adds the next chunk of its layer.
    pub(in crate::packed) fn push(&mut self, written: Written) -> Result<()> {
        let Written { layer, gaussians, cell, bounds, energy, ranges } = written;
        let mut chunk = Chunk { layer, gaussians, cell, bounds, ..Chunk::default() };
        for WrittenRange { bytes, integers } in &ranges {
            let too_long = |_| Error::parameter("range", bytes.len(), "ranges of less than 4 GiB");
            let length = u32::try_from(bytes.len()).map_err(too_long)?;
            let checksum = crc32::hash(bytes);
            chunk.ranges.push(Range { start: self.at, length, checksum, integers: *integers });
            self.at += u64::from(length);
            self.spill.push(bytes)?;
        }
        self.chunks.push((chunk, energy));
        Ok(())
    }
}
