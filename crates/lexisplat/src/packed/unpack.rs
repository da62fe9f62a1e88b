//! From a packed file's parts to a scene.

use serde::{Deserialize, Serialize};

use super::CHUNK;
use super::chunks::{Decoder, Spent, indices, places, zeros};
use crate::codes::{Escapes, SparseCodes, Values};
use crate::dictionary::Dictionary;
use crate::error::Result;
use crate::limits::Limits;
use crate::model::{Layout, Model, Record};
use crate::parallel::map_vec;
use crate::room::{COUNT_BYTES, GEOMETRY_BYTES, Room};
use crate::sh::ShDegree;
use crate::splats::{Extra, Geometry, SceneMeta};

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
    pub promise: Option<Promise>,
    /// The GPU that looked at the scene and judged; `None` if the CPU renderer did, whose results are the same
    /// everywhere.
    pub drawn_on: Option<String>,
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
pub struct Promise {
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

impl Promise {
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
            Some(order) => super::restore::restored(model, order),
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

    /// Room for the scene beside `self`, of which its geometry is taken.
    fn room<'a>(&self, file: &'a str) -> Result<Room<'a>> {
        let words = self.parameters.len() + self.lengths.len() + self.order.as_ref().map_or(0, Vec::len);
        let extras = self.extras.iter().map(|e| e.values.width()).sum::<usize>();
        let n = self.gaussians;
        let sizes = [(words, size_of::<u32>()), (self.tables.len(), 1), (self.data.len(), 1), (n, extras)];
        let own = sizes.iter().map(|&(count, each)| (count as u64).saturating_mul(each as u64));
        let room = Room::new(&self.limits, file, own.fold(0, u64::saturating_add));
        for (count, each) in sizes {
            room.take(count, each)?;
        }
        room.take(n, GEOMETRY_BYTES + COUNT_BYTES + extras)?;
        Ok(room)
    }

    fn decode(&self, file: &str, count_bits: bool) -> Result<(Model, Spent)> {
        let decoder = Decoder::new(self, file, &self.data)?;
        let mut spent = decoder.dictionary_bits();
        let n = self.gaussians;
        let room = self.room(file)?;
        let mut g = Geometry { extras: self.extras.clone(), ..zeros(n) };
        let mut counts = vec![0; n];
        // Chunks write straight to where they belong, so that a scene is in memory once.
        let work = places(&mut g, &mut counts).enumerate().collect();
        let pieces = map_vec(work, |(c, place)| decoder.piece(c, c * CHUNK, place, &room, count_bits));
        let (mut atoms, mut values) = (Vec::new(), Vec::new());
        let mut escapes = Escapes::default();
        for piece in pieces {
            let piece = piece?;
            spent.add(&piece.spent);
            atoms.extend(piece.atoms);
            values.extend(piece.values);
            escapes.gaussians.extend(piece.escaped);
            escapes.rows.extend(piece.rows);
        }
        let dictionary = decoder.dictionary;
        let indices = indices(&dictionary, atoms);
        let codes = SparseCodes::new(&dictionary, counts, indices, Values::F16(values), escapes)?;
        let record = Record { layout: Layout::Packed, ..self.record.clone() };
        Ok((Model { geometry: g, meta: self.meta.clone(), dictionary, codes, record }, spent))
    }
}
