//! A scene at one overall step, ready to be written with any base colours.

use super::CHUNK;
use super::canonical::MortonKey;
use super::codebook::Codes;
use super::coder::{ChunkCoder, View};
use super::encoding::{Counts, Encoding, Finished, WriteChunk};
use super::entropy::Tables;
use super::pack::PackOptions;
use super::parameters::Parameters;
use super::reorder::gather;
use super::scene::Packed;
use super::stream::SymbolEncoder;
use crate::scene::extra::{Extra, for_extra};
use crate::scene::splats::{Splats, all_finite};
use crate::sparse::tally::{CompressReport, Tally};
use crate::support::error::{Error, Result};
use crate::support::parallel::map_chunks;
use crate::support::progress::{Progress, Stage};
use crate::support::spill::SpillTo;
use crate::support::stopwatch::Stopwatch;

/// A scene at one overall step: which Gaussians stay, steps, dictionary and codes are settled. [`Self::finish`] makes the
/// file with the scene's own base colours or with others, which change nothing else.
#[derive(Debug)]
pub struct Quantised<'a> {
    splats: &'a Splats,
    options: &'a PackOptions,
    scene: Vec<MortonKey>,
    /// Colour and shape class of each Gaussian.
    classes: Vec<[u8; 2]>,
    /// Sensitivity to the colour of each.
    colour_weights: Vec<f32>,
    codes: Vec<Codes>,
    encoding: Encoding,
}

impl<'a> Quantised<'a> {
    pub(super) fn new(
        splats: &'a Splats,
        options: &'a PackOptions,
        scene: Vec<MortonKey>,
        classes: Vec<[u8; 2]>,
        colour_weights: Vec<f32>,
        parameters: Parameters,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let n = scene.len();
        let view = View { splats, scene: &scene, classes: &classes, base_colours: None };
        let clock = Stopwatch::start();
        let coder = ChunkCoder::new(view, n, parameters, options, progress)?;
        let encoding = Encoding::new(coder, clock);
        progress.check()?;
        progress.begin(Stage::Code, n as u64);
        let mut whole = Self::of_part(splats, options, scene, classes, colour_weights, encoding, progress)?;
        progress.end();
        whole.encoding.end_learning();
        Ok(whole)
    }

    /// A part of a scene, with what all parts are coded with.
    pub(super) fn of_part(
        splats: &'a Splats,
        options: &'a PackOptions,
        scene: Vec<MortonKey>,
        classes: Vec<[u8; 2]>,
        colour_weights: Vec<f32>,
        encoding: Encoding,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let view = View { splats, scene: &scene, classes: &classes, base_colours: None };
        let codes = codes_of(&encoding.coder, view, progress)?;
        Ok(Self { splats, options, scene, classes, colour_weights, codes, encoding })
    }

    /// Number of Gaussians of the file.
    #[must_use]
    pub fn len(&self) -> usize {
        self.scene.len()
    }

