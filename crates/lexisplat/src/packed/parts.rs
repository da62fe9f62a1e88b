//! Packing a scene that comes part after part, in the order of the file.

use super::CHUNK;
use super::canonical::{Grid, MortonKey};
use super::chunks::BitCounts;
use super::coder::{ChunkCoder, Tally, View, length, no_symbols, tables};
use super::entropy::{CONTEXTS, Histogram, Tables};
use super::fit::Fit;
use super::pack::{PackOptions, PackReport, expected_step};
use super::stream::{Stream, SymbolEncoder};
use super::unpack::{Packed, StreamBits};
use crate::formats::lexi::{Extras, SpilledPacked};
use crate::scene::sensitivity::Sensitivity;
use crate::scene::splats::{SceneMeta, Splats};
use crate::support::error::Result;
use crate::support::limits::Limits;
use crate::support::parallel::{map_chunks, map_vec};
use crate::support::progress::Progress;
use crate::support::spill::{Spill, SpillTo};
use crate::support::stopwatch::Stopwatch;

/// Chunks whose symbols are coded before they are written.
const CHUNKS_AT_ONCE: usize = 16;

/// What is known of a scene before its parts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Whole {
    /// Number of Gaussians.
    pub(crate) gaussians: usize,
    pub(crate) grid: Grid,
    /// How good pictures are to be.
    pub(crate) decibels: f64,
}

/// Everything that is the same for all parts was found from a sample; symbols are set aside until all are
/// counted.
#[derive(Debug)]
pub(crate) struct PartPacker {
    options: PackOptions,
    fit: Fit,
    coder: ChunkCoder,
    gaussians: usize,
    tally: Tally,
    histograms: Vec<Histogram>,
    raw_bits: [u64; Stream::ALL.len()],
    symbols: Spill,
    raw: Spill,
    /// Of each chunk the number of entries in `symbols` and of bytes in `raw`.
    lengths: Vec<[usize; 2]>,
    order: Option<Spill>,
    extras: Extras,
    meta: SceneMeta,
    learn_seconds: f64,
    clock: Stopwatch,
}

impl PartPacker {
    /// Fits steps and predictors and learns the dictionary from `sample`, some of the Gaussians of `scene` in
    /// the order of the file, best in runs. These and the options were checked.
    pub(crate) fn new(
        scene: Whole,
        sample: &Splats,
        sensitivity: &Sensitivity,
        options: &PackOptions,
        to: SpillTo<'_>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let clock = Stopwatch::start();
        let Whole { gaussians: total, grid, decibels } = scene;
        let placed = |(source, &position): (u32, &[f32; 3])| MortonKey { cell: grid.cell(position), source };
        let scene: Vec<MortonKey> = (0..).zip(&sample.geometry.positions).map(placed).collect();
        let fit = Fit::new(&sample.geometry, sensitivity, &scene, &grid);
        let view = View { splats: sample, scene: &scene, classes: &fit.classes };
        let step = expected_step(total, decibels);
        let coder = ChunkCoder::new(view, total, &fit, step, options, progress)?;
        let mut histograms = no_symbols();
        coder.first.count(&mut histograms);
        Ok(Self {
            options: options.clone(),
            gaussians: 0,
            tally: Tally::new(coder.dictionary.dim()),
            histograms,
            raw_bits: coder.first.raw_bits(),
            symbols: Spill::new(to)?,
            raw: Spill::new(to)?,
            lengths: Vec::new(),
            order: if options.keep_order { Some(Spill::new(to)?) } else { None },
            extras: Extras::new(to, &sample.geometry)?,
            meta: sample.meta.clone(),
            learn_seconds: clock.seconds(),
            clock: Stopwatch::start(),
            fit,
            coder,
        })
    }

