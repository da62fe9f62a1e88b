//! Packing a scene that comes part after part, in the order of the file.

use super::appearance::Appearance;
use super::canonical::{Grid, MortonKey};
use super::coder::{ChunkCoder, View};
use super::encoding::{Counts, Encoding, Finished, WriteChunk};
use super::entropy::Tables;
use super::fit::Fit;
use super::floor::Floor;
use super::pack::PackOptions;
use super::quantised::Quantised;
use super::removal::Weights;
use super::scene::{PackedHead, SpilledPacked};
use super::stream::code_symbols;
use crate::scene::sensitivity::Sensitivity;
use crate::scene::source::SplatSource;
use crate::scene::spilled::SpilledExtras;
use crate::scene::splats::{SceneMeta, Splats};
use crate::sparse::model::Model;
use crate::sparse::tally::CompressReport;
use crate::support::error::{Error, Result};
use crate::support::parallel::map_vec;
use crate::support::progress::Progress;
use crate::support::spill::{Spill, SpillTo};
use crate::support::stopwatch::Stopwatch;

/// Chunks whose symbols are coded before they are written.
const CHUNKS_AT_ONCE: usize = 16;

/// What is known of a scene before its parts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Whole {
    /// Number of Gaussians of the source.
    pub(crate) gaussians: usize,
    /// Number of those that the file has.
    pub(crate) kept: usize,
    pub(crate) grid: Grid,
    /// The overall step.
    pub(crate) step: f64,
}

/// Fits base colours and opacities of a part of a scene. Takes all Gaussians of the part, what a file has of them, and for
/// each that the file has its sensitivities to the colour and to the logarithm of the opacity. Returns what fits, for each
/// that the file has.
pub type Refit<'a, E = Error> = dyn FnMut(&Splats, &Model, &[[f32; 2]]) -> Result<Vec<Appearance>, E> + 'a;

/// Gaussians that are neighbours in the file. All slices have one entry for each.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Part<'a> {
    pub(crate) splats: &'a Splats,
    /// Sensitivities to colour and opacity.
    pub(crate) weights: &'a [[f32; 2]],
    /// Cell and place in the source.
    pub(crate) places: &'a [MortonKey],
    /// Whether the file has it.
    pub(crate) stays: &'a [bool],
}

/// The encoder of a scene in parts. Steps, predictors and dictionary come from a sample. The symbols of all
/// chunks are spilled until they are counted.
#[derive(Debug)]
pub(crate) struct PartPacker {
    options: PackOptions,
    fit: Fit,
    floor: Floor,
    encoding: Encoding,
    /// As `encoding` was before the first part.
    blank: Encoding,
    /// Numbers of Gaussians of the file, and of those it leaves out.
    gaussians: usize,
    removed: usize,
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
        let Whole { gaussians, kept: total, grid, step } = scene;
        let all = grid.keys(&sample.geometry);
        let fit = Fit::new(&sample.geometry, sensitivity, &all, &grid);
        let kept = Weights::new(&sample.geometry, sensitivity, &all, options.may_change()).kept(step);
        let scene: Vec<MortonKey> = kept.iter().map(|&i| all[i]).collect();
        let classes: Vec<[f32; 2]> = kept.iter().map(|&i| fit.classes[i]).collect();
        let clock = Stopwatch::start();
        let floor = Floor::new(fit.with_step(step), &sample.geometry, &scene);
        let classes = floor.classes(&classes, &sample.geometry, &scene);
        let view = View { splats: sample, scene: &scene, classes: &classes, appearances: None };
        let coder = ChunkCoder::new(view, total, floor.parameters.clone(), options, progress)?;
        progress.check()?;
        let encoding = Encoding::new(coder, clock);
        Ok(Self {
            options: options.clone(),
            blank: encoding.clone(),
            encoding,
            gaussians: total,
            removed: gaussians - total,
            chunks: Spill::new(to)?,
            lengths: Vec::new(),
            order: if options.keep_order { Some(Spill::new(to)?) } else { None },
            extras: SpilledExtras::new(to, sample.empty().geometry)?,
            meta: sample.meta.clone(),
            fit,
            floor,
        })
    }

    /// Codes the Gaussians of `part` that stay: whole chunks, unless they are the last ones. `refit` fits what they
    /// show if that may change. Advances `progress` by their number. The caller has checked the part.
    pub(crate) fn push<E: From<Error>>(
        &mut self,
        part: Part<'_>,
        refit: Option<&mut Refit<'_, E>>,
        progress: &dyn Progress,
    ) -> Result<(), E> {
        let splats = part.splats;
        let kept = || (0..splats.len()).filter(|&i| part.stays[i]);
        let scene: Vec<MortonKey> = (0..)
            .zip(part.places)
            .zip(part.stays)
            .filter(|(_, stays)| **stays)
            .map(|((source, place), _)| MortonKey { source, ..*place })
            .collect();
        let weights: Vec<[f32; 2]> = kept().map(|i| part.weights[i]).collect();
        let classes = self.floor.classes(&self.fit.classes_of(&weights), &splats.geometry, &scene);
        let (options, blank) = (&self.options, self.blank.clone());
        let quantised = Quantised::of_part(splats, options, scene, classes, weights, blank, progress)?;
        let mut appearances = None;
        if let Some(refit) = refit.filter(|_| options.may_change()) {
            let model = quantised.finish(None, progress)?.0.unpack()?;
            appearances = Some(refit(splats, &model, quantised.weights())?);
        }
        let view = quantised.view(appearances.as_deref())?;
        for chunk in quantised.each_chunk(view, progress, |tally, symbols| (tally, symbols)) {
            let (tally, symbols) = chunk?;
            self.encoding.counts.add(&Counts::of(tally, &symbols));
            let (symbols, raw) = symbols.set_aside();
            self.lengths.push([symbols.len(), raw.len()]);
            self.chunks.push(&symbols)?;
            self.chunks.push(&raw)?;
        }
        if let Some(order) = &mut self.order {
            order.push(&kept().map(|i| part.places[i].source).collect::<Vec<u32>>())?;
        }
        Ok(self.extras.push(&quantised.extras())?)
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
        let mut code_chunks = |tables: &Tables, write: &mut WriteChunk<'_>| {
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
        head.removed = self.removed as u64;
        let order = self.order.map(Spill::finish).transpose()?;
        Ok((head, SpilledPacked { data, order, extras: self.extras.finish()? }, report))
    }
}
