//! From a packed file's parts to a scene.

use half::f16;
use serde::{Deserialize, Serialize};

use super::CHUNK;
use super::bits::{unzigzag, zigzag};
use super::entropy::Tables;
use super::parameters::Parameters;
use super::stream::{Player, Stream, Symbols};
use super::walk::Walk;
use crate::codes::{Escapes, Indices, SparseCodes, Values};
use crate::dictionary::Dictionary;
use crate::error::{Error, Result};
use crate::limits::{Limits, MAX_ATOMS};
use crate::maths::Vec3;
use crate::model::{Layout, Model, Record};
use crate::parallel::map_vec;
use crate::room::{COUNT_BYTES, GEOMETRY_BYTES, Room};
use crate::sh::ShDegree;
use crate::splats::{Extra, Geometry, SceneMeta};

/// Steps of atoms' coefficients are 2^-k for k up to this.
pub(super) const MAX_ATOM_BITS: u32 = 14;

/// Gaussians of a chunk after which is asked whether there are bits and room left.
const LOOK_AFTER: usize = 256;
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

/// A part that no encoder writes so.
fn bad(what: &str) -> Error {
    Error::parameter("packed", what, "what the encoder writes")
}

/// Where a chunk's geometry goes.
struct Place<'a> {
    positions: &'a mut [Vec3],
    dc: &'a mut [Vec3],
    opacities: &'a mut [f32],
    scales: &'a mut [Vec3],
    rotations: &'a mut [[f32; 4]],
    /// Nonzeros of each Gaussian.
    counts: &'a mut [u8],
}

/// The rest of a chunk: what is not of one length for every Gaussian.
#[derive(Default)]
struct Piece {
    atoms: Vec<u16>,
    values: Vec<f16>,
    escaped: Vec<u32>,
    rows: Vec<f32>,
    spent: Spent,
}

/// Why a chunk is not decoded.
enum Refusal {
    /// No encoder writes it so.
    Damage,
    /// Its codes do not fit in what may be held.
    Room,
    /// A Gaussian of it, counted from its start, has this many nonzeros.
    Nonzeros(usize, u64),
}

impl From<std::num::TryFromIntError> for Refusal {
    fn from(_: std::num::TryFromIntError) -> Self {
        Self::Damage
    }
}

impl Packed {
    /// The scene, its SH as sparse codes; in the order of its source if that was kept.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the part that is not as it should be, [`Error::Limit`] if there is more than
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

/// The Geometry of `n` Gaussians, to be filled.
fn zeros(n: usize) -> Geometry {
    Geometry {
        positions: vec![[0.0; 3]; n],
        normals: Vec::new(),
        dc: vec![[0.0; 3]; n],
        opacities: vec![0.0; n],
        scales: vec![[0.0; 3]; n],
        rotations: vec![[0.0; 4]; n],
        extras: Vec::new(),
    }
}

/// The places of all chunks.
fn places<'a>(g: &'a mut Geometry, counts: &'a mut [u8]) -> impl Iterator<Item = Place<'a>> {
    g.positions
        .chunks_mut(CHUNK)
        .zip(g.dc.chunks_mut(CHUNK))
        .zip(g.opacities.chunks_mut(CHUNK))
        .zip(g.scales.chunks_mut(CHUNK))
        .zip(g.rotations.chunks_mut(CHUNK))
        .zip(counts.chunks_mut(CHUNK))
        .map(|(((((positions, dc), opacities), scales), rotations), counts)| Place {
            positions,
            dc,
            opacities,
            scales,
            rotations,
            counts,
        })
}

fn indices(dictionary: &Dictionary, atoms: Vec<u16>) -> Indices {
    if dictionary.len() <= 256 {
        Indices::U8(atoms.into_iter().map(|a| a.to_le_bytes()[0]).collect())
    } else {
        Indices::U16(atoms)
    }
}

/// Bits each stream took.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Spent(pub(super) [f64; Stream::ALL.len()]);

impl Spent {
    pub(crate) fn add(&mut self, more: &Self) {
        for (a, b) in self.0.iter_mut().zip(more.0) {
            *a += b;
        }
    }

    /// With the streams' names.
    pub(crate) fn named(&self) -> Vec<StreamBits> {
        let stream = |(stream, bits): (Stream, f64)| StreamBits {
            name: format!("{stream:?}"),
            attribute: stream.attribute(),
            bits,
        };
        Stream::ALL.into_iter().zip(self.0).map(stream).collect()
    }
}

/// What all chunks of a packed scene are decoded with, and where they are.
#[derive(Debug)]
pub(crate) struct Decoder<'a> {
    /// Its name in errors about limits.
    file: &'a str,
    limits: Limits,
    pub(crate) dictionary: Dictionary,
    dictionary_bits: Spent,
    parameters: Parameters,
    tables: Tables,
    /// The pieces of the data: two for the dictionary and two for each chunk.
    parts: Vec<&'a [u8]>,
    gaussians: usize,
}

