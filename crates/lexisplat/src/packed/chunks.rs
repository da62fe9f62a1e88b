//! A packed scene's chunks, each decoded apart from all others.

use half::f16;

use super::CHUNK;
use super::bits::{unzigzag, zigzag};
use super::chunk_codec::ChunkCodec;
use super::entropy::Tables;
use super::parameters::Parameters;
use super::stream::{Stream, SymbolDecoder, Symbols};
use super::unpack::{Packed, StreamBits};
use crate::scene::sh::ShDegree;
use crate::scene::splats::Geometry;
use crate::sparse::codes::{Escapes, Indices, SparseCodes, Values};
use crate::sparse::dictionary::Dictionary;
use crate::support::error::{Error, Result};
use crate::support::limits::{Limits, MAX_ATOMS};
use crate::support::maths::Vec3;
use crate::support::memory_budget::MemoryBudget;

/// Steps of atoms' coefficients are 2^-k for k up to this.
pub(super) const MAX_ATOM_BITS: u32 = 14;
/// Gaussians of a chunk after which is asked whether there are bits and room left.
const LOOK_AFTER: usize = 256;

/// A part that no encoder writes so.
fn bad(what: &str) -> Error {
    Error::parameter("packed", what, "what the encoder writes")
}

/// Where a chunk's geometry goes.
pub(super) struct Place<'a> {
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
pub(super) struct Piece {
    pub(super) atoms: Vec<u16>,
    pub(super) values: Vec<f16>,
    pub(super) escaped: Vec<u32>,
    pub(super) rows: Vec<f32>,
    pub(super) bit_counts: BitCounts,
}

/// Why a chunk is not decoded.
enum Refusal {
    /// No encoder writes it so.
    Damage,
    /// Its codes do not fit in what may be held.
    MemoryBudget,
    /// A Gaussian of it, counted from its start, has this many nonzeros.
    Nonzeros(usize, u64),
}

impl From<std::num::TryFromIntError> for Refusal {
    fn from(_: std::num::TryFromIntError) -> Self {
        Self::Damage
    }
}

/// The Geometry of `n` Gaussians, to be filled.
pub(super) fn zeros(n: usize) -> Geometry {
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
pub(super) fn places<'a>(g: &'a mut Geometry, counts: &'a mut [u8]) -> impl Iterator<Item = Place<'a>> {
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

pub(super) fn indices(dictionary: &Dictionary, atoms: Vec<u16>) -> Indices {
    if dictionary.len() <= 256 {
        Indices::U8(atoms.into_iter().map(|a| a.to_le_bytes()[0]).collect())
    } else {
        Indices::U16(atoms)
    }
}

/// Bits each stream took.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct BitCounts(pub(super) [f64; Stream::ALL.len()]);

impl BitCounts {
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
    dictionary_bits: BitCounts,
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
    pub(crate) fn dictionary_bits(&self) -> BitCounts {
        self.dictionary_bits
    }

    /// Chunk `c` alone, without extras, its escapes numbered from its start; and if
    /// `count_bits` what it took. In `room` there is room for all but its codes.
    pub(crate) fn chunk(
        &self,
        c: usize,
        budget: &MemoryBudget<'_>,
        count_bits: bool,
    ) -> Result<(Geometry, SparseCodes, BitCounts)> {
        let first = c * CHUNK;
        let n = self.gaussians.saturating_sub(first).min(CHUNK);
        let (mut g, mut counts) = (zeros(n), vec![0; n]);
        let place = places(&mut g, &mut counts).next().ok_or_else(|| bad(&format!("chunk {c}")))?;
        let piece = self.piece(c, 0, place, budget, count_bits)?;
        let escapes = Escapes { gaussians: piece.escaped, rows: piece.rows };
        let (indices, values) = (indices(&self.dictionary, piece.atoms), Values::F16(piece.values));
        let codes = SparseCodes::part(&self.dictionary, first, counts, indices, values, escapes)?;
        Ok((g, codes, piece.bit_counts))
    }

    /// Decodes chunk `c` to `place`; its first Gaussian is called number `first`.
    pub(super) fn piece(
        &self,
        c: usize,
        first: usize,
        place: Place<'_>,
        budget: &MemoryBudget<'_>,
        count_bits: bool,
    ) -> Result<Piece> {
        let parts = (self.parts.get(2 * c + 2).copied()).zip(self.parts.get(2 * c + 3).copied());
        let player = parts.and_then(|(symbols, raw)| SymbolDecoder::new(&self.tables, symbols, raw));
        let mut player = player.ok_or_else(|| bad(&format!("chunk {c}")))?;
        player.bit_counts = count_bits.then_some([0.0; Stream::ALL.len()]);
        self.play(player, first, place, budget).map_err(|refusal| match refusal {
            Refusal::Damage => bad(&format!("chunk {c}")),
            Refusal::MemoryBudget => budget.full(),
            Refusal::Nonzeros(i, found) => {
                let over = self.limits.check_nonzeros(self.file, c * CHUNK + i, found);
                over.err().unwrap_or_else(|| bad(&format!("chunk {c}")))
            }
        })
    }

    /// Decodes the chunk of `player`, whose first Gaussian is number `first`.
    fn play(
        &self,
        mut player: SymbolDecoder<'_>,
        first: usize,
        place: Place<'_>,
        budget: &MemoryBudget<'_>,
    ) -> std::result::Result<Piece, Refusal> {
        let (parameters, dictionary) = (&self.parameters, &self.dictionary);
        let mut piece = Piece::default();
        let mut walk = ChunkCodec::new(parameters, dictionary.dim());
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
                if !(budget.grow(nonzeros, width) && budget.grow(rows, row)) {
                    return Err(Refusal::MemoryBudget);
                }
                (nonzeros, rows) = (0, 0);
            }
        }
        if !player.exhausted() {
            return Err(Refusal::Damage);
        }
        piece.bit_counts = BitCounts(player.bit_counts.unwrap_or_default());
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

fn dictionary(
    packed: &Packed,
    tables: &Tables,
    symbols: &[u8],
    raw: &[u8],
) -> Option<(Dictionary, BitCounts)> {
    let dim = packed.degree.rest();
    if dim == 0 {
        return (packed.atoms == 0 && symbols.is_empty() && raw.is_empty())
            .then(|| (Dictionary::empty(), BitCounts::default()));
    }
    if !(1..=MAX_ATOMS).contains(&packed.atoms) || packed.atom_bits > MAX_ATOM_BITS {
        return None;
    }
    let mut player = SymbolDecoder::new(tables, symbols, raw)?;
    player.bit_counts = Some([0.0; Stream::ALL.len()]);
    let rows = code_dictionary(&mut player, packed.degree, packed.atoms, packed.atom_bits, None);
    if !player.exhausted() {
        return None;
    }
    Some((Dictionary::new(packed.degree, rows).ok()?, BitCounts(player.bit_counts.unwrap_or_default())))
}

/// Codes the coefficients of all atoms; returns unit-norm atoms as the decoder sees them. `target` holds
/// the encoder's.
pub(super) fn code_dictionary<S: Symbols>(
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
