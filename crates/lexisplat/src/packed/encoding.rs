//! The encoder of packed scenes: chunks are counted, tables made of the counts, and chunks coded with them.

use super::coder::ChunkCoder;
use super::entropy::{CONTEXTS, Histogram, Tables};
use super::pack::PackOptions;
use super::scene::{PackedHead, UNNAMED};
use super::stream::{BitCounts, Stream, SymbolEncoder};
use crate::scene::splats::SceneMeta;
use crate::sparse::model::Record;
use crate::sparse::tally::{CompressReport, Tally};
use crate::support::error::{Error, Result};
use crate::support::limits::Limits;
use crate::support::spill::{Spill, SpillTo, Spilled};
use crate::support::stopwatch::Stopwatch;

/// What is counted over chunks before any is coded.
#[derive(Debug, Clone)]
pub(super) struct Counts {
    tally: Tally,
    histograms: Vec<Histogram>,
    raw_bits: BitCounts,
}

impl Counts {
    /// The counts of one chunk or of the dictionary.
    pub(super) fn of(tally: Tally, symbols: &SymbolEncoder) -> Self {
        let mut histograms = vec![Histogram::default(); Stream::ALL.len() * CONTEXTS];
        symbols.count(&mut histograms);
        Self { tally, histograms, raw_bits: symbols.raw_bits.clone() }
    }

    /// Adds the counts of other chunks.
    pub(super) fn add(&mut self, other: &Self) {
        self.tally.add(&other.tally);
        self.histograms.iter_mut().zip(&other.histograms).for_each(|(sum, more)| sum.merge(more));
        self.raw_bits.add(&other.raw_bits);
    }

    /// Bits of all streams.
    fn bits(&self, tables: &Tables) -> BitCounts {
        let mut bit_counts = self.raw_bits.clone();
        for (stream, (sum, contexts)) in
            bit_counts.0.iter_mut().zip(self.histograms.chunks(CONTEXTS)).enumerate()
        {
            for (context, histogram) in contexts.iter().enumerate() {
                if let Some(table) = tables.table(stream, context) {
                    *sum += histogram.bits(table);
                }
            }
        }
        bit_counts
    }
}

/// Takes the symbols and the raw bits of the next chunk.
pub(super) type WriteChunk<'a> = dyn FnMut([Vec<u8>; 2]) -> Result<()> + 'a;
/// Codes all chunks with the tables.
type CodeChunks<'a> = dyn FnMut(&Tables, &mut WriteChunk<'_>) -> Result<()> + 'a;

/// A scene that is being packed.
#[derive(Debug, Clone)]
pub(super) struct Encoding {
    pub(super) coder: ChunkCoder,
    /// The symbols of the dictionary.
    dictionary: SymbolEncoder,
    pub(super) counts: Counts,
    learn_seconds: f64,
    /// Runs since learning began.
    clock: Stopwatch,
}

/// A packed scene, its bulk spilled.
pub(super) struct Finished {
    pub(super) head: PackedHead,
    pub(super) data: Spilled,
    pub(super) report: CompressReport,
}

impl Encoding {
    /// Begins with a coder that has learned since the start of `clock`, and the symbols of its dictionary.
    pub(super) fn new((coder, dictionary): (ChunkCoder, SymbolEncoder), clock: Stopwatch) -> Self {
        let counts = Counts::of(Tally::new(coder.dictionary.dim()), &dictionary);
        Self { coder, dictionary, counts, learn_seconds: clock.seconds(), clock }
    }

    /// Counts all time so far as time spent on learning.
    pub(super) fn end_learning(&mut self) {
        self.learn_seconds = self.clock.seconds();
    }

    /// Codes everything, when all chunks of the `gaussians` Gaussians are counted.
    pub(super) fn finish(
        self,
        gaussians: usize,
        options: &PackOptions,
        meta: SceneMeta,
        to: SpillTo<'_>,
        code_chunks: &mut CodeChunks<'_>,
    ) -> Result<Finished> {
        let Self { coder, dictionary, counts, learn_seconds, clock } = self;
        let tables = Tables::new(&counts.histograms)
            .ok_or_else(|| Error::parameter("tables", "none", "fewer symbols"))?;
        let stream_bits = counts.bits(&tables).named(Stream::names());
        let mut data = Spill::new(to)?;
        let mut lengths = Vec::new();
        let mut write = |parts: [Vec<u8>; 2]| -> Result<()> {
            for part in parts {
                let length = u32::try_from(part.len());
                let too_long = |_| Error::parameter("chunk", part.len(), "parts of less than 4 GiB");
                lengths.push(length.map_err(too_long)?);
                data.push(&part)?;
            }
            Ok(())
        };
        write(dictionary.finish(&tables))?;
        code_chunks(&tables, &mut write)?;
        let record = Record { tolerance: options.tolerance, seed: options.seed, ..Record::default() };
        let seconds = [learn_seconds, clock.seconds() - learn_seconds];
        let (record, mut report) = counts.tally.into_report(record, gaussians, None, seconds);
        report.stream_bits = stream_bits;
        let head = PackedHead {
            file: UNNAMED.to_owned(),
            degree: coder.dictionary.degree(),
            gaussians,
            removed: 0,
            atoms: coder.dictionary.len(),
            atom_bits: coder.atom_bits,
            record,
            meta,
            target: None,
            reached: None,
            device: None,
            parameters: coder.parameters.to_list(),
            tables: tables.write(),
            lengths,
            limits: Limits::default(),
        };
        Ok(Finished { head, data: data.finish()?, report })
    }
}