impl<'a> Decoder<'a> {
    /// Of `packed`, whose own data may be left out, and its `data`; errors about limits call it `file`.
    pub(crate) fn new(packed: &Packed, file: &'a str, data: &'a [u8]) -> Result<Self> {
        let limits = packed.limits;
        limits.check_gaussians(file, packed.gaussians as u64)?;
        limits.check_atoms(file, packed.atoms as u64)?;
        let parameters = Parameters::from_list(&packed.parameters).ok_or_else(|| bad("parameters"))?;
        let tables = Tables::read(&packed.tables, Stream::ALL.len()).ok_or_else(|| bad("tables"))?;
        let gaussians = packed.gaussians;
        let parts = parts(gaussians, &packed.lengths, data)?;
        let (dictionary, dictionary_bits) =
            dictionary(packed, &tables, parts[0], parts[1]).ok_or_else(|| bad("dictionary"))?;
        Ok(Self { file, limits, dictionary, dictionary_bits, parameters, tables, parts, gaussians })
    }

    /// Bits the dictionary took.
    pub(crate) fn dictionary_bits(&self) -> Spent {
        self.dictionary_bits
    }

    /// Chunk `c` alone, without extras, its escapes numbered from its start; and if
    /// `count_bits` what it took. In `room` there is room for all but its codes.
    pub(crate) fn chunk(
        &self,
        c: usize,
        room: &Room<'_>,
        count_bits: bool,
    ) -> Result<(Geometry, SparseCodes, Spent)> {
        let first = c * CHUNK;
        let n = self.gaussians.saturating_sub(first).min(CHUNK);
        let (mut g, mut counts) = (zeros(n), vec![0; n]);
        let place = places(&mut g, &mut counts).next().ok_or_else(|| bad(&format!("chunk {c}")))?;
        let piece = self.piece(c, 0, place, room, count_bits)?;
        let escapes = Escapes { gaussians: piece.escaped, rows: piece.rows };
        let (indices, values) = (indices(&self.dictionary, piece.atoms), Values::F16(piece.values));
        let codes = SparseCodes::part(&self.dictionary, first, counts, indices, values, escapes)?;
        Ok((g, codes, piece.spent))
    }

    /// Decodes chunk `c` to `place`; its first Gaussian is called number `first`.
    fn piece(
        &self,
        c: usize,
        first: usize,
        place: Place<'_>,
        room: &Room<'_>,
        count_bits: bool,
    ) -> Result<Piece> {
        let parts = (self.parts.get(2 * c + 2).copied()).zip(self.parts.get(2 * c + 3).copied());
        let player = parts.and_then(|(symbols, raw)| Player::new(&self.tables, symbols, raw));
        let mut player = player.ok_or_else(|| bad(&format!("chunk {c}")))?;
        player.spent = count_bits.then_some([0.0; Stream::ALL.len()]);
        self.play(player, first, place, room).map_err(|refusal| match refusal {
            Refusal::Damage => bad(&format!("chunk {c}")),
            Refusal::Room => room.full(),
            Refusal::Nonzeros(i, found) => {
                let over = self.limits.check_nonzeros(self.file, c * CHUNK + i, found);
                over.err().unwrap_or_else(|| bad(&format!("chunk {c}")))
            }
        })
    }

    /// Decodes the chunk of `player`, whose first Gaussian is number `first`.
    fn play(
        &self,
        mut player: Player<'_>,
        first: usize,
        place: Place<'_>,
        room: &Room<'_>,
    ) -> std::result::Result<Piece, Refusal> {
        let (parameters, dictionary) = (&self.parameters, &self.dictionary);
        let mut piece = Piece::default();
        let mut walk = Walk::new(parameters, dictionary.dim());
        let mut code = Vec::with_capacity(dictionary.dim());
        let width = indices(dictionary, Vec::new()).width() + size_of::<f16>();
        let row = size_of::<u32>() + dictionary.dim() * size_of::<f32>();
        let (mut nonzeros, mut rows) = (0, 0);
        for i in 0..place.counts.len() {
            let decoded = walk.step(&mut player, None).ok_or(Refusal::Damage)?;
            place.positions[i] = decoded.position;
            place.dc[i] = decoded.dc;
            place.opacities[i] = decoded.opacity;
            place.scales[i] = decoded.scales;
            place.rotations[i] = decoded.rotation;
            if !walk.exact.is_empty() {
                rows += 1;
                piece.escaped.push(u32::try_from(first + i)?);
                piece.rows.extend_from_slice(&walk.exact);
            }
            resident(&walk.code, parameters.value_step(decoded.colour_class), &mut code);
            place.counts[i] = u8::try_from(code.len())?;
            if code.len() as u64 > self.limits.nonzeros {
                return Err(Refusal::Nonzeros(i, code.len() as u64));
            }
            nonzeros += code.len();
            for &(atom, value) in &code {
                if usize::from(atom) >= dictionary.len() || !value.is_finite() {
                    return Err(Refusal::Damage);
                }
                piece.atoms.push(atom);
                piece.values.push(value);
            }
            // A damaged file could ask for more than it holds, or than may be held.
            if i % LOOK_AFTER == LOOK_AFTER - 1 || i + 1 == place.counts.len() {
                if player.overrun() {
                    return Err(Refusal::Damage);
                }
                if !(room.grow(nonzeros, width) && room.grow(rows, row)) {
                    return Err(Refusal::Room);
                }
                (nonzeros, rows) = (0, 0);
            }
        }
        if !player.exhausted() {
            return Err(Refusal::Damage);
        }
        piece.spent = Spent(player.spent.unwrap_or_default());
        Ok(piece)
    }
}

