//! Coding of a chunk: its ranges are a base, refinements, SH parts and interim changes, all in the same lanes.

use super::coarseness::Refinements;
use super::geometry_syntax::{GeometrySyntax, Group};
use super::integer_model::Steering;
use super::interim::interim;
use super::parameters::CHANGES;
use super::refinement::refine;
use super::sh_codes::{BLOCK, Coded, Cursor, Rest, RestForm};
use crate::packed::bitstream::broken::Broken;
use crate::packed::bitstream::coded_gaussian::CodedGaussian;
use crate::packed::bitstream::drawn::{Drawn, Frame};
use crate::packed::bitstream::stream::BitCounts;
use crate::packed::entropy::lanes::{LANES, Lanes, has};
use crate::packed::entropy::rans_decoder::SymbolDecoder;
use crate::packed::entropy::rans_encoder::SymbolRecorder;
use crate::packed::entropy::tables::Lookup;
use crate::support::crc32;

/// Least number of Gaussians of a lane. A lane takes about 8 bytes of every range.
const LEAST_OF_LANE: usize = 1024;

/// Returns the number of lanes of a chunk.
pub(in crate::packed) fn lanes(gaussians: usize) -> usize {
    (gaussians / LEAST_OF_LANE).clamp(1, LANES)
}

/// Returns the index of the first Gaussian of each lane of a chunk, followed by the number of Gaussians. If the number does
/// not divide by `lanes`, the first lanes have one Gaussian more than the others.
pub(in crate::packed) fn starts(gaussians: usize, lanes: usize) -> [usize; LANES + 1] {
    std::array::from_fn(|l| {
        let l = l.min(lanes);
        gaussians / lanes * l + (gaussians % lanes).min(l)
    })
}

/// Returns for each step of a chunk the set of lanes that still have a Gaussian.
pub(in crate::packed) fn sets(gaussians: usize, lanes: usize) -> impl Iterator<Item = u32> {
    let whole = (1 << lanes) - 1;
    let last = (1 << (gaussians % lanes)) - 1;
    std::iter::repeat_n(whole, gaussians / lanes).chain((last > 0).then_some(last))
}

/// A receiver of the decoded Gaussians of a chunk. It is a trait, since closures are not inlined into vector code.
pub(in crate::packed) trait Sink {
    /// Takes Gaussian `number` of each lane in `set`. It has the index `in_block` in its block. Returns the rule that a
    /// damaged file breaks.
    fn group(
        &mut self,
        number: usize,
        in_block: usize,
        set: u32,
        group: &Group,
        refinements: Refinements,
    ) -> Result<(), Broken>;

    /// Takes the SH-rest of a block of Gaussians. The block begins with Gaussian `number` of each lane.
    fn rest(&mut self, number: usize, rest: &Rest) -> Result<(), Broken>;
}

/// The parameters with which the chunks of a file are coded.
#[derive(Debug, Clone)]
pub(in crate::packed) struct Form {
    pub(in crate::packed) steering: Steering,
    pub(in crate::packed) rest: RestForm,
}

/// The kinds of ranges that the chunks of a layer have.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(in crate::packed) struct LayerForm {
    /// Number of refinements.
    pub(in crate::packed) refinements: usize,
    /// Number of SH parts.
    pub(in crate::packed) sh_parts: usize,
    /// Whether chunks have a range of interim changes.
    pub(in crate::packed) interim: bool,
}

impl LayerForm {
    /// Returns the number of ranges of a chunk: a base, refinements, SH parts, and interim changes.
    pub(in crate::packed) fn ranges(self) -> usize {
        self.interim_range() + usize::from(self.interim)
    }

    /// Returns the index of the range of interim changes, if chunks have one.
    pub(in crate::packed) fn interim_range(self) -> usize {
        1 + self.refinements + self.sh_parts
    }
}

