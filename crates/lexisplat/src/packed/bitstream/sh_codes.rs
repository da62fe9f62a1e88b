//! Coding of SH-rest: the nonzeros of codes, in SH parts by their size, and exact rows.

use half::f16;

use super::streams::{SH_PARTS, Stream};
use crate::packed::bitstream::broken::Broken;
use crate::packed::bitstream::coded_gaussian::CodedGaussian;
use crate::packed::entropy::lanes::{LANES, Lanes, each};
use crate::packed::entropy::symbols::Symbols;

/// Number of colour classes with contexts of their own for numbers of nonzeros.
const COUNT_CLASSES: u32 = 12;
/// Number of contexts by the number of nonzeros of the SH part before: none, one, more.
const BY_BEFORE: u32 = 3;
/// Number of colour classes that share a context of a later SH part, and number of such groups of classes.
const CLASS_WIDTH: u32 = 2;
const LATER_CLASSES: u32 = 8;
/// Number of contexts of the size of a first nonzero, by the number of nonzeros, and of a later one, by the size before.
const FIRST_CONTEXTS: u32 = 8;
const LATER_CONTEXTS: u32 = 16;
/// Number of atoms that one symbol can tell apart.
pub(in crate::packed) const PAGE: u32 = 256;
/// Most Gaussians of a lane in a block. The numbers of nonzeros of a block come first, then its nonzeros. Lanes have
/// different numbers of nonzeros. Over many Gaussians these differ less, so that nearly all lanes are busy.
pub(in crate::packed) const BLOCK: usize = 64;
/// Number of signs that are coded at once.
const SIGNS: usize = 16;
/// Marks a nonzero that is not the first one of its Gaussian in its SH part.
const LATER: u8 = u8::MAX;
/// Upper bound of the sizes of nonzeros, which are smaller.
const MAX_SIZE: u32 = 1 << 30;

/// A nonzero of a code.
#[derive(Debug, Clone, Copy)]
pub(in crate::packed) struct Nonzero {
    pub(in crate::packed) atom: u16,
    pub(in crate::packed) value: f16,
}

/// The parameters with which SH-rest is coded.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::packed) struct RestForm {
    /// Length of a row; 0 for degree 0.
    pub(in crate::packed) dim: usize,
    pub(in crate::packed) atoms: usize,
    /// Smallest size of each SH part, in falling order. There are at most [`SH_PARTS`], and the last has the size 1.
    pub(in crate::packed) least: Vec<u32>,
}

/// The SH-rest of up to [`BLOCK`] Gaussians of each lane.
#[derive(Debug, Default)]
pub(in crate::packed) struct Rest {
    /// For each Gaussian of the block, the lanes that have one, and their colour classes.
    sets: Vec<u32>,
    colours: Vec<Lanes<u32>>,
    sh_parts: [ShPart; SH_PARTS],
    /// The exact rows of each lane, one after the other.
    rows: Lanes<Vec<f32>>,
    /// Number of nonzeros of the last Gaussian in the first SH part; 0 for an exact row.
    last: Lanes<u32>,
    /// For each nonzero of each lane, the context of its size, or [`LATER`].
    plan: Vec<[u8; LANES]>,
}

/// The nonzeros of a block in one SH part.
#[derive(Debug, Default)]
struct ShPart {
    /// For each Gaussian, the number of nonzeros of each lane.
    counts: Vec<Lanes<u32>>,
    /// For each nonzero of each lane, the atom, and the value in steps.
    atoms: Vec<Lanes<u32>>,
    values: Vec<Lanes>,
    /// Number of nonzeros of each lane.
    totals: Lanes<u32>,
}

/// The next nonzero of each SH part, and the next number of an exact row, of a lane.
#[derive(Debug, Default, Clone, Copy)]
pub(in crate::packed) struct Cursor {
    next: [usize; SH_PARTS],
    row: usize,
}

/// The SH-rest of one Gaussian in one SH part of a block.
#[derive(Debug)]
pub(in crate::packed) enum Coded<'r> {
    Exact(&'r [f32]),
    /// The nonzeros from index `first` on.
    Code {
        first: usize,
        count: usize,
    },
}

