//! A scene that is quantised with one overall step. Its base colours and opacities can still change.

use std::borrow::Cow;
use std::ops::Range;

use super::appearance::{Appearance, AppearanceChange};
use super::codebook::Codes;
use super::coder::{OrderedGaussians, too_large};
use super::encoding::{Counts, Encoding, Finished, WriteChunk, Written};
use super::interim::InterimChanges;
use super::layering::Layering;
use super::options::PackOptions;
use crate::packed::bitstream::CodedChunk;
use crate::packed::bitstream::coded_gaussian::CodedGaussian;
use crate::packed::bitstream::parameters::ColourAndShape;
use crate::packed::curve::MortonKey;
use crate::packed::decode::reorder::gather;
use crate::packed::entropy::tables::Tables;
use crate::packed::scene::Packed;
use crate::scene::extra::{Extra, for_extra};
use crate::scene::sensitivity::AppearanceSensitivity;
use crate::scene::splats::{Splats, all_finite};
use crate::sparse::model::Model;
use crate::sparse::tally::{CompressReport, Tally};
use crate::support::error::{Error, Result};
use crate::support::parallel::map_vec;
use crate::support::progress::{Progress, Stage};
use crate::support::spill::SpillTo;

/// A function that fits a part of a scene, as the file has it, to pictures of the part. It may replace SH-rest
/// ([`Quantised::set_sh_rest`]). It returns one appearance for each Gaussian of the file, or `None` to leave them as they are.
pub type Refit<'a, E = Error> = dyn FnMut(ToRefit<'_, '_>) -> Result<Option<Vec<Appearance>>, E> + 'a;

/// A part of a scene to fit to pictures of the part.
#[derive(Debug)]
pub struct ToRefit<'r, 'q> {
    /// The part as the source has it.
    pub part: &'r Splats,
    /// The part as the file has it.
    pub model: Model,
    /// The file, of which SH-rest may still change.
    pub quantised: &'r mut Quantised<'q>,
    /// The sensitivity to the appearance of each Gaussian of the file, as it was observed.
    pub sensitivities: Vec<AppearanceSensitivity>,
    /// The overall step that goes with [`Self::sensitivities`].
    pub step: f64,
    /// The memo of [`Observed`](crate::stream::Observed).
    pub memo: &'r [u8],
}

/// The source of a part that is packed, and its overall step.
pub(crate) struct Observation<'r> {
    /// The part as the source has it.
    pub(crate) part: &'r Splats,
    /// The overall step.
    pub(crate) step: f64,
    /// Factor from observed sensitivities to those of the Gaussians.
    pub(crate) scale: f32,
    /// The memo of [`Observed`](crate::stream::Observed).
    pub(crate) memo: &'r [u8],
}

impl Observation<'_> {
    /// Returns the sensitivities as they were observed.
    pub(crate) fn observed(&self, own: &[AppearanceSensitivity]) -> Vec<AppearanceSensitivity> {
        let observed = |s: &AppearanceSensitivity| AppearanceSensitivity {
            colour: s.colour / self.scale,
            opacity: s.opacity / self.scale,
        };
        own.iter().map(observed).collect()
    }
}

/// The Gaussians of a file. All lists have the same order.
#[derive(Debug, Clone, Default)]
pub(in crate::packed) struct Gaussians {
    /// The cell of each Gaussian, and its index in the source.
    pub(in crate::packed) keys: Vec<MortonKey>,
    pub(in crate::packed) classes: Vec<ColourAndShape<u8>>,
    /// The sensitivity to the appearance of each Gaussian.
    pub(in crate::packed) sensitivities: Vec<AppearanceSensitivity>,
}