impl Form {
    /// Records the symbols of the Gaussians of a chunk of a layer. `None` for values that no decoder accepts.
    pub(in crate::packed) fn record(
        &self,
        frame: &Frame,
        layer: LayerForm,
        coded: &[CodedGaussian],
    ) -> Option<CodedChunk> {
        let refinements = layer.refinements;
        let lanes = lanes(coded.len());
        let starts = starts(coded.len(), lanes);
        let mut ranges = vec![SymbolRecorder::default(); layer.ranges()];
        let mut sums = vec![Sums::default(); layer.ranges()];
        let (mut walk, mut rest) = (GeometrySyntax::new(&self.steering, refinements), Rest::default());
        let none = CodedGaussian::default();
        let mut bounds = Extent([[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]]);
        let sets: Vec<u32> = sets(coded.len(), lanes).collect();
        for (block, sets) in sets.chunks(BLOCK).enumerate() {
            let first = block * BLOCK;
            rest.clear();
            let (base, finer) = ranges.split_first_mut()?;
            let (finer, sh_parts) = finer.split_at_mut_checked(refinements)?;
            let (sh_parts, changed) = sh_parts.split_at_mut_checked(layer.sh_parts)?;
            for (i, &set) in sets.iter().enumerate() {
                let of = |l: usize| coded.get(starts[l] + first + i).filter(|_| has(set, l)).unwrap_or(&none);
                let group: [&CodedGaussian; LANES] = std::array::from_fn(of);
                let coded = group;
                let mut group = Group::default();
                walk.base(base, set, Some(&coded), &mut group).ok()?;
                sums[0].base(set, &group);
                for (k, range) in finer.iter_mut().enumerate() {
                    refine(range, set, &mut group, refinements - k).ok()?;
                    sums[1 + k].refined(set, &group);
                }
                if let Some(range) = changed.first_mut() {
                    let wanted: [Lanes; CHANGES] =
                        std::array::from_fn(|k| std::array::from_fn(|l| coded[l].interim[k]));
                    interim(range, set, &mut group, &wanted);
                    sums[layer.interim_range()].interim(set, &group);
                }
                rest.push(set, group.colour);
                bounds.add(set, &group, frame, refinements)?;
            }
            let wanted: Lanes<Vec<&CodedGaussian>> = std::array::from_fn(|l| {
                let there = sets.iter().enumerate().filter(|(_, set)| has(**set, l));
                there.filter_map(|(i, _)| coded.get(starts[l] + first + i)).collect()
            });
            for (sh_part, range) in sh_parts.iter_mut().enumerate() {
                rest.sh_part(range, Some(&wanted), &self.rest, sh_part).ok()?;
                sums[1 + refinements + sh_part].rest(&rest, &self.rest, sh_part);
            }
        }
        let ranges = ranges.into_iter().zip(sums);
        let ranges =
            ranges.map(|(symbols, sums)| RecordedRange { symbols, integers: sums.finish() }).collect();
        let cell = coded.first().map_or(0, |gaussian| gaussian.cell);
        let energy = coded.iter().map(|gaussian| f64::from(gaussian.energy)).sum();
        Some(CodedChunk { gaussians: coded.len(), cell, bounds: bounds.0, energy, ranges })
    }

