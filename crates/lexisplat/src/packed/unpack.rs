//! From a packed file's parts to a scene.

use serde::{Deserialize, Serialize};

use super::CHUNK;
use super::chunks::{BitCounts, Decoder, indices, places, zeros};
use crate::scene::sh::ShDegree;
use crate::scene::splats::{Extra, Geometry, SceneMeta};
use crate::sparse::codes::{Escapes, SparseCodes, Values};
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::{Layout, Model, Record};
use crate::support::error::Result;
use crate::support::limits::Limits;
use crate::support::memory_budget::{COUNT_BYTES, GEOMETRY_BYTES, MemoryBudget};
use crate::support::parallel::map_vec;

/// A packed scene whose file is not known, in errors.
const UNNAMED: &str = "the packed scene";

/// A packed scene as it lies in a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Packed {
    /// SH degree.
    pub degree: ShDegree,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Number of atoms; 0 for degree 0.
    pub atoms: usize,
    /// Atoms' coefficients are multiples of 2 to the power of minus this.
    pub atom_bits: u32,
    /// How it was made and what it promises.
    pub record: Record,
    /// Comments and marks of the source.
    pub meta: SceneMeta,
    /// Properties 3DGS does not define, in the packed order.
    pub extras: Vec<Extra>,
    /// For each Gaussian its index in the source, if that was to be kept.
    pub order: Option<Vec<u32>>,
    /// What was aimed at and reached, if something was.
    pub target: Option<TargetRecord>,
    /// The GPU that looked at the scene and judged; `None` if the CPU renderer did, whose results are the same
    /// everywhere.
    pub device: Option<String>,
    /// Steps and predictors.
    pub parameters: Vec<f32>,
    /// Probabilities of all symbols.
    pub tables: Vec<u8>,
    /// Bytes of each part in `data`: modelled symbols and raw bits, of the dictionary first and then of each
    /// chunk of [`CHUNK`] Gaussians.
    pub lengths: Vec<u32>,
    /// All parts.
    pub data: Vec<u8>,
    /// What may be made of it: the limits of whoever read it; the default ones of a scene that was packed here.
    pub limits: Limits,
}

/// What a search for a quality or a size aimed at and reached.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct TargetRecord {
    /// `psnr`, `min-psnr` or `size`.
    pub target: String,
    /// Decibels or bytes asked for.
    pub asked: f64,
    /// Mean PSNR over the views searched with, in decibels.
    pub mean_psnr: f64,
    /// PSNR of the worst of them.
    pub min_psnr: f64,
    /// Number of views.
    pub views: u32,
    /// Whether they were given; else they were generated.
    pub cameras: bool,
}

impl TargetRecord {
    /// A promise of all its parts.
    #[must_use]
    pub fn new(target: &str, asked: f64, reached: [f64; 2], views: u32, cameras: bool) -> Self {
        let [mean_psnr, min_psnr] = reached;
        Self { target: target.to_owned(), asked, mean_psnr, min_psnr, views, cameras }
    }
}

/// What one stream takes.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct StreamBits {
    /// The stream's name.
    pub name: String,
    /// The attribute it belongs to.
    pub attribute: &'static str,
    /// Bits in all.
    pub bits: f64,
}

impl Packed {
    /// The scene, its SH as sparse codes; in the order of its source if that was kept.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] naming the part that is not as it should be, [`crate::Error::Limit`] if there is more than
    /// [`Self::limits`] allow.
    pub fn unpack(&self) -> Result<Model> {
        self.unpack_from(UNNAMED)
    }

    /// [`Self::unpack`]; errors about limits call it `file`.
    pub(crate) fn unpack_from(&self, file: &str) -> Result<Model> {
        let model = self.decode(file, false)?.0;
        model.geometry.validate()?;
        match &self.order {
            Some(order) => super::reorder::reordered(model, order),
            None => Ok(model),
        }
    }

    /// Bits each stream takes, tables and parameters apart.
    ///
    /// # Errors
    /// As [`Self::unpack`].
    pub fn stream_bits(&self) -> Result<Vec<StreamBits>> {
        Ok(self.decode(UNNAMED, true)?.1.named())
    }

    /// The dictionary alone.
    ///
    /// # Errors
    /// As [`Self::unpack`].
    pub fn unpack_dictionary(&self) -> Result<Dictionary> {
        Ok(Decoder::new(self, UNNAMED, &self.data)?.dictionary)
    }

    /// The memory budget for the scene beside `self`, of which its geometry is taken.
    fn budget<'a>(&self, file: &'a str) -> Result<MemoryBudget<'a>> {
        let words = self.parameters.len() + self.lengths.len() + self.order.as_ref().map_or(0, Vec::len);
        let extras = self.extras.iter().map(|e| e.values.width()).sum::<usize>();
        let n = self.gaussians;
        let sizes = [(words, size_of::<u32>()), (self.tables.len(), 1), (self.data.len(), 1), (n, extras)];
        let own = sizes.iter().map(|&(count, each)| (count as u64).saturating_mul(each as u64));
        let budget = MemoryBudget::new(&self.limits, file, own.fold(0, u64::saturating_add));
        for (count, each) in sizes {
            budget.take(count, each)?;
        }
        budget.take(n, GEOMETRY_BYTES + COUNT_BYTES + extras)?;
        Ok(budget)
    }

    fn decode(&self, file: &str, count_bits: bool) -> Result<(Model, BitCounts)> {
        let decoder = Decoder::new(self, file, &self.data)?;
        let mut bit_counts = decoder.dictionary_bits();
        let n = self.gaussians;
        let budget = self.budget(file)?;
        let mut g = Geometry { extras: self.extras.clone(), ..zeros(n) };
        let mut counts = vec![0; n];
        // Chunks write straight to where they belong, so that a scene is in memory once.
        let work = places(&mut g, &mut counts).enumerate().collect();
        let pieces = map_vec(work, |(c, place)| decoder.piece(c, c * CHUNK, place, &budget, count_bits));
        let (mut atoms, mut values) = (Vec::new(), Vec::new());
        let mut escapes = Escapes::default();
        for piece in pieces {
            let piece = piece?;
            bit_counts.add(&piece.bit_counts);
            atoms.extend(piece.atoms);
            values.extend(piece.values);
            escapes.gaussians.extend(piece.escaped);
            escapes.rows.extend(piece.rows);
        }
        let dictionary = decoder.dictionary;
        let indices = indices(&dictionary, atoms);
        let codes = SparseCodes::new(&dictionary, counts, indices, Values::F16(values), escapes)?;
        let record = Record { layout: Layout::Packed, ..self.record.clone() };
        Ok((Model { geometry: g, meta: self.meta.clone(), dictionary, codes, record }, bit_counts))
    }
}
