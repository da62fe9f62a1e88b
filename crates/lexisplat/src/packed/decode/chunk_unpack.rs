//! Decoding of a chunk to the values that are drawn.

use std::ops::Range;

use half::f16;

use crate::packed::bitstream::broken::Broken;
use crate::packed::bitstream::chunk::{Form, InRange, LayerForm, Sink, Want, starts};
use crate::packed::bitstream::coarseness::Refinements;
use crate::packed::bitstream::drawn::{Drawn, Frame};
use crate::packed::bitstream::geometry_syntax::Group;
use crate::packed::bitstream::halves::halved;
use crate::packed::bitstream::parameters::LAST_CLASS;
use crate::packed::bitstream::points_of_view::{MOST, PointsOfView, SeenAtoms, seen_row};
use crate::packed::bitstream::sh_codes::{BLOCK, Coded, Cursor, Nonzero, Rest};
use crate::packed::decode::output::{ChunkOutput, Piece, indices};
use crate::packed::entropy::lanes::{LANES, Lanes, each, has};
use crate::packed::entropy::tables::Lookup;
use crate::sparse::codes::Escapes;
use crate::sparse::dictionary::Dictionary;
use crate::support::memory_budget::MemoryBudget;
use crate::support::simd::Simd;

/// Everything that is needed to decode the chunks of a file.
#[derive(Debug)]
pub(in crate::packed) struct Unpacker {
    pub(in crate::packed) form: Form,
    pub(in crate::packed) frame: Frame,
    pub(in crate::packed) points_of_view: PointsOfView,
    pub(in crate::packed) lookup: Lookup,
    pub(in crate::packed) dictionary: Dictionary,
    pub(in crate::packed) seen_atoms: SeenAtoms,
}

impl Unpacker {
    /// Decodes a chunk of `layer` into `output`, from the ranges that are there. `cell` is the cell of its first Gaussian.
    /// Gaussians in the cells `uncovered` get interim changes. Escapes are numbered from the start of the chunk. `budget`
    /// already holds everything but the codes, which are added to it. Returns the codes, and the checksums of integers if
    /// they are wanted.
    #[expect(clippy::too_many_arguments, reason = "what is decoded, from what and where to")]
    pub(in crate::packed) fn chunk(
        &self,
        layer: LayerForm,
        cell: u64,
        uncovered: &[Range<u64>],
        ranges: &[Option<&[u8]>],
        want: Want,
        output: &mut ChunkOutput<'_>,
        budget: &MemoryBudget<'_>,
    ) -> Result<(Piece, Vec<u32>), Refusal> {
        // Registers of 512 bits were measured to be 5 to 10 % slower.
        Simd::current().narrow().run(Job { with: self, layer, cell, uncovered, ranges, want, output, budget })
    }
}

impl Unpacker {
    /// Returns the number of bytes of a nonzero in memory.
    fn nonzero_bytes(&self) -> usize {
        indices(&self.dictionary, Vec::new()).width() + size_of::<f16>()
    }
}

/// The work of [`Unpacker::chunk`], compiled once for each vector width.
struct Job<'j, 'p, 'r> {
    with: &'j Unpacker,
    layer: LayerForm,
    cell: u64,
    uncovered: &'j [Range<u64>],
    ranges: &'j [Option<&'r [u8]>],
    want: Want,
    output: &'j mut ChunkOutput<'p>,
    budget: &'j MemoryBudget<'j>,
}

/// The reason for which a chunk is not decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::packed) enum Refusal {
    /// A range breaks a rule of the format.
    Damaged(InRange),
    /// The chunk takes more memory than is left.
    Full,
}

impl pulp::NullaryFnOnce for Job<'_, '_, '_> {
    type Output = Result<(Piece, Vec<u32>), Refusal>;

    #[inline(always)]
    fn call(self) -> Self::Output {
        let Self { with, layer, cell, uncovered, ranges, want, output, budget } = self;
        let n = output.counts.len();
        let starts = starts(n, crate::packed::bitstream::chunk::lanes(n));
        let blank = [[0.0; LANES]; 3];
        let positions = if with.points_of_view.points.is_empty() { Vec::new() } else { vec![blank; BLOCK] };
        let mut out = Out {
            with,
            output,
            cell,
            uncovered,
            starts,
            nonzeros: Lanes::default(),
            escapes: Lanes::default(),
            positions,
            budget,
            is_full: false,
        };
        let played = match with.form.decode(layer, n, &with.lookup, ranges, want, &mut out) {
            Ok(played) => played,
            Err(_) if out.is_full => return Err(Refusal::Full),
            Err(broken) => return Err(Refusal::Damaged(broken)),
        };
        let total = out.nonzeros.iter().map(Vec::len).sum();
        let (mut atoms, mut values) = (Vec::with_capacity(total), Vec::with_capacity(total));
        for lane in &out.nonzeros {
            atoms.extend(lane.iter().map(|nonzero| nonzero.atom));
            values.extend(lane.iter().map(|nonzero| nonzero.value));
        }
        let [mut escapes, rest @ ..] = out.escapes;
        for lane in rest {
            escapes.gaussians.extend(lane.gaussians);
            escapes.rows.extend(lane.rows);
        }
        // Large values are infinite in f16, and base colours may leave f32 when the sums of codes are subtracted.
        let refused = |range: usize, rule| Err(Refusal::Damaged(InRange { range, broken: Broken(rule) }));
        if !values.iter().fold(true, |good, v| good & v.is_finite()) {
            return refused(1 + layer.refinements, "has an SH value that is infinite in f16");
        }
        if !output.dc.as_flattened().iter().fold(true, |good, v| good & v.is_finite()) {
            return refused(0, "has a base colour that is not finite with SH-rest taken away");
        }
        Ok((Piece { atoms, values, escapes, bit_counts: played.bits }, played.sums))
    }
}