impl Rest {
    /// Returns the number of Gaussians of the block so far in the longest lane.
    pub(in crate::packed) fn len(&self) -> usize {
        self.sets.len()
    }

    /// Returns the lanes that have Gaussian `i` of the block, and their colour classes.
    #[inline(always)]
    pub(in crate::packed) fn of(&self, i: usize) -> (u32, &Lanes<u32>) {
        (self.sets[i], &self.colours[i])
    }

    /// Adds a Gaussian of each lane in `set`, with their colour classes.
    #[inline(always)]
    pub(in crate::packed) fn push(&mut self, set: u32, colours: Lanes<u32>) {
        self.sets.push(set);
        self.colours.push(colours);
    }

    /// Clears the block for the next one.
    pub(in crate::packed) fn clear(&mut self) {
        self.sets.clear();
        self.colours.clear();
        for part in &mut self.sh_parts {
            part.counts.clear();
            part.atoms.clear();
            part.values.clear();
            part.totals = [0; LANES];
        }
        self.rows.iter_mut().for_each(Vec::clear);
    }

    /// Returns the numbers of nonzeros and of exact rows of the block.
    pub(in crate::packed) fn sizes(&self, form: &RestForm) -> (usize, usize) {
        let nonzeros =
            self.sh_parts.iter().map(|part| part.totals.iter().map(|&n| n as usize).sum::<usize>()).sum();
        let rows = self.rows.iter().map(Vec::len).sum::<usize>() / form.dim.max(1);
        (nonzeros, rows)
    }

