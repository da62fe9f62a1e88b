//! Decoding of a packed scene as a whole.

use super::available_ranges::Data;
use super::decoder::Decoder;
use super::output::{chunk_outputs, indices};
use crate::packed::bitstream::stream::{BitCounts, StreamBits};
use crate::packed::scene::Packed;
use crate::scene::splats::Geometry;
use crate::sparse::codes::{Escapes, SparseCodes, Values};
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::Model;
use crate::support::error::{Error, Result};
use crate::support::memory_budget::{COUNT_BYTES, GEOMETRY_BYTES, MemoryBudget};
use crate::support::parallel::map_vec;

impl Packed {
    /// Decodes the scene. Its SH coefficients stay sparse codes. Gaussians are in the order of the source if that was kept,
    /// otherwise in the order of the file.
    ///
    /// # Errors
    /// [`crate::Error::Format`] that names the damaged range; [`crate::Error::Limit`] if the scene is larger than the limits
    /// of its reader.
    pub fn unpack(&self) -> Result<Model> {
        self.unpack_with(&self.decoder()?)
    }

    fn decoder(&self) -> Result<Decoder> {
        Decoder::new(self.head(), self.data().len() as u64)
    }

    /// Decodes the scene as [`Self::unpack`] does, with a decoder of this scene whose options may leave out parts of
    /// SH-rest.
    pub(crate) fn unpack_with(&self, decoder: &Decoder) -> Result<Model> {
        let model = self.decode_with(decoder, self.data(), false)?.0;
        match self.order() {
            Some(order) => super::reorder::reordered(model, order, &self.head().file),
            None => Ok(model),
        }
    }

    /// Returns the number of bits of each stream. Bits of tables and other parameters are not counted.
    ///
    /// # Errors
    /// As [`Self::unpack`].
    pub fn stream_bits(&self) -> Result<Vec<StreamBits>> {
        let (_, bits) = self.decode_with(&self.decoder()?, self.data(), true)?;
        Ok(bits.named())
    }

    /// Returns the dictionary alone.
    ///
    /// # Errors
    /// As [`Self::unpack`].
    pub fn unpack_dictionary(&self) -> Result<Dictionary> {
        Ok(self.decoder()?.dictionary().clone())
    }

    /// Returns the memory that the limits leave for the codes. `self` and the geometry of the decoded scene are subtracted.
    fn budget(&self) -> Result<MemoryBudget<'_>> {
        let head = self.head();
        let words = self.order().map_or(0, <[u32]>::len);
        let extras = self.extras().iter().map(|e| e.values.width()).sum::<usize>();
        let n = self.len();
        let sizes = [(words, size_of::<u32>()), (head.bytes.len(), 1), (self.data().len(), 1), (n, extras)];
        let own = sizes.iter().map(|&(count, each)| (count as u64).saturating_mul(each as u64));
        let budget = MemoryBudget::new(&head.limits, &head.file, own.fold(0, u64::saturating_add));
        for (count, each) in sizes {
            budget.take(count, each)?;
        }
        budget.take(n, GEOMETRY_BYTES + COUNT_BYTES + extras)?;
        Ok(budget)
    }

    /// Decodes the first of two layers as it is drawn while the second is missing, with its scales grown and no other
    /// interim change. Its Gaussians are the first ones of the file. `None` if there is one layer.
    ///
    /// # Errors
    /// As [`Self::unpack`].
    pub fn first_layer(&self) -> Result<Option<Model>> {
        let Some(end) = self.decoder()?.index().first_layer_end() else { return Ok(None) };
        let data = usize::try_from(end).ok().and_then(|end| self.data().get(..end)).unwrap_or_default();
        let (there, whole) = (data.len() as u64, self.data().len() as u64);
        let decoder = Decoder::of_prefix(self.head(), there, whole)?.growing_only();
        Ok(Some(self.decode_with(&decoder, data, false)?.0))
    }

    fn decode_with(&self, decoder: &Decoder, data: &[u8], count_bits: bool) -> Result<(Model, BitCounts)> {
        let head = self.head();
        let mut bit_counts = decoder.dictionary_bits().clone();
        let n = decoder.spans().last().map_or(0, |span| span.end);
        let budget = self.budget()?;
        let extras = if n == self.len() { self.extras().to_vec() } else { Vec::new() };
        let mut g = Geometry { extras, ..Geometry::zeros(n) };
        let mut counts = vec![0; n];
        // Chunks are decoded into their parts of the scene, so that a scene is in memory once.
        let spans = decoder.spans();
        let work: Vec<_> =
            chunk_outputs(&mut g, &mut counts, spans).into_iter().zip(spans).enumerate().collect();
        let pieces = map_vec(work, |(c, (mut output, span))| {
            decoder.piece(Data::First(data), c, span.start, &mut output, &budget, count_bits)
        });
        let (mut atoms, mut values) = (Vec::new(), Vec::new());
        let mut escapes = Escapes::default();
        for piece in pieces {
            let piece = piece?;
            bit_counts.add(&piece.bit_counts);
            atoms.extend(piece.atoms);
            values.extend(piece.values);
            escapes.gaussians.extend(piece.escapes.gaussians);
            escapes.rows.extend(piece.escapes.rows);
        }
        let dictionary = decoder.dictionary().clone();
        let indices = indices(&dictionary, atoms);
        let codes = SparseCodes::new(&dictionary, counts, indices, Values::F16(values), escapes)
            .map_err(|e| Error::malformed(&head.file, e.to_string()))?;
        Ok((Model::new(g, head.meta.clone(), dictionary, codes, head.record.clone())?, bit_counts))
    }
}