/// There is no output for a Gaussian. It does not occur, since the output is as long as the chunk.
const NO_SUCH_GAUSSIAN: Broken = Broken("has more Gaussians than the index says");

/// The output of a decoded chunk.
struct Out<'j, 'p> {
    with: &'j Unpacker,
    output: &'j mut ChunkOutput<'p>,
    /// The cell of the first Gaussian.
    cell: u64,
    /// Cells around which the next layer is missing.
    uncovered: &'j [Range<u64>],
    /// Index of the first Gaussian of each lane.
    starts: [usize; LANES + 1],
    /// The nonzeros of each lane. The nonzeros of one Gaussian are in ascending order of atoms.
    nonzeros: Lanes<Vec<Nonzero>>,
    escapes: Lanes<Escapes>,
    /// Positions of the Gaussians of the block. Empty if there are no points of view.
    positions: Vec<[Lanes<f32>; 3]>,
    budget: &'j MemoryBudget<'j>,
    /// Whether the chunk was refused because the budget was too small.
    is_full: bool,
}

impl Sink for Out<'_, '_> {
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn group(
        &mut self,
        number: usize,
        in_block: usize,
        set: u32,
        group: &Group,
        refinements: Refinements,
    ) -> Result<(), Broken> {
        if number == 0 && group.number[0] != self.cell {
            return Err(Broken("begins with another cell than the index says"));
        }
        let is_interim =
            |l: usize| has(set, l) && self.uncovered.iter().any(|cells| cells.contains(&group.number[l]));
        let interim = if self.uncovered.is_empty() { [false; LANES] } else { each(is_interim) };
        let drawn = Drawn::new(&self.with.frame, group, refinements, &interim);
        if let Some(position) = self.positions.get_mut(in_block) {
            *position = drawn.position;
        }
        for l in (0..LANES).filter(|&l| has(set, l)) {
            self.output.put(self.starts[l] + number, &drawn, l).ok_or(NO_SUCH_GAUSSIAN)?;
        }
        drawn.check(set)
    }

    #[cfg_attr(target_arch = "wasm32", inline(never))]
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn rest(&mut self, number: usize, rest: &Rest) -> Result<(), Broken> {
        let form = &self.with.form.rest;
        let (codes, rows) = rest.sizes(form);
        let row = size_of::<u32>() + form.dim * size_of::<f32>();
        if !(self.budget.grow(codes, self.with.nonzero_bytes()) && self.budget.grow(rows, row)) {
            self.is_full = true;
            return Err(Broken("takes more memory than the limits allow"));
        }
        let degree = self.with.dictionary.degree();
        let per_channel = degree.rest_per_channel().min(MOST);
        for l in 0..LANES {
            self.nonzeros[l].reserve(rest.total(l));
        }
        let mut cursors = [Cursor::default(); LANES];
        let mut weights = [[0.0; LANES]; MOST];
        for k in 0..rest.len() {
            let (set, colours) = rest.of(k);
            let has_points = match self.positions.get(k) {
                Some(position) => {
                    self.with.points_of_view.lanes(degree, position, &mut weights);
                    true
                }
                None => false,
            };
            for l in (0..LANES).filter(|&l| has(set, l)) {
                let nonzeros = &mut self.nonzeros[l];
                let i = self.starts[l] + number + k;
                let step = self.with.frame.value_steps[(colours[l] & u32::from(LAST_CLASS)) as usize];
                let first = nonzeros.len();
                let mut exact = None;
                for sh_part in 0..form.least.len() {
                    match rest.coded(form, sh_part, k, l, &mut cursors[l]) {
                        Coded::Exact(row) => {
                            self.escapes[l].gaussians.push(u32::try_from(i).map_err(|_| NO_SUCH_GAUSSIAN)?);
                            self.escapes[l].rows.extend_from_slice(row);
                            exact = Some(row);
                        }
                        Coded::Code { count: 0, .. } => {}
                        Coded::Code { first: from, count } => {
                            for (atom, value) in rest.nonzeros(sh_part, from, count, l) {
                                let added = Nonzero { atom, value: halved(value as f32 * step) };
                                let mut at = nonzeros.len();
                                nonzeros.push(added);
                                // Codes are short, so moving the later nonzeros is cheaper than sorting.
                                while at > first && nonzeros[at - 1].atom > atom {
                                    nonzeros[at] = nonzeros[at - 1];
                                    at -= 1;
                                }
                                nonzeros[at] = added;
                            }
                        }
                    }
                }
                let code = &nonzeros[first..];
                let count = u8::try_from(code.len())
                    .map_err(|_| Broken("has a Gaussian with more nonzeros than coefficients"))?;
                *self.output.counts.get_mut(i).ok_or(NO_SUCH_GAUSSIAN)? = count;
                if !has_points {
                    continue;
                }
                let added = match exact {
                    Some(row) => {
                        let own: [f32; MOST] = std::array::from_fn(|k| weights[k][l]);
                        let [r, g, b] = seen_row(row, &own[..per_channel]);
                        [r, g, b, 0.0]
                    }
                    None => self.with.seen_atoms.seen(code, &weights, l),
                };
                for (dc, added) in self.output.dc.get_mut(i).ok_or(NO_SUCH_GAUSSIAN)?.iter_mut().zip(added) {
                    *dc -= added;
                }
            }
        }
        Ok(())
    }
}