    /// Decodes a chunk of `gaussians` Gaussians from the ranges that are there, and hands the Gaussians to `sink`.
    /// Refinements after a missing refinement are ignored, and so are SH parts after a missing one. Returns the rule that a
    /// damaged file breaks, and the number of the range that breaks it.
    #[inline(always)]
    pub(in crate::packed) fn decode(
        &self,
        layer: LayerForm,
        gaussians: usize,
        lookup: &Lookup,
        ranges: &[Option<&[u8]>],
        want: Want,
        sink: &mut impl Sink,
    ) -> Result<Played, InRange> {
        let refinements = layer.refinements;
        let lanes = lanes(gaussians);
        let of = |k: usize| ranges.get(k).copied().flatten();
        let decoder = |k: usize| match of(k) {
            Some(bytes) => SymbolDecoder::new(lookup, bytes, lanes, want.bits).map(Some).map_err(in_range(k)),
            None => Ok(None),
        };
        let first_sh = 1 + refinements;
        let mut base = decoder(0)?.ok_or_else(|| in_range(0)(Broken("is missing")))?;
        let all = |kinds: std::ops::Range<usize>| -> Result<Vec<_>, InRange> {
            kinds.map(decoder).map_while(Result::transpose).collect()
        };
        let mut finer: Vec<SymbolDecoder<'_>> = all(1..first_sh)?;
        let mut sh_parts: Vec<SymbolDecoder<'_>> = all(first_sh..first_sh + layer.sh_parts)?;
        let mut changed = if layer.interim { decoder(layer.interim_range())? } else { None };
        let of_chunk = Refinements { all: refinements, missing: refinements - finer.len() };
        let steps = gaussians.div_ceil(lanes);
        let mut sums = vec![Sums::default(); if want.sums { layer.ranges() } else { 0 }];
        let (mut walk, mut rest) = (GeometrySyntax::new(&self.steering, refinements), Rest::default());
        // A group is large, so one is reused for all steps.
        let mut group = Group::default();
        for (step, set) in sets(gaussians, lanes).enumerate() {
            walk.base(&mut base, set, None, &mut group).map_err(in_range(0))?;
            if want.sums {
                sums[0].base(set, &group);
            }
            for (k, range) in finer.iter_mut().enumerate() {
                refine(range, set, &mut group, refinements - k).map_err(in_range(1 + k))?;
                if want.sums {
                    sums[1 + k].refined(set, &group);
                }
            }
            if let Some(range) = &mut changed {
                interim(range, set, &mut group, &[[0; LANES]; CHANGES]);
                if want.sums {
                    sums[layer.interim_range()].interim(set, &group);
                }
            }
            sink.group(step, rest.len(), set, &group, of_chunk).map_err(in_range(0))?;
            rest.push(set, group.colour);
            if rest.len() == BLOCK || step + 1 == steps {
                for (sh_part, range) in sh_parts.iter_mut().enumerate() {
                    rest.sh_part(range, None, &self.rest, sh_part).map_err(in_range(first_sh + sh_part))?;
                    if want.sums {
                        sums[1 + refinements + sh_part].rest(&rest, &self.rest, sh_part);
                    }
                }
                // Symbols of damaged files may take no bytes, so the decoders are checked before anything is made of the
                // symbols.
                for (range, decoder) in numbered(layer, &base, &finer, &sh_parts, &changed) {
                    decoder.check().map_err(in_range(range))?;
                }
                sink.rest(step + 1 - rest.len(), &rest).map_err(in_range(first_sh))?;
                rest.clear();
            }
        }
        let mut bits = BitCounts::default();
        for (range, decoder) in numbered(layer, &base, &finer, &sh_parts, &changed) {
            decoder.check_end().map_err(in_range(range))?;
            decoder.bit_counts.iter().for_each(|counts| bits.add(counts));
        }
        Ok(Played { sums: sums.into_iter().map(Sums::finish).collect(), bits })
    }
}

/// A broken rule, and the number of the range of the chunk that breaks it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::packed) struct InRange {
    pub(in crate::packed) range: usize,
    pub(in crate::packed) broken: Broken,
}

/// Returns a function that names `range` as the one that breaks a rule.
fn in_range(range: usize) -> impl Fn(Broken) -> InRange {
    move |broken| InRange { range, broken }
}

/// Returns the decoders of the ranges of a chunk that are there, each with the number of its range.
fn numbered<'d, 'a>(
    layer: LayerForm,
    base: &'d SymbolDecoder<'a>,
    finer: &'d [SymbolDecoder<'a>],
    sh_parts: &'d [SymbolDecoder<'a>],
    changed: &'d Option<SymbolDecoder<'a>>,
) -> impl Iterator<Item = (usize, &'d SymbolDecoder<'a>)> {
    let sh_parts = (1 + layer.refinements..).zip(sh_parts);
    let changed = changed.iter().map(move |decoder| (layer.interim_range(), decoder));
    std::iter::once((0, base)).chain((1..).zip(finer)).chain(sh_parts).chain(changed)
}

/// A range whose symbols are recorded.
#[derive(Debug, Clone)]
pub(in crate::packed) struct RecordedRange {
    pub(in crate::packed) symbols: SymbolRecorder,
    /// CRC-32 of the integers that the range decodes to.
    pub(in crate::packed) integers: u32,
}