    /// Whether the file has no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.scene.is_empty()
    }

    /// Sensitivity to the colour of each Gaussian, in the order of the file.
    #[must_use]
    pub fn colour_weights(&self) -> &[f32] {
        &self.colour_weights
    }

    /// Makes the file, with the scene's own base colours or with these: SH coefficients of degree 0, one row for each
    /// Gaussian in the order of the file.
    ///
    /// # Errors
    /// [`Error::Parameter`] if there are more or fewer rows than Gaussians, if values are not finite, or if sums of
    /// them leave f32; [`Error::Cancelled`].
    pub fn finish(
        &self,
        base_colours: Option<&[[f32; 3]]>,
        progress: &dyn Progress,
    ) -> Result<(Packed, CompressReport)> {
        let n = self.len();
        let view = self.view(base_colours)?;
        let mut encoding = self.encoding.clone();
        // The counting pass runs first because the tables must be known before any symbol is coded. Keeping all
        // symbols in memory would take more than the scene's geometry.
        for chunk in self.each_chunk(view, progress, |tally, symbols| Counts::of(tally, &symbols)) {
            encoding.counts.add(&chunk?);
        }
        let mut code_chunks = |tables: &Tables, write: &mut WriteChunk<'_>| {
            let parts = self.each_chunk(view, progress, |_, symbols| symbols.finish(tables));
            parts.into_iter().try_for_each(|part| write(part?))
        };
        let meta = self.splats.meta.clone();
        let Finished { mut head, data, report } =
            encoding.finish(n, self.options, meta, SpillTo::Memory, &mut code_chunks)?;
        head.removed = (self.splats.len() - n) as u64;
        let order = self.options.keep_order.then(|| self.scene.iter().map(|g| g.source).collect());
        Ok((Packed::new(head, self.extras(), order, data.into_bytes()?), report))
    }

    /// The Gaussians with the scene's own base colours or with these, which are refused as [`Self::finish`] says.
    pub(super) fn view<'v>(&'v self, base_colours: Option<&'v [[f32; 3]]>) -> Result<View<'v>> {
        let n = self.len();
        if let Some(colours) = base_colours {
            if colours.len() != n {
                return Err(Error::parameter("base colours", colours.len(), format!("{n} rows")));
            }
            all_finite([("base colours", colours.as_flattened())])?;
        }
        Ok(View { splats: self.splats, scene: &self.scene, classes: &self.classes, base_colours })
    }

    /// What `with` makes of the counts and the symbols of each chunk of `view`.
    pub(super) fn each_chunk<T: Send>(
        &self,
        view: View<'_>,
        progress: &dyn Progress,
        with: impl Fn(Tally, SymbolEncoder) -> T + Sync,
    ) -> Vec<Result<T>> {
        map_chunks(self.len(), CHUNK, |range| {
            progress.check()?;
            let codes = &self.codes[range.start / CHUNK];
            let (tally, symbols) = self.encoding.coder.record(view.part(range), codes)?;
            Ok(with(tally, symbols))
        })
    }

    /// The columns that are not drawn, with the rows of the file.
    pub(super) fn extras(&self) -> Vec<Extra> {
        let mut extras = self.splats.geometry.extras.clone();
        for extra in &mut extras {
            for_extra!(&mut extra.values, v => gather(v, self.scene.iter().map(|g| g.index())));
        }
        extras
    }
}

/// The codes of all of `view`, chunk by chunk.
fn codes_of(coder: &ChunkCoder, view: View<'_>, progress: &dyn Progress) -> Result<Vec<Codes>> {
    let n = view.len();
    let codes = (0..n.div_ceil(CHUNK)).map(|c| {
        progress.check()?;
        let part = view.part(c * CHUNK..n.min((c + 1) * CHUNK));
        let codes = coder.codes(part);
        progress.advance(part.len() as u64);
        Ok(codes)
    });
    codes.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packed::Packer;
    use crate::{Sensitivity, Silent};

    #[test]
    fn other_base_colours_change_nothing_else() {
        let splats = crate::support::testing::scene(700, 5);
        let sensitivity = Sensitivity::heuristic(&splats.geometry);
        let options = PackOptions::default();
        let packer = Packer::new(&splats, &sensitivity, &options).unwrap();
        let quantised = packer.quantise(1e-5, true, &Silent).unwrap();
        let file = |colours| quantised.finish(colours, &Silent).unwrap().0.unpack().unwrap();
        let own = file(None);
        assert!(own == packer.pack(1e-5, &Silent).unwrap().0.unpack().unwrap());
        let colours: Vec<[f32; 3]> = own.geometry().dc.iter().map(|dc| dc.map(|v| v + 0.5)).collect();
        let other = file(Some(&colours));
        let off = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max);
        let farthest = other.geometry().dc.iter().zip(&colours).map(off).fold(0.0, f32::max);
        assert!(farthest < 0.1, "{farthest}");
        let mut mixed = other.into_splats();
        mixed.geometry.dc.clone_from(&own.geometry().dc);
        assert_eq!(mixed, own.into_splats());
    }

    #[test]
    fn base_colours_that_do_not_fit_are_refused() {
        let splats = crate::support::testing::scene(50, 5);
        let sensitivity = Sensitivity::heuristic(&splats.geometry);
        let options = PackOptions::default();
        let packer = Packer::new(&splats, &sensitivity, &options).unwrap();
        let quantised = packer.quantise(1e-5, true, &Silent).unwrap();
        assert_eq!(
            (quantised.len(), quantised.colour_weights().len(), quantised.is_empty()),
            (50, 50, false)
        );
        let refused =
            |colours: &[[f32; 3]]| quantised.finish(Some(colours), &Silent).unwrap_err().to_string();
        assert!(refused(&[[0.0; 3]; 49]).contains("50 rows"));
        assert!(refused(&[[f32::NAN; 3]; 50]).contains("NaN"));
    }
}