impl Gaussians {
    /// Sorts the Gaussians by layer. Within a layer they stay in the order of cells. Returns the number of Gaussians of
    /// each layer.
    pub(in crate::packed) fn in_layers(&mut self, layering: &mut Layering) -> Vec<usize> {
        let layers: Vec<usize> = self.sensitivities.iter().map(|s| layering.layer(s.opacity)).collect();
        let layers = &layers;
        let of = |layer: usize| (0..layers.len()).filter(move |&i| layers[i] == layer);
        let count = layering.layers();
        let order: Vec<usize> = (0..count).flat_map(&of).collect();
        gather(&mut self.keys, order.iter().copied());
        gather(&mut self.classes, order.iter().copied());
        gather(&mut self.sensitivities, order.iter().copied());
        (0..count).map(|layer| of(layer).count()).collect()
    }
}

/// A chunk of a file.
#[derive(Debug, Clone)]
struct ChunkRows {
    layer: usize,
    /// Its Gaussians, by their index in the file.
    rows: Range<usize>,
}

/// A scene that is quantised with one overall step. The Gaussians that stay, the steps, the dictionary and the codes are
/// settled. [`Self::finish`] makes the file with the scene's own base colours and opacities, or with others. These change
/// nothing else.
#[derive(Debug, Clone)]
pub struct Quantised<'a> {
    splats: Cow<'a, Splats>,
    options: &'a PackOptions,
    gaussians: Gaussians,
    chunks: Vec<ChunkRows>,
    /// The codes of each chunk.
    codes: Vec<Codes>,
    /// The interim changes of all layers but the last.
    interim: InterimChanges,
    encoding: Encoding,
}

impl<'a> Quantised<'a> {
    /// Quantises a scene or a part of one. `encoding` has everything with which all parts are coded. Advances `progress` by the
    /// number of Gaussians.
    pub(in crate::packed) fn new(
        splats: &'a Splats,
        options: &'a PackOptions,
        mut gaussians: Gaussians,
        mut encoding: Encoding,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let counts = gaussians.in_layers(&mut encoding.layering);
        let mut chunks = Vec::new();
        let mut start = 0;
        for (layer, &count) in counts.iter().enumerate() {
            let end = start + count;
            while start < end {
                let next = start + encoding.layering.next_chunk(layer, end - start);
                chunks.push(ChunkRows { layer, rows: start..next });
                start = next;
            }
        }
        let probability =
            |layer: usize, i: usize| encoding.layering.probability(layer, gaussians.sensitivities[i].opacity);
        let interim = InterimChanges::new(&splats.geometry, &gaussians.keys, &counts, probability);
        let splats = Cow::Borrowed(splats);
        let mut part = Self { splats, options, gaussians, chunks, codes: Vec::new(), interim, encoding };
        part.code(progress)?;
        Ok(part)
    }

    /// Chooses the codes of all chunks.
    fn code(&mut self, progress: &dyn Progress) -> Result<()> {
        let ordered = self.ordered(None)?;
        let codes = self.chunks.iter().map(|ChunkRows { rows, .. }| {
            progress.check()?;
            let codes = self.encoding.coder.codes(ordered.slice(rows.clone()));
            progress.advance(rows.len() as u64);
            Ok(codes)
        });
        self.codes = codes.collect::<Result<_>>()?;
        Ok(())
    }

    /// Replaces the SH-rest and chooses new codes. `sh_rest` has a row for each Gaussian in the order of the file. The
    /// dictionary and all steps stay, and so do the positions, scales and rotations of the file.
    ///
    /// # Errors
    /// [`Error::Parameter`] for rows that are too few, too many or not finite; [`Error::Cancelled`].
    pub fn set_sh_rest(&mut self, sh_rest: &[f32], progress: &dyn Progress) -> Result<()> {
        let rest = self.splats.degree.rest();
        let expected = self.len() * rest;
        if sh_rest.len() != expected {
            return Err(Error::parameter("sh_rest", sh_rest.len(), format!("{expected} values")));
        }
        all_finite([("sh_rest", sh_rest)])?;
        let splats = self.splats.to_mut();
        for (g, row) in self.gaussians.keys.iter().zip(sh_rest.chunks_exact(rest.max(1))) {
            splats.sh_rest[g.index() * rest..(g.index() + 1) * rest].copy_from_slice(row);
        }
        progress.begin(Stage::Code, self.len() as u64);
        self.code(progress)?;
        progress.end();
        Ok(())
    }