/// A chunk whose symbols are recorded.
#[derive(Debug, Clone)]
pub(in crate::packed) struct CodedChunk {
    pub(in crate::packed) gaussians: usize,
    /// The number of the cell of its first Gaussian.
    pub(in crate::packed) cell: u64,
    /// Least and largest coordinates of the positions of its Gaussians.
    pub(in crate::packed) bounds: [[f32; 3]; 2],
    /// The sum of the energies of its Gaussians: squared changes of pictures without each of them.
    pub(in crate::packed) energy: f64,
    pub(in crate::packed) ranges: Vec<RecordedRange>,
}

/// Least and largest coordinates of positions.
struct Extent([[f32; 3]; 2]);

impl Extent {
    /// Extends to the positions of the lanes in `set`. `None` for values that no decoder accepts.
    fn add(&mut self, set: u32, group: &Group, frame: &Frame, refinements: usize) -> Option<()> {
        let drawn = Drawn::new(frame, group, Refinements { all: refinements, missing: 0 }, &[false; LANES]);
        let [least, most] = &mut self.0;
        for l in (0..LANES).filter(|&l| has(set, l)) {
            for (k, position) in drawn.position.iter().enumerate() {
                least[k] = least[k].min(position[l]);
                most[k] = most[k].max(position[l]);
            }
        }
        drawn.check(set).ok()
    }
}

/// The optional results of decoding a chunk.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::packed) struct Want {
    /// Whether to compute the checksums of the integers of the ranges.
    pub(in crate::packed) sums: bool,
    /// Whether to count the bits of the streams.
    pub(in crate::packed) bits: bool,
}

/// The optional results of decoding a chunk, where they were wanted.
#[derive(Debug, Default)]
pub(in crate::packed) struct Played {
    pub(in crate::packed) sums: Vec<u32>,
    pub(in crate::packed) bits: BitCounts,
}

/// CRC-32 of the integers of a range, as i32. The Gaussians of a lane follow one another, and so do the lanes.
#[derive(Debug, Clone, Default)]
struct Sums(Lanes<crc32::Hasher>);

impl Sums {
    #[inline(never)]
    fn add(&mut self, l: usize, numbers: &[i32]) {
        for number in numbers {
            self.0[l].update(&number.to_le_bytes());
        }
    }

    /// Adds the integers of a base: cell, classes, numbers of coarse steps, codes of the rotation.
    fn base(&mut self, set: u32, group: &Group) {
        for l in (0..LANES).filter(|&l| has(set, l)) {
            self.add(l, &group.cell.map(|x| x[l]));
            self.add(l, &[group.colour[l].cast_signed(), group.shape[l].cast_signed()]);
            self.refined_of(l, group);
        }
    }

    fn refined(&mut self, set: u32, group: &Group) {
        (0..LANES).filter(|&l| has(set, l)).for_each(|l| self.refined_of(l, group));
    }

    /// Adds the numbers of steps and the codes of the rotation, as far as they are refined.
    fn refined_of(&mut self, l: usize, group: &Group) {
        self.add(l, &group.counts.map(|x| x[l]));
        self.add(l, &group.rotation.map(|x| x[l].cast_signed()));
    }

    /// Adds the interim changes, in steps.
    fn interim(&mut self, set: u32, group: &Group) {
        (0..LANES).filter(|&l| has(set, l)).for_each(|l| self.add(l, &group.interim.map(|x| x[l])));
    }

    /// Adds each Gaussian's number of nonzeros, and the atom and the value of each. For an exact row, adds -1 and the bits
    /// of the row.
    fn rest(&mut self, rest: &Rest, form: &RestForm, sh_part: usize) {
        for l in 0..LANES {
            let mut cursor = Cursor::default();
            for i in (0..rest.len()).filter(|&i| has(rest.of(i).0, l)) {
                match rest.coded(form, sh_part, i, l, &mut cursor) {
                    Coded::Exact(row) => {
                        self.add(l, &[-1]);
                        row.iter().for_each(|v| self.add(l, &[v.to_bits().cast_signed()]));
                    }
                    Coded::Code { first, count } => {
                        self.add(l, &[count as i32]);
                        for (atom, value) in rest.nonzeros(sh_part, first, count, l) {
                            self.add(l, &[atom.into(), value]);
                        }
                    }
                }
            }
        }
    }

    fn finish(self) -> u32 {
        let [mut all, rest @ ..] = self.0;
        rest.iter().for_each(|lane| all.combine(lane));
        all.finalize()
    }
}
