//! The encoder of packed scenes: chunks are counted, tables made of the counts, and chunks coded with them.

use super::chunks::BitCounts;
use super::coder::{Chunk, ChunkCoder, Tally, View, length, no_symbols, tables};
use super::entropy::{CONTEXTS, Histogram, Tables};
use super::fit::Fit;
use super::pack::{PackOptions, PackReport};
use super::scene::PackedHead;
use super::stream::{Stream, SymbolEncoder};
use super::unpack::StreamBits;
use crate::scene::splats::SceneMeta;
use crate::support::error::Result;
use crate::support::limits::Limits;
use crate::support::progress::Progress;
use crate::support::spill::{Spill, SpillTo, Spilled};
use crate::support::stopwatch::Stopwatch;

/// What is counted over chunks before any is coded.
#[derive(Debug)]
pub(super) struct Counts {
    tally: Tally,
    histograms: Vec<Histogram>,
    raw_bits: [u64; Stream::ALL.len()],
}

impl Counts {
    /// The counts of one chunk, and its symbols.
    pub(super) fn of(chunk: Chunk) -> Result<(Self, SymbolEncoder)> {
        let (tally, symbols) = chunk.into_parts()?;
        let mut counts = Self { tally, histograms: no_symbols(), raw_bits: symbols.raw_bits() };
        symbols.count(&mut counts.histograms);
        Ok((counts, symbols))
    }

    /// Adds the counts of other chunks.
    pub(super) fn add(&mut self, other: &Self) {
        self.tally.add(&other.tally);
        self.histograms.iter_mut().zip(&other.histograms).for_each(|(sum, more)| sum.merge(more));
        self.raw_bits.iter_mut().zip(other.raw_bits).for_each(|(sum, bits)| *sum += bits);
    }

    /// Bits of all streams.
    fn bits(&self, tables: &Tables) -> BitCounts {
        let mut bit_counts = BitCounts::default();
        let streams = bit_counts.0.iter_mut().zip(self.raw_bits).zip(self.histograms.chunks(CONTEXTS));
        for (stream, ((sum, raw), contexts)) in streams.enumerate() {
            *sum = raw as f64;
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
type CodeChunks<'a> = dyn FnMut(&ChunkCoder, &Tables, &mut WriteChunk<'_>) -> Result<()> + 'a;

/// A scene that is being packed.
#[derive(Debug)]
pub(super) struct Encoding {
    pub(super) coder: ChunkCoder,
    /// The symbols of the dictionary.
    dictionary: SymbolEncoder,
    pub(super) counts: Counts,
    learn_seconds: f64,
    clock: Stopwatch,
}

/// A packed scene, its bulk spilled.
pub(super) struct Finished {
    pub(super) head: PackedHead,
    pub(super) data: Spilled,
    pub(super) report: PackReport,
    pub(super) stream_bits: Vec<StreamBits>,
}

impl Encoding {
    /// Learns from the Gaussians of `view` how to code the `total` Gaussians of a scene.
    pub(super) fn new(
        view: View<'_>,
        total: usize,
        fit: &Fit,
        step: f64,
        options: &PackOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let clock = Stopwatch::start();
        let mut coder = ChunkCoder::new(view, total, fit, step, options, progress)?;
        let dictionary = std::mem::take(&mut coder.first);
        let tally = Tally::new(coder.dictionary.dim());
        let mut counts = Counts { tally, histograms: no_symbols(), raw_bits: dictionary.raw_bits() };
        dictionary.count(&mut counts.histograms);
        progress.check()?;
        let learn_seconds = clock.seconds();
        Ok(Self { coder, dictionary, counts, learn_seconds, clock: Stopwatch::start() })
    }

    /// Counts the time since the start as time spent on learning.
    pub(super) fn end_learning(&mut self) {
        self.learn_seconds += self.clock.seconds();
        self.clock = Stopwatch::start();
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
        let tables = tables(&counts.histograms)?;
        let stream_bits = counts.bits(&tables).named();
        let mut data = Spill::new(to)?;
        let mut lengths = Vec::new();
        let mut write = |parts: [Vec<u8>; 2]| -> Result<()> {
            for part in parts {
                lengths.push(length(&part)?);
                data.push(&part)?;
            }
            Ok(())
        };
        write(dictionary.finish(&tables))?;
        code_chunks(&coder, &tables, &mut write)?;
        let (record, report) = counts.tally.into_report(options, gaussians, [learn_seconds, clock.seconds()]);
        let head = PackedHead {
            file: PackedHead::unnamed(),
            degree: coder.dictionary.degree(),
            gaussians,
            atoms: coder.dictionary.len(),
            atom_bits: coder.atom_bits,
            record,
            meta,
            target: None,
            device: None,
            parameters: coder.parameters.to_list(),
            tables: tables.write(),
            lengths,
            limits: Limits::default(),
        };
        Ok(Finished { head, data: data.finish()?, report, stream_bits })
    }
}