/// The pieces of `data`: two for the dictionary and two for each chunk.
fn parts<'a>(gaussians: usize, lengths: &[u32], data: &'a [u8]) -> Result<Vec<&'a [u8]>> {
    let chunks = gaussians.div_ceil(CHUNK);
    let total: u64 = lengths.iter().map(|&l| u64::from(l)).sum();
    if lengths.len() != 2 * (chunks + 1) || total != data.len() as u64 {
        return Err(bad("lengths"));
    }
    let mut parts = Vec::with_capacity(lengths.len());
    let mut rest = data;
    for &length in lengths {
        let (part, tail) = rest.split_at_checked(length as usize).ok_or_else(|| bad("lengths"))?;
        parts.push(part);
        rest = tail;
    }
    Ok(parts)
}

fn dictionary(packed: &Packed, tables: &Tables, symbols: &[u8], raw: &[u8]) -> Option<(Dictionary, Spent)> {
    let dim = packed.degree.rest();
    if dim == 0 {
        return (packed.atoms == 0 && symbols.is_empty() && raw.is_empty())
            .then(|| (Dictionary::empty(), Spent::default()));
    }
    if !(1..=MAX_ATOMS).contains(&packed.atoms) || packed.atom_bits > MAX_ATOM_BITS {
        return None;
    }
    let mut player = Player::new(tables, symbols, raw)?;
    player.spent = Some([0.0; Stream::ALL.len()]);
    let rows = dictionary_walk(&mut player, packed.degree, packed.atoms, packed.atom_bits, None);
    if !player.exhausted() {
        return None;
    }
    Some((Dictionary::new(packed.degree, rows).ok()?, Spent(player.spent.unwrap_or_default())))
}

/// Codes the coefficients of all atoms; returns unit-norm atoms as the decoder sees them. `target` holds
/// the encoder's.
pub(super) fn dictionary_walk<S: Symbols>(
    s: &mut S,
    degree: ShDegree,
    atoms: usize,
    bits: u32,
    target: Option<&[f32]>,
) -> Vec<f32> {
    let (dim, per_channel) = (degree.rest(), degree.rest_per_channel());
    let steps = f64::from(1_u32 << bits);
    let mut rows = Vec::with_capacity(atoms * dim);
    for j in 0..atoms {
        let mut row = Vec::with_capacity(dim);
        for d in 0..dim {
            // Coefficients of one degree are alike, whatever the channel.
            let context = (d % per_channel + 1).isqrt() - 1;
            let coded = s.integer(Stream::Dictionary, context, || {
                #[expect(clippy::cast_possible_truncation, reason = "unit-norm atoms in at most 2^14 steps")]
                let whole = target.map_or(0, |t| (f64::from(t[j * dim + d]) * steps).round() as i64);
                zigzag(whole)
            });
            #[expect(clippy::cast_precision_loss, reason = "small, or the norm check refuses it")]
            row.push(unzigzag(coded) as f64 / steps);
        }
        let norm = row.iter().map(|x| x * x).sum::<f64>().sqrt();
        // An atom of zeros cannot be used; the first axis stands in so that the rest can be read.
        if norm == 0.0 {
            row[0] = 1.0;
        }
        let norm = if norm == 0.0 { 1.0 } else { norm };
        #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
        rows.extend(row.iter().map(|x| (x / norm) as f32));
    }
    rows
}

/// A code as it is kept in memory: by ascending atom, values in f16.
pub(super) fn resident(code: &[(u16, i32)], step: f32, out: &mut Vec<(u16, f16)>) {
    out.clear();
    #[expect(clippy::cast_precision_loss, reason = "f16 keeps less")]
    out.extend(code.iter().map(|&(atom, value)| (atom, f16::from_f32(value as f32 * step))));
    out.sort_by_key(|p| p.0);
}
