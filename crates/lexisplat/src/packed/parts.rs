//! Packing a scene that comes part after part, in the order of the file.

use super::appearance::Appearance;
use super::canonical::{Grid, MortonKey};
use super::coder::{ChunkCoder, View, too_large};
use super::encoding::{Counts, Encoding, Finished, WriteChunk, Written};
use super::fit::Fit;
use super::floor::Floor;
use super::layered::{CodedChunk, MeanView, Recorder, Tables, Target};
use super::layering::Layering;
use super::pack::{PackOptions, most_dc};
use super::quantised::{Gaussians, Quantised};
use super::removal::Weights;
use super::reorder::gather;
use super::scene::{PackedHead, SpilledPacked};
use crate::scene::extra::{Extra, for_extra};
use crate::scene::sensitivity::Sensitivity;
use crate::scene::source::SplatSource;
use crate::scene::spilled::SpilledExtras;
use crate::scene::splats::{SceneMeta, Splats};
use crate::sparse::model::Model;
use crate::sparse::tally::{CompressReport, Tally};
use crate::support::error::{Error, Result};
use crate::support::parallel::map_vec;
use crate::support::progress::Progress;
use crate::support::spill::{Spill, SpillTo, Spilled};
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
    layers: Vec<Layer>,
    meta: SceneMeta,
}

/// What is known of one layer.
#[derive(Debug)]
struct Layer {
    /// Gaussians that do not fill a chunk yet.
    pending: Vec<Target>,
    /// Symbols of all chunks.
    symbols: Spill,
    chunks: Vec<SpilledChunk>,
    gaussians: usize,
    order: Option<Spill>,
    extras: SpilledExtras,
}

/// A chunk whose symbols are spilled.
#[derive(Debug)]
struct SpilledChunk {
    gaussians: usize,
    cell: u64,
    bounds: [[f32; 3]; 2],
    energy: f64,
    /// Of each range the number of symbols of each lane, and the checksum of the integers.
    ranges: Vec<(Vec<usize>, u32)>,
}

impl Layer {
    fn new(options: &PackOptions, sample: &Splats, to: SpillTo<'_>) -> Result<Self> {
        Ok(Self {
            pending: Vec::new(),
            symbols: Spill::new(to)?,
            chunks: Vec::new(),
            gaussians: 0,
            order: if options.keep_order { Some(Spill::new(to)?) } else { None },
            extras: SpilledExtras::new(to, sample.empty().geometry)?,
        })
    }

    /// Spills the symbols of the next chunk.
    fn push(&mut self, chunk: &CodedChunk) -> Result<()> {
        let mut ranges = Vec::with_capacity(chunk.ranges.len());
        for (range, sum) in &chunk.ranges {
            range.entries().iter().try_for_each(|lane| self.symbols.push(lane))?;
            ranges.push((range.entries().iter().map(Vec::len).collect(), *sum));
        }
        self.chunks.push(SpilledChunk {
            gaussians: chunk.gaussians,
            cell: chunk.cell,
            bounds: chunk.bounds,
            energy: chunk.energy,
            ranges,
        });
        Ok(())
    }
}