    /// Returns the SH-rest of Gaussian `i` of lane `l` in SH part `sh_part`. Gaussians must come in order. An SH part
    /// that was not coded has no nonzeros.
    #[inline(always)]
    pub(in crate::packed) fn coded(
        &self,
        form: &RestForm,
        sh_part: usize,
        i: usize,
        l: usize,
        cursor: &mut Cursor,
    ) -> Coded<'_> {
        let count = self.sh_parts[sh_part].counts.get(i).map_or(0, |counts| counts[l] as usize);
        if count == form.dim + 1 {
            let from = cursor.row;
            cursor.row += form.dim;
            return Coded::Exact(self.rows[l].get(from..cursor.row).unwrap_or_default());
        }
        let first = cursor.next[sh_part];
        cursor.next[sh_part] += count;
        Coded::Code { first, count }
    }

    /// Returns `count` nonzeros of lane `l` in SH part `sh_part`, from index `from` on: pairs of an atom and a value in
    /// steps.
    #[inline(always)]
    pub(in crate::packed) fn nonzeros(
        &self,
        sh_part: usize,
        from: usize,
        count: usize,
        l: usize,
    ) -> impl Iterator<Item = (u16, i32)> {
        let part = &self.sh_parts[sh_part];
        let atoms = part.atoms.get(from..from + count).unwrap_or_default();
        let values = part.values.get(from..from + count).unwrap_or_default();
        atoms.iter().zip(values).map(move |(atoms, values)| (atoms[l] as u16, values[l]))
    }

    /// Returns the number of nonzeros of lane `l` in all SH parts.
    pub(in crate::packed) fn total(&self, l: usize) -> usize {
        self.sh_parts.iter().map(|part| part.totals[l] as usize).sum()
    }

    /// Codes one SH part of the nonzeros of the block. `coded` holds the Gaussians of each lane; a decoder passes none.
    /// Returns the rule that a damaged file breaks.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(in crate::packed) fn sh_part<S: Symbols>(
        &mut self,
        s: &mut S,
        coded: Option<&Lanes<Vec<&CodedGaussian>>>,
        form: &RestForm,
        sh_part: usize,
    ) -> Result<(), Broken> {
        let least = *form.least.get(sh_part).ok_or(Broken("is a part that the head does not have"))?;
        let most =
            sh_part.checked_sub(1).and_then(|before| form.least.get(before)).map_or(MAX_SIZE, |&most| most);
        // The nonzeros of each lane that belong to this SH part.
        let mut wanted: Lanes<Vec<(u16, i32)>> = Lanes::default();
        if let Some(coded) = coded {
            for (wanted, lane) in wanted.iter_mut().zip(coded) {
                let all = lane.iter().flat_map(|gaussian| &gaussian.code);
                wanted.extend(all.filter(|(_, value)| (least..most).contains(&value.unsigned_abs())));
            }
        }
        self.counts(s, coded, form, sh_part, least..most)?;
        let totals = self.totals(form, sh_part);
        self.sh_parts[sh_part].totals = totals;
        let count = totals.iter().copied().max().unwrap_or(0) as usize;
        let pages = form.atoms as u32 > PAGE;
        let of = |l: usize, j: usize| wanted[l].get(j).copied().unwrap_or_default();
        let mut last = [0; LANES];
        let (mut no_atom, mut no_size) = (false, false);
        for j in 0..count {
            let set = longer(&totals, j);
            let plan = self.plan[j];
            let later: Lanes<u32> = each(|l| u32::from(plan[l] == LATER));
            let page = match pages {
                true => s.symbols(Stream::AtomPage.at(0), [sh_part as u32; LANES], set, |l| {
                    u32::from(of(l, j).0) / PAGE
                }),
                false => [0; LANES],
            };
            let context = each(|l| 2 * page[l].min(3) + later[l]);
            let atom =
                s.symbols(Stream::ATOMS[sh_part].at(0), context, set, |l| u32::from(of(l, j).0) % PAGE);
            let context = each(|l| match later[l] {
                0 => u32::from(plan[l]),
                _ => FIRST_CONTEXTS + last[l].min(LATER_CONTEXTS - 1),
            });
            let size = s.integers(Stream::VALUES[sh_part].at(0), context, set, |l| {
                of(l, j).1.unsigned_abs().wrapping_sub(least)
            });
            last = size;
            let atom = each(|l| PAGE * page[l] + atom[l]);
            for l in 0..LANES {
                no_atom |= atom[l] >= form.atoms as u32;
                no_size |= size[l] >= most - least;
            }
            self.sh_parts[sh_part].atoms.push(atom);
            self.sh_parts[sh_part].values.push(each(|l| size[l].wrapping_add(least).cast_signed()));
        }
        if no_atom {
            return Err(Broken("has an atom that the dictionary does not have"));
        }
        if no_size {
            return Err(Broken("has a nonzero whose size is not within its part"));
        }
        for from in (0..count).step_by(SIGNS) {
            let taken = each(|l| (totals[l]).saturating_sub(from as u32).min(SIGNS as u32));
            let signs = s.bits(Stream::VALUES[sh_part].at(0), taken, longer(&totals, from), |l| {
                (0..taken[l]).fold(0, |bits, k| bits | u32::from(of(l, from + k as usize).1 < 0) << k)
            });
            for (k, values) in self.sh_parts[sh_part].values[from..].iter_mut().take(SIGNS).enumerate() {
                for l in 0..LANES {
                    let negative = (signs[l] >> k & 1).cast_signed().wrapping_neg();
                    values[l] = (values[l] ^ negative).wrapping_sub(negative);
                }
            }
        }
        if sh_part == 0 { self.exact(s, coded, form) } else { Ok(()) }
    }

    /// Codes the numbers of nonzeros of one SH part.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn counts<S: Symbols>(
        &mut self,
        s: &mut S,
        coded: Option<&Lanes<Vec<&CodedGaussian>>>,
        form: &RestForm,
        sh_part: usize,
        sizes: std::ops::Range<u32>,
    ) -> Result<(), Broken> {
        let escape = form.dim as u32 + 1;
        let mut beyond = false;
        for i in 0..self.len() {
            let (mut set, colour) = (self.sets[i], &self.colours[i]);
            let context = if sh_part == 0 {
                each(|l| 2 * colour[l].min(COUNT_CLASSES - 1) + u32::from(self.last[l] > 1))
            } else {
                let before = &self.sh_parts[sh_part - 1].counts[i];
                // An exact row has no later SH parts.
                let exact = &self.sh_parts[0].counts[i];
                for l in 0..LANES {
                    set &= !(u32::from(exact[l] == escape) << l);
                }
                each(|l| {
                    BY_BEFORE * (colour[l] / CLASS_WIDTH).min(LATER_CLASSES - 1)
                        + before[l].min(BY_BEFORE - 1)
                })
            };
            let counts = s.integers(Stream::COUNTS[sh_part].at(0), context, set, |l| {
                let Some(gaussian) = coded.and_then(|coded| coded[l].get(i)) else { return 0 };
                if sh_part == 0 && !gaussian.exact.is_empty() {
                    return escape;
                }
                gaussian.code.iter().filter(|(_, value)| sizes.contains(&value.unsigned_abs())).count() as u32
            });
            for l in 0..LANES {
                beyond |= counts[l] > escape || (counts[l] == escape && sh_part > 0);
            }
            if sh_part == 0 {
                self.last = each(|l| if counts[l] == escape { 0 } else { counts[l] });
            }
            self.sh_parts[sh_part].counts.push(counts);
        }
        if beyond { Err(Broken("has a Gaussian with more nonzeros than coefficients")) } else { Ok(()) }
    }

    /// Computes the contexts of the nonzeros of an SH part. Returns the number of nonzeros of each lane.
    #[inline(always)]
    fn totals(&mut self, form: &RestForm, sh_part: usize) -> Lanes<u32> {
        let escape = form.dim as u32 + 1;
        let number = |count: u32| if count == escape { 0 } else { count };
        let mut totals = [0; LANES];
        for counts in &self.sh_parts[sh_part].counts {
            for l in 0..LANES {
                totals[l] += number(counts[l]);
            }
        }
        let most = totals.iter().copied().max().unwrap_or(0) as usize;
        self.plan.clear();
        self.plan.resize(most + 1, [LATER; LANES]);
        let mut next = [0_u32; LANES];
        for counts in &self.sh_parts[sh_part].counts {
            for l in 0..LANES {
                let count = number(counts[l]);
                // The entry of a Gaussian without nonzeros is overwritten by the next Gaussian, or never read.
                self.plan[next[l] as usize][l] = count.wrapping_sub(1).min(FIRST_CONTEXTS - 1) as u8;
                next[l] += count;
            }
        }
        totals
    }

    /// Codes the exact rows of the block.
    fn exact<S: Symbols>(
        &mut self,
        s: &mut S,
        coded: Option<&Lanes<Vec<&CodedGaussian>>>,
        form: &RestForm,
    ) -> Result<(), Broken> {
        let escape = form.dim as u32 + 1;
        let mut finite = true;
        for i in 0..self.len() {
            for l in (0..LANES).filter(|&l| self.sh_parts[0].counts[i][l] == escape) {
                for k in 0..form.dim {
                    let own = |_: usize| {
                        let gaussian = coded.and_then(|coded| coded[l].get(i));
                        gaussian.and_then(|gaussian| gaussian.exact.get(k)).map_or(0, |v| v.to_bits())
                    };
                    let value = f32::from_bits(s.bits(Stream::Value0.at(0), [32; LANES], 1 << l, own)[l]);
                    finite &= value.is_finite();
                    self.rows[l].push(value);
                }
            }
        }
        if finite { Ok(()) } else { Err(Broken("has exact SH-rest that is not finite")) }
    }
}

/// Returns the set of lanes whose total is above `j`.
#[inline(always)]
fn longer(totals: &Lanes<u32>, j: usize) -> u32 {
    let mut set = 0;
    for l in 0..LANES {
        set |= u32::from(totals[l] as usize > j) << l;
    }
    set
}

const _: () = assert!(COUNT_CLASSES as usize * 2 <= super::streams::CONTEXTS);
const _: () = assert!((FIRST_CONTEXTS + LATER_CONTEXTS) as usize <= super::streams::CONTEXTS);
const _: () = assert!(SH_PARTS <= super::streams::CONTEXTS);

#[cfg(test)]
mod tests;
