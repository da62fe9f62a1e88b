//! Packing a scene that comes part after part, in the order of the file.

use super::CHUNK;
use super::canonical::{Grid, MortonKey};
use super::coder::{ChunkCoder, View};
use super::encoding::{Counts, Encoding, Finished, WriteChunk};
use super::entropy::Tables;
use super::fit::Fit;
use super::floor::Floor;
use super::pack::{PackOptions, expected_step};
use super::scene::{PackedHead, SpilledPacked};
use super::stream::code_symbols;
use crate::scene::sensitivity::Sensitivity;
use crate::scene::source::SplatSource;
use crate::scene::spilled::SpilledExtras;
use crate::scene::splats::{SceneMeta, Splats};
use crate::sparse::tally::CompressReport;
use crate::support::error::Result;
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
    /// Expected PSNR of pictures, in dB.
    pub(crate) decibels: f64,
}

/// The encoder of a scene in parts. Steps, predictors and dictionary come from a sample. The symbols of all
/// chunks are spilled until they are counted.
#[derive(Debug)]
pub(crate) struct PartPacker {
    options: PackOptions,
    fit: Fit,
    floor: Floor,
    encoding: Encoding,
    gaussians: usize,
    /// Of each chunk its symbols, and then its raw bits.
    chunks: Spill,
    /// Of each chunk the number of symbols and of bytes of raw bits.
    lengths: Vec<[usize; 2]>,
    order: Option<Spill>,
    extras: SpilledExtras,
    meta: SceneMeta,
}

impl PartPacker {
    /// Fits steps and predictors to `sample` and learns the dictionary from it. The sample holds some of the
    /// Gaussians of `scene` in the order of the file, best in runs. The caller has checked it and the options.
    pub(crate) fn new(
        scene: Whole,
        sample: &Splats,
        sensitivity: &Sensitivity,
        options: &PackOptions,
        to: SpillTo<'_>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let Whole { gaussians: total, grid, decibels } = scene;
        let scene = grid.keys(&sample.geometry);
        let fit = Fit::new(&sample.geometry, sensitivity, &scene, &grid);
        let clock = Stopwatch::start();
        let step = expected_step(total, decibels);
        let floor = Floor::new(fit.with_step(step), &sample.geometry, &scene);
        let classes = floor.classes(&fit.classes, &sample.geometry, &scene);
        let view = View { splats: sample, scene: &scene, classes: &classes, base_colours: None };
        let coder = ChunkCoder::new(view, total, floor.parameters.clone(), options, progress)?;
        progress.check()?;
        Ok(Self {
            options: options.clone(),
            gaussians: total,
            chunks: Spill::new(to)?,
            lengths: Vec::new(),
            order: if options.keep_order { Some(Spill::new(to)?) } else { None },
            extras: SpilledExtras::new(to, sample.empty().geometry)?,
            meta: sample.meta.clone(),
            fit,
            floor,
            encoding: Encoding::new(coder, clock),
        })
    }

    /// Codes the next Gaussians: whole chunks, unless they are the last ones. `weights` are the sensitivities of
    /// each to colour and opacity, and `places` its cell and its place in the source. The caller has checked all.
    pub(crate) fn push(&mut self, splats: &Splats, weights: &[[f32; 2]], places: &[MortonKey]) -> Result<()> {
        let scene: Vec<MortonKey> = (0..).zip(places).map(|(source, p)| MortonKey { source, ..*p }).collect();
        let classes = self.floor.classes(&self.fit.classes_of(weights), &splats.geometry, &scene);
        let view = View { splats, scene: &scene, classes: &classes, base_colours: None };
        let coder = &self.encoding.coder;
        let chunks = map_chunks(splats.len(), CHUNK, |range| {
            let part = view.part(range);
            coder.record(part, &coder.codes(part))
        });
        for chunk in chunks {
            let (tally, symbols) = chunk?;
            self.encoding.counts.add(&Counts::of(tally, &symbols));
            let (symbols, raw) = symbols.set_aside();
            self.lengths.push([symbols.len(), raw.len()]);
            self.chunks.push(&symbols)?;
            self.chunks.push(&raw)?;
        }
        if let Some(order) = &mut self.order {
            order.push(&places.iter().map(|p| p.source).collect::<Vec<u32>>())?;
        }
        self.extras.push(&splats.geometry)
    }

    /// The packed scene and the report. `device` is the GPU that measured the
    /// sensitivity, if one did.
    pub(crate) fn finish(
        self,
        to: SpillTo<'_>,
        device: Option<&str>,
        progress: &dyn Progress,
    ) -> Result<(PackedHead, SpilledPacked, CompressReport)> {
        let mut spilled = self.chunks.finish()?;
        let mut code_chunks = |_: &ChunkCoder, tables: &Tables, write: &mut WriteChunk<'_>| {
            for batch in self.lengths.chunks(CHUNKS_AT_ONCE) {
                progress.check()?;
                let mut chunks = Vec::with_capacity(batch.len());
                for &[entries, bytes] in batch {
                    chunks.push((spilled.take::<[u16; 2]>(entries)?, spilled.take::<u8>(bytes)?));
                }
                let parts = map_vec(chunks, |(symbols, raw)| [code_symbols(&symbols, tables), raw]);
                parts.into_iter().try_for_each(&mut *write)?;
            }
            Ok(())
        };
        let Finished { mut head, data, report } =
            self.encoding.finish(self.gaussians, &self.options, self.meta, to, &mut code_chunks)?;
        head.device = device.map(str::to_owned);
        let order = self.order.map(Spill::finish).transpose()?;
        Ok((head, SpilledPacked { data, order, extras: self.extras.finish()? }, report))
    }
}