impl SpilledChunk {
    /// The chunk whose symbols come next.
    fn take(&self, symbols: &mut Spilled) -> Result<CodedChunk> {
        let mut ranges = Vec::with_capacity(self.ranges.len());
        for (lanes, sum) in &self.ranges {
            let lanes = lanes.iter().map(|&count| symbols.take(count)).collect::<Result<Vec<Vec<u32>>>>()?;
            ranges.push((Recorder::restore(lanes), *sum));
        }
        Ok(CodedChunk {
            gaussians: self.gaussians,
            cell: self.cell,
            bounds: self.bounds,
            energy: self.energy,
            ranges,
        })
    }
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
        let mean_view = MeanView::new(&options.viewpoints);
        let dc = mean_view.colours(sample);
        let fit = Fit::new(&sample.geometry, &dc, sensitivity, &all, &grid);
        let weights = Weights::new(&sample.geometry, sensitivity, &all, options.may_change());
        let kept = weights.kept(step);
        let scene: Vec<MortonKey> = kept.iter().map(|&i| all[i]).collect();
        let classes: Vec<[f32; 2]> = kept.iter().map(|&i| fit.classes[i]).collect();
        let clock = Stopwatch::start();
        let floor = Floor::new(fit.with_step(step), &sample.geometry, &scene);
        let classes = floor.classes(&classes, &sample.geometry, &scene);
        let layering = Layering::new(total, options.layers_from, kept.iter().map(|&i| weights.shown[i][1]));
        let view =
            View { splats: sample, scene: &scene, classes: &classes, appearances: None, changes: None };
        let coder = ChunkCoder::new(view, total, floor.parameters.clone(), mean_view, options, progress)?;
        progress.check()?;
        let most_dc = most_dc(&floor.parameters, &dc);
        let encoding = Encoding::new(coder, layering, most_dc, clock);
        let layers = (0..encoding.layering.layers()).map(|_| Layer::new(options, sample, to));
        Ok(Self {
            options: options.clone(),
            layers: layers.collect::<Result<_>>()?,
            blank: encoding.clone(),
            encoding,
            gaussians: total,
            removed: gaussians - total,
            meta: sample.meta.clone(),
            fit,
            floor,
        })
    }

    /// Codes the Gaussians of `part` that stay. `refit` fits what they show if that may change. Advances `progress` by
    /// their number. The caller has checked the part.
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
        let gaussians = Gaussians { scene, classes, weights };
        let (options, mut blank) = (&self.options, self.blank.clone());
        blank.layering = self.encoding.layering.clone();
        let quantised = Quantised::of_part(splats, options, gaussians, blank, progress)?;
        let mut appearances = None;
        if let Some(refit) = refit.filter(|_| options.may_change()) {
            let model = quantised.finish(None, None, progress)?.0.unpack()?;
            appearances = Some(refit(splats, &model, quantised.weights())?);
        }
        let view = quantised.view(appearances.as_deref())?;
        for targets in
            quantised.each_target(view, progress, |layer, tally, targets| Ok((layer, tally, targets)))
        {
            let (layer, tally, targets) = targets?;
            self.encoding.counts.add(&Counts::of(tally, []));
            self.layers[layer].pending.extend(targets);
        }
        self.encoding.layering = quantised.layering().clone();
        let sources = quantised.sources();
        let mut start = 0;
        for (layer, count) in self.layers.iter_mut().zip(quantised.layer_counts()) {
            let sources = &sources[start..start + count];
            if let Some(order) = &mut layer.order {
                let places = sources.iter().map(|g| part.places[g.index()].source);
                order.push(&places.collect::<Vec<u32>>())?;
            }
            layer.extras.push(&extras_of(splats, sources))?;
            layer.gaussians += count;
            start += count;
        }
        Ok(self.code_pending(false)?)
    }

    /// Codes the chunks that are full, or all that is left.
    fn code_pending(&mut self, all: bool) -> Result<()> {
        let forms = self.encoding.layering.forms(self.encoding.head.rest.least.len());
        for (k, layer) in self.layers.iter_mut().enumerate() {
            let layer_form = forms.get(k).copied().unwrap_or_default();
            let (form, frame) = (&self.encoding.form, &self.encoding.head.frame);
            let (mut chunks, mut whole) = (Vec::new(), 0);
            loop {
                let left = &layer.pending[whole..];
                let next = self.encoding.layering.next_chunk(k, left.len(), all);
                let Some(chunk) = left.get(..next).filter(|chunk| !chunk.is_empty()) else { break };
                chunks.push(chunk);
                whole += next;
            }
            let coded =
                map_vec(chunks, |targets| form.record(frame, layer_form, targets).ok_or_else(too_large));
            for chunk in coded {
                let chunk = chunk?;
                let none = Tally::new(self.encoding.coder.dictionary.dim());
                self.encoding.counts.add(&Counts::of(none, chunk.ranges.iter().map(|(range, _)| range)));
                layer.push(&chunk)?;
            }
            layer.pending.drain(..whole);
        }
        Ok(())
    }

    /// The packed scene and the report. `device` is the GPU that measured the
    /// sensitivity, if one did.
    pub(crate) fn finish(
        mut self,
        to: SpillTo<'_>,
        device: Option<&str>,
        progress: &dyn Progress,
    ) -> Result<(PackedHead, SpilledPacked, CompressReport)> {
        self.code_pending(true)?;
        let (mut spilled, mut orders, mut extras) = (Vec::new(), Vec::new(), Vec::new());
        for layer in self.layers {
            orders.extend(layer.order.map(|order| Ok((layer.gaussians, order.finish()?))));
            extras.push((layer.gaussians, layer.extras.finish()?));
            spilled.push((layer.chunks, layer.symbols.finish()?));
        }
        let mut code_chunks = |tables: &Tables, write: &mut WriteChunk<'_>| {
            for (number, (chunks, symbols)) in spilled.iter_mut().enumerate() {
                for batch in chunks.chunks(CHUNKS_AT_ONCE) {
                    progress.check()?;
                    let taken = batch.iter().map(|chunk| chunk.take(symbols)).collect::<Result<Vec<_>>>()?;
                    let written = map_vec(taken, |chunk| Written::new(number, &chunk, tables));
                    written.into_iter().try_for_each(&mut *write)?;
                }
            }
            Ok(())
        };
        let Finished { mut head, data, report } =
            self.encoding.finish(self.gaussians, &self.options, self.meta, to, &mut code_chunks)?;
        head.device = device.map(str::to_owned);
        head.removed = self.removed as u64;
        let orders = orders.into_iter().collect::<Result<Vec<_>>>()?;
        let order = (!orders.is_empty()).then_some(orders);
        Ok((head, SpilledPacked { data, order, extras: by_column(extras) }, report))
    }
}

/// The extras of the Gaussians at these places of `splats`.
fn extras_of(splats: &Splats, sources: &[MortonKey]) -> Vec<Extra> {
    let mut extras = splats.geometry.extras.clone();
    for extra in &mut extras {
        for_extra!(&mut extra.values, v => gather(v, sources.iter().map(|g| g.index())));
    }
    extras
}

/// The values of each column of all layers, from the columns of each layer.
fn by_column(layers: Vec<(usize, Vec<(Extra, Spilled)>)>) -> Vec<(Extra, Vec<(usize, Spilled)>)> {
    let mut columns: Vec<(Extra, Vec<(usize, Spilled)>)> = Vec::new();
    for (count, layer) in layers {
        for (k, (extra, values)) in layer.into_iter().enumerate() {
            match columns.get_mut(k) {
                Some((_, parts)) => parts.push((count, values)),
                None => columns.push((extra, vec![(count, values)])),
            }
        }
    }
    columns
}