    /// Returns the number of Gaussians of the file.
    #[must_use]
    pub fn len(&self) -> usize {
        self.gaussians.keys.len()
    }

    /// Returns whether the file has no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.gaussians.keys.is_empty()
    }

    /// Returns the sensitivity to the appearance of each Gaussian, in the order of the file.
    #[must_use]
    pub fn sensitivities(&self) -> &[AppearanceSensitivity] {
        &self.gaussians.sensitivities
    }

    /// Makes the file. `appearances` replaces the scene's own base colours and opacities, with one entry for each Gaussian
    /// in the order of the file. `changes` are the interim changes of the Gaussians of the first layer, for the time while
    /// the second layer is missing. They are relative to the scene of [`Packed::first_layer`].
    ///
    /// # Errors
    /// [`Error::Parameter`] if there are more or fewer entries than Gaussians, if values are not finite, if an opacity is
    /// above 1, or if sums of values leave f32; [`Error::Cancelled`].
    pub fn finish(
        &self,
        appearances: Option<&[Appearance]>,
        changes: Option<&[AppearanceChange]>,
        progress: &dyn Progress,
    ) -> Result<(Packed, CompressReport)> {
        let n = self.len();
        let ordered = OrderedGaussians { changes, ..self.ordered(appearances)? };
        changes.unwrap_or_default().iter().try_for_each(AppearanceChange::check)?;
        let mut encoding = self.encoding.clone();
        // The counting pass runs first, because the tables must be known before any symbol is coded. Keeping all symbols in
        // memory would take more than the scene's geometry.
        let counted = self.each_chunk(ordered, progress, |_, tally, coded| Counts::of(tally, &coded.ranges));
        for chunk in counted {
            encoding.counts.add(&chunk?);
        }
        let mut code_chunks = |tables: &Tables, write: &mut WriteChunk<'_>| {
            let written =
                self.each_chunk(ordered, progress, |layer, _, coded| Written::new(layer, &coded, tables));
            written.into_iter().try_for_each(|chunk| write(chunk?))
        };
        let meta = self.splats.meta.clone();
        let Finished { mut head, data, report } =
            encoding.finish(n, self.options, meta, SpillTo::Memory, &mut code_chunks)?;
        head.removed = (self.splats.len() - n) as u64;
        let order = self.options.keep_order.then(|| self.gaussians.keys.iter().map(|g| g.source).collect());
        Ok((Packed::new(head, self.extras(0..n), order, data.into_bytes()?), report))
    }

    /// Returns the counts of all symbols, and the layer and the symbols of each chunk. `appearances` replaces the scene's
    /// own base colours and opacities.
    pub(in crate::packed) fn counted(
        &self,
        appearances: Option<&[Appearance]>,
        progress: &dyn Progress,
    ) -> Result<(Counts, Vec<(usize, CodedChunk)>)> {
        let mut counts = Counts::of(Tally::new(self.encoding.coder.dictionary.dim()), []);
        let mut chunks = Vec::with_capacity(self.chunks.len());
        let all = self.each_chunk(self.ordered(appearances)?, progress, |layer, tally, coded| {
            let counts = Counts::of(tally, &coded.ranges);
            (counts, (layer, coded))
        });
        for chunk in all {
            let (own, chunk) = chunk?;
            counts.add(&own);
            chunks.push(chunk);
        }
        Ok((counts, chunks))
    }

    /// Returns the Gaussians with these appearances, or with their own. Refuses appearances as [`Self::finish`] says.
    pub(in crate::packed) fn ordered<'v>(
        &'v self,
        appearances: Option<&'v [Appearance]>,
    ) -> Result<OrderedGaussians<'v>> {
        let n = self.len();
        if let Some(all) = appearances {
            if all.len() != n {
                return Err(Error::parameter("appearances", all.len(), format!("{n} entries")));
            }
            all.iter().try_for_each(Appearance::check)?;
        }
        let Gaussians { keys, classes, .. } = &self.gaussians;
        Ok(OrderedGaussians { appearances, ..OrderedGaussians::new(&self.splats, keys, classes) })
    }

    /// Calls `with` for each chunk of `ordered`, with its layer, the counts of its codes and its symbols. Returns the
    /// results in the order of chunks.
    fn each_chunk<T: Send>(
        &self,
        ordered: OrderedGaussians<'_>,
        progress: &dyn Progress,
        with: impl Fn(usize, Tally, CodedChunk) -> T + Sync,
    ) -> Vec<Result<T>> {
        let Encoding { form, head, .. } = &self.encoding;
        let forms = self.encoding.layering.forms(head.rest.least.len());
        self.each_target(ordered, progress, |layer, tally, targets| {
            let layer_form = forms.get(layer).copied().unwrap_or_default();
            let coded = form.record(&head.frame, layer_form, &targets).ok_or_else(too_large)?;
            Ok(with(layer, tally, coded))
        })
    }

    /// Calls `with` for each chunk of `ordered`, with its layer, the counts of its codes and its targets. Returns the
    /// results in the order of chunks.
    pub(in crate::packed) fn each_target<T: Send>(
        &self,
        ordered: OrderedGaussians<'_>,
        progress: &dyn Progress,
        with: impl Fn(usize, Tally, Vec<CodedGaussian>) -> Result<T> + Sync,
    ) -> Vec<Result<T>> {
        let coder = &self.encoding.coder;
        let unit = self.encoding.head.dc_unit();
        map_vec(self.chunks.iter().zip(&self.codes).collect(), |(ChunkRows { layer, rows }, codes)| {
            progress.check()?;
            let (tally, mut targets) = coder.targets(ordered.slice(rows.clone()), codes, unit)?;
            for (i, target) in rows.clone().zip(&mut targets) {
                target.energy = self.gaussians.sensitivities[i].opacity;
                if !self.interim.has(*layer) {
                    continue;
                }
                let change = ordered.changes.and_then(|changes| changes.get(i));
                target.interim = self.interim.steps(i, change, &coder.parameters);
            }
            with(*layer, tally, targets)
        })
    }

    /// Returns the number of Gaussians of each layer.
    pub(in crate::packed) fn layer_counts(&self) -> Vec<usize> {
        let mut counts = vec![0; self.encoding.layering.layers()];
        self.chunks.iter().for_each(|chunk| counts[chunk.layer] += chunk.rows.len());
        counts
    }

    /// Returns the cell of each Gaussian and its index in the source, in the order of the file.
    pub(in crate::packed) fn sources(&self) -> &[MortonKey] {
        &self.gaussians.keys
    }

    /// Returns the properties that 3DGS does not define, for the Gaussians `rows` in the order of the file.
    pub(in crate::packed) fn extras(&self, rows: Range<usize>) -> Vec<Extra> {
        let sources = &self.gaussians.keys[rows];
        let mut extras = self.splats.geometry.extras.clone();
        for extra in &mut extras {
            for_extra!(&mut extra.values, v => gather(v, sources.iter().map(|g| g.index())));
        }
        extras
    }

    /// Returns the appearances that `refit` fits to pictures. `None` if base colours and opacities may not change, or if
    /// there are no Gaussians.
    pub(crate) fn refitted<E: From<Error>>(
        &mut self,
        refit: Option<&mut Refit<'_, E>>,
        observation: &Observation<'_>,
        progress: &dyn Progress,
    ) -> Result<Option<Vec<Appearance>>, E> {
        let Some(refit) = refit.filter(|_| self.options.may_change() && !self.is_empty()) else {
            return Ok(None);
        };
        let model = self.finish(None, None, progress)?.0.unpack()?;
        let sensitivities = observation.observed(self.sensitivities());
        let Observation { part, step, scale, memo } = *observation;
        let step = step / f64::from(scale).sqrt();
        refit(ToRefit { part, model, quantised: self, sensitivities, step, memo })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packed::Packer;
    use crate::{Sensitivity, Silent};

    #[test]
    fn other_appearances_change_nothing_else() {
        let splats = crate::support::testing::scene(700, 5);
        let sensitivity = Sensitivity::guess(&splats.geometry);
        let options = PackOptions::default();
        let packer = Packer::new(&splats, &sensitivity, &options).unwrap();
        let quantised = packer.quantise(1e-5, true, &Silent).unwrap();
        let file = |shown| quantised.finish(shown, None, &Silent).unwrap().0.unpack().unwrap();
        let own = file(None);
        assert!(own == packer.pack(1e-5, &Silent).unwrap().0.unpack().unwrap());
        let mut expected = own.clone().into_splats();
        for i in 0..own.len() {
            let Appearance { dc, log_opacity } = Appearance::of(own.geometry(), i);
            Appearance { dc: dc.map(|v| v + 0.5), log_opacity: log_opacity - 0.4 }
                .give(&mut expected.geometry, i);
        }
        let shown: Vec<Appearance> = (0..own.len()).map(|i| Appearance::of(&expected.geometry, i)).collect();
        let mut other = file(Some(&shown)).into_splats();
        for (i, wanted) in shown.iter().enumerate() {
            let found = Appearance::of(&other.geometry, i);
            assert!((0..3).all(|k| (found.dc[k] - wanted.dc[k]).abs() < 0.1), "{found:?} {wanted:?}");
            assert!((found.log_opacity - wanted.log_opacity).abs() < 0.2, "{found:?} {wanted:?}");
        }
        other.geometry.dc.clone_from(&expected.geometry.dc);
        other.geometry.opacities.clone_from(&expected.geometry.opacities);
        assert_eq!(other, expected);
    }

    #[test]
    fn other_sh_rest_changes_nothing_else() {
        let splats = crate::support::testing::scene(700, 5);
        let sensitivity = Sensitivity::guess(&splats.geometry);
        let options = PackOptions::default();
        let packer = Packer::new(&splats, &sensitivity, &options).unwrap();
        let quantised = packer.quantise(1e-5, true, &Silent).unwrap();
        let model =
            |of: &Quantised<'_>| of.finish(None, None, &Silent).unwrap().0.unpack().unwrap().into_splats();
        let own = model(&quantised);
        // The scene's own rows in the order of the file give the same file.
        let rows: Vec<f32> =
            quantised.sources().iter().flat_map(|g| splats.rest(g.index())).copied().collect();
        let with = |rows: &[f32]| {
            let mut other = quantised.clone();
            other.set_sh_rest(rows, &Silent).map(|()| other)
        };
        assert_eq!(model(&with(&rows).unwrap()), own);
        let halved: Vec<f32> = rows.iter().map(|v| 0.5 * v).collect();
        let other = model(&with(&halved).unwrap());
        assert_eq!(other.geometry, own.geometry);
        let error = |rows: &[f32]| {
            other.sh_rest.iter().zip(rows).map(|(a, b)| f64::from((a - b) * (a - b))).sum::<f64>()
        };
        assert!(error(&halved) < 0.1 * error(&rows), "{} {}", error(&halved), error(&rows));
        assert!(with(&rows[1..]).is_err());
        assert!(with(&vec![f32::NAN; rows.len()]).is_err());
    }

    #[test]
    fn appearances_that_do_not_fit_are_refused() {
        let splats = crate::support::testing::scene(50, 5);
        let sensitivity = Sensitivity::guess(&splats.geometry);
        let options = PackOptions::default();
        let packer = Packer::new(&splats, &sensitivity, &options).unwrap();
        let quantised = packer.quantise(1e-5, true, &Silent).unwrap();
        assert_eq!((quantised.len(), quantised.sensitivities().len(), quantised.is_empty()), (50, 50, false));
        let refused =
            |shown: &[Appearance]| quantised.finish(Some(shown), None, &Silent).unwrap_err().to_string();
        let good = Appearance { dc: [0.0; 3], log_opacity: -1.0 };
        assert!(refused(&[good; 49]).contains("50 entries"));
        assert!(refused(&[Appearance { dc: [f32::NAN; 3], ..good }; 50]).contains("NaN"));
    }
}