    /// Codes the next Gaussians, whole chunks unless they are the last. `weights` are the sensitivities of
    /// each to colour and opacity, and `places` its cell and its index in the source; all was checked.
    pub(crate) fn push(&mut self, splats: &Splats, weights: &[[f32; 2]], places: &[MortonKey]) -> Result<()> {
        self.gaussians += splats.len();
        let classes = self.fit.classes_of(weights);
        let scene: Vec<MortonKey> = (0..).zip(places).map(|(source, p)| MortonKey { source, ..*p }).collect();
        let view = View { splats, scene: &scene, classes: &classes };
        let coder = &self.coder;
        let chunks = map_chunks(splats.len(), CHUNK, |range| {
            let part = view.part(range);
            coder.record(part, &coder.codes(part))
        });
        for chunk in chunks {
            let recorder = chunk.count(&mut self.tally, &mut self.histograms)?;
            self.raw_bits.iter_mut().zip(recorder.raw_bits()).for_each(|(sum, bits)| *sum += bits);
            let (symbols, raw) = recorder.set_aside();
            self.lengths.push([symbols.len(), raw.len()]);
            self.symbols.push(&symbols)?;
            self.raw.push(&raw)?;
        }
        if let Some(order) = &mut self.order {
            order.push(&places.iter().map(|p| p.source).collect::<Vec<u32>>())?;
        }
        self.extras.push(&splats.geometry)
    }

    /// The packed scene, what is as long as the scene set aside; the report; and what the streams take.
    /// `device` is the GPU that looked, if one did.
    pub(crate) fn finish(
        self,
        to: SpillTo<'_>,
        device: Option<&str>,
    ) -> Result<(Packed, SpilledPacked, PackReport, Vec<StreamBits>)> {
        let tables = tables(&self.histograms)?;
        let bit_counts = bit_counts(&self.histograms, &self.raw_bits, &tables);
        let mut data = Spill::new(to)?;
        let mut lengths = Vec::with_capacity(2 * (self.lengths.len() + 1));
        let mut write = |parts: [Vec<u8>; 2]| -> Result<()> {
            for part in parts {
                lengths.push(length(&part)?);
                data.push(&part)?;
            }
            Ok(())
        };
        write(self.coder.first.finish(&tables))?;
        let (mut symbols, mut raw) = (self.symbols.finish()?, self.raw.finish()?);
        for batch in self.lengths.chunks(CHUNKS_AT_ONCE) {
            let mut chunks = Vec::with_capacity(batch.len());
            for &[entries, bytes] in batch {
                chunks.push((symbols.take::<u16>(entries)?, raw.take::<u8>(bytes)?));
            }
            let parts = map_vec(chunks, |(symbols, raw)| SymbolEncoder::finish_later(&symbols, raw, &tables));
            parts.into_iter().try_for_each(&mut write)?;
        }
        let seconds = [self.learn_seconds, self.clock.seconds()];
        let (record, report) = self.tally.into_report(&self.options, self.gaussians, seconds);
        let head = Packed {
            degree: self.coder.dictionary.degree(),
            gaussians: self.gaussians,
            atoms: self.coder.dictionary.len(),
            atom_bits: self.coder.atom_bits,
            record,
            meta: self.meta,
            extras: Vec::new(),
            order: None,
            target: None,
            device: device.map(str::to_owned),
            parameters: self.coder.parameters.to_list(),
            tables: tables.write(),
            lengths,
            data: Vec::new(),
            limits: Limits::default(),
        };
        let order = match self.order {
            Some(order) => Some(order.finish()?),
            None => None,
        };
        let spilled = SpilledPacked { data: data.finish()?, order, extras: self.extras };
        Ok((head, spilled, report, bit_counts.named()))
    }
}

/// Bits that all streams take.
fn bit_counts(histograms: &[Histogram], raw: &[u64], tables: &Tables) -> BitCounts {
    let mut bit_counts = BitCounts::default();
    let streams = bit_counts.0.iter_mut().zip(raw).zip(histograms.chunks(CONTEXTS)).enumerate();
    for (stream, ((sum, &raw), contexts)) in streams {
        *sum = raw as f64;
        for (context, histogram) in contexts.iter().enumerate() {
            if let Some(table) = tables.table(stream, context) {
                *sum += histogram.bits(table);
            }
        }
    }
    bit_counts
}
