//! A scene at one overall step, ready to be written with any base colours and opacities.

use super::CHUNK;
use super::appearance::Appearance;
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
use crate::scene::splats::Splats;
use crate::sparse::tally::{CompressReport, Tally};
use crate::support::error::{Error, Result};
use crate::support::parallel::map_chunks;
use crate::support::progress::{Progress, Stage};
use crate::support::spill::SpillTo;
use crate::support::stopwatch::Stopwatch;

/// A scene at one overall step: which Gaussians stay, steps, dictionary and codes are settled. [`Self::finish`] makes the
/// file with the scene's own base colours and opacities or with others, which change nothing else.
#[derive(Debug)]
pub struct Quantised<'a> {
    splats: &'a Splats,
    options: &'a PackOptions,
    scene: Vec<MortonKey>,
    /// Colour and shape class of each Gaussian.
    classes: Vec<[u8; 2]>,
    /// Sensitivities of each to its colour and to the logarithm of its opacity.
    weights: Vec<[f32; 2]>,
    codes: Vec<Codes>,
    encoding: Encoding,
}

impl<'a> Quantised<'a> {
    pub(super) fn new(
        splats: &'a Splats,
        options: &'a PackOptions,
        scene: Vec<MortonKey>,
        classes: Vec<[u8; 2]>,
        weights: Vec<[f32; 2]>,
        parameters: Parameters,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let n = scene.len();
        let view = View { splats, scene: &scene, classes: &classes, appearances: None };
        let clock = Stopwatch::start();
        let coder = ChunkCoder::new(view, n, parameters, options, progress)?;
        let encoding = Encoding::new(coder, clock);
        progress.check()?;
        progress.begin(Stage::Code, n as u64);
        let mut whole = Self::of_part(splats, options, scene, classes, weights, encoding, progress)?;
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
        weights: Vec<[f32; 2]>,
        encoding: Encoding,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let view = View { splats, scene: &scene, classes: &classes, appearances: None };
        let codes = codes_of(&encoding.coder, view, progress)?;
        Ok(Self { splats, options, scene, classes, weights, codes, encoding })
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

    /// Sensitivities of each Gaussian to its colour and to the logarithm of its opacity, in the order of the file.
    #[must_use]
    pub fn weights(&self) -> &[[f32; 2]] {
        &self.weights
    }

    /// Makes the file, with the scene's own base colours and opacities or with these, one entry for each Gaussian in the
    /// order of the file.
    ///
    /// # Errors
    /// [`Error::Parameter`] if there are more or fewer entries than Gaussians, if values are not finite, if an opacity is
    /// above 1, or if sums of values leave f32; [`Error::Cancelled`].
    pub fn finish(
        &self,
        appearances: Option<&[Appearance]>,
        progress: &dyn Progress,
    ) -> Result<(Packed, CompressReport)> {
        let n = self.len();
        let view = self.view(appearances)?;
        if std::env::var_os("LAYERS").is_some() {
            self.layers(view);
        }
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

    fn layers(&self, view: View<'_>) {
        use super::layered::*;
        let coder = &self.encoding.coder;
        let parameters = &coder.parameters;
        let n = view.len();
        for (levels, least) in [(0, vec![1]), (1, vec![4, 1]), (1, vec![2, 1]), (2, vec![6, 2, 1])] {
            let steering = Steering::new(&Integers::of(parameters, 1.0));
            let dim = coder.dictionary.dim();
            let least = if dim == 0 { vec![] } else { least };
            let form = Form { steering, levels, rest: RestForm { dim, atoms: coder.dictionary.len(), least: least.clone() } };
            let mut all = Vec::new();
            let mut histograms = vec![Histogram::default(); ALL_CONTEXTS];
            let mut raw = vec![0.0; 29];
            for c in 0..n.div_ceil(CHUNK) {
                let range = c * CHUNK..n.min((c + 1) * CHUNK);
                let (_, targets) = coder.targets(view.part(range), &self.codes[c], 1.0).unwrap();
                let recorded = form.record(&targets).unwrap();
                for (r, _) in &recorded {
                    r.each(|context, symbol| histograms[context].add(symbol), |stream, bits| raw[stream] += f64::from(bits));
                }
                all.push((targets.len(), recorded));
            }
            let tables = Tables::new(&histograms).unwrap();
            let written = tables.write();
            let mut head = Head::new(parameters, 0.0, levels, form.rest.clone(), coder.atom_bits as u8);
            head.tables = written.clone();
            let mut sizes = vec![0; form.ranges()];
            let mut passes = vec![Vec::new(); form.ranges()];
            for (n, recorded) in &all {
                let lanes = lanes(*n);
                let bytes: Vec<Vec<u8>> = recorded.iter().map(|r| r.0.finish(&tables, lanes)).collect();
                let mut chunk = Chunk { gaussians: *n, ..Chunk::default() };
                for k in 0..bytes.len() {
                    sizes[k] += bytes[k].len();
                    passes[k].extend_from_slice(&bytes[k]);
                    chunk.ranges.push(Range { start: 0, length: bytes[k].len() as u32, checksum: 0, integers: recorded[k].1 });
                }
                head.index.chunks.push(chunk);
            }
            head.index.layers = 1;
            head.index.passes = (0..form.ranges()).map(|k| Pass { layer: 0, range: k as u8 }).collect();
            head.index.place().unwrap();
            let mut dump = Vec::new();
            let bytes = head.write();
            dump.extend((dim as u64).to_le_bytes());
            dump.extend((bytes.len() as u64).to_le_bytes());
            dump.extend(bytes);
            for pass in passes { dump.extend(pass); }
            std::fs::write(format!("/tmp/w/dump{levels}{}.bin", least.len()), dump).unwrap();
            let seconds = 1.0;
            let mut text = String::new();
            for (k, raw) in raw.iter().enumerate() {
                let bits: f64 = (0..24).map(|c| tables.bits(k * 24 + c, &histograms[k * 24 + c])).sum::<f64>() + raw;
                text += &format!(" {k}:{:.2}", bits / n as f64);
            }
            println!("levels {levels} {least:?}: ranges {sizes:?} = {} + tables {}; {:.0} ns a Gaussian = {:.2} M/s; {:.3} bits\n  {text}", sizes.iter().sum::<usize>(), written.len(), seconds * 1e9 / n as f64, n as f64 / seconds / 1e6, 8.0 * sizes.iter().sum::<usize>() as f64 / n as f64);
        }
    }

    /// The Gaussians as they are or with these appearances, which are refused as [`Self::finish`] says.
    pub(super) fn view<'v>(&'v self, appearances: Option<&'v [Appearance]>) -> Result<View<'v>> {
        let n = self.len();
        if let Some(all) = appearances {
            if all.len() != n {
                return Err(Error::parameter("appearances", all.len(), format!("{n} entries")));
            }
            all.iter().try_for_each(Appearance::check)?;
        }
        Ok(View { splats: self.splats, scene: &self.scene, classes: &self.classes, appearances })
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
    fn other_appearances_change_nothing_else() {
        let splats = crate::support::testing::scene(700, 5);
        let sensitivity = Sensitivity::heuristic(&splats.geometry);
        let options = PackOptions::default();
        let packer = Packer::new(&splats, &sensitivity, &options).unwrap();
        let quantised = packer.quantise(1e-5, true, &Silent).unwrap();
        let file = |shown| quantised.finish(shown, &Silent).unwrap().0.unpack().unwrap();
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
    fn appearances_that_do_not_fit_are_refused() {
        let splats = crate::support::testing::scene(50, 5);
        let sensitivity = Sensitivity::heuristic(&splats.geometry);
        let options = PackOptions::default();
        let packer = Packer::new(&splats, &sensitivity, &options).unwrap();
        let quantised = packer.quantise(1e-5, true, &Silent).unwrap();
        assert_eq!((quantised.len(), quantised.weights().len(), quantised.is_empty()), (50, 50, false));
        let refused = |shown: &[Appearance]| quantised.finish(Some(shown), &Silent).unwrap_err().to_string();
        let good = Appearance { dc: [0.0; 3], log_opacity: -1.0 };
        assert!(refused(&[good; 49]).contains("50 entries"));
        assert!(refused(&[Appearance { dc: [f32::NAN; 3], ..good }; 50]).contains("NaN"));
    }
}
