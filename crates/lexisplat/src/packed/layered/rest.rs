//! SH-rest: the nonzeros of codes, in parts by their size, and exact rows.

use super::streams::{REST_PARTS, Stream};
use super::symbols::{LANES, Lanes, Symbols, has};
use super::target::Target;

/// Colour classes that numbers of nonzeros are told apart by.
const COUNT_CLASSES: u32 = 12;
/// Numbers of nonzeros of the part before that contexts are told apart by: none, one, more.
const BY_BEFORE: u32 = 3;
/// Colour classes of a context of a later part.
const CLASS_WIDTH: u32 = 2;
const LATER_CLASSES: u32 = 8;
/// Contexts of the size of a first nonzero, by the number of nonzeros, and of later ones, by the size before.
const FIRST_CONTEXTS: u32 = 8;
const LATER_CONTEXTS: u32 = 16;
/// Atoms that a symbol tells apart.
pub(in crate::packed) const PAGE: u32 = 256;
/// Largest size of a nonzero.
const MAX_SIZE: u32 = 1 << 30;

/// How SH-rest is coded.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::packed) struct RestForm {
    /// Length of a row; 0 for degree 0.
    pub(in crate::packed) dim: usize,
    pub(in crate::packed) atoms: usize,
    /// Smallest size of each part, falling, at most [`REST_PARTS`]. That of the last part is 1.
    pub(in crate::packed) least: Vec<u32>,
}

/// What is known of the SH-rest of eight Gaussians.
#[derive(Debug, Default)]
pub(super) struct Rest {
    /// Pairs (atom, value in steps) of each lane.
    pub(super) codes: Lanes<Vec<(u16, i32)>>,
    /// Exact rows, empty for Gaussians that have codes.
    pub(super) exact: Lanes<Vec<f32>>,
    /// Nonzeros of the part before.
    before: Lanes<u32>,
    /// Nonzeros of the first part of the group before.
    last: Lanes<u32>,
}

impl Rest {
    /// Nonzeros of a lane before the last part.
    pub(super) fn earlier(&self, l: usize) -> usize {
        self.codes[l].len() - self.before[l] as usize
    }

    /// Forgets the codes of the last group.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.codes.iter_mut().for_each(Vec::clear);
        self.exact.iter_mut().for_each(Vec::clear);
    }

    /// Codes one part of the nonzeros of the next Gaussian of each lane in `set`. Returns `None` for impossible values.
    #[inline(always)]
    pub(super) fn part<S: Symbols>(
        &mut self,
        s: &mut S,
        set: u32,
        targets: Option<&[&Target; LANES]>,
        colour: &Lanes<u32>,
        form: &RestForm,
        part: usize,
    ) -> Option<()> {
        let escape = form.dim as u32 + 1;
        let least = *form.least.get(part)?;
        let most = part.checked_sub(1).and_then(|before| form.least.get(before)).map_or(MAX_SIZE, |&most| most);
        let of = |l: usize| {
            let code = targets.map_or(&[][..], |targets| &targets[l].code);
            let size = |&&(_, value): &&(u16, i32)| (least..most).contains(&value.unsigned_abs());
            code.iter().filter(size)
        };
        // Rows that are stored exactly have no later parts.
        let mut coded = 0;
        for l in (0..LANES).filter(|&l| has(set, l) && (part == 0 || self.exact[l].is_empty())) {
            coded |= 1 << l;
        }
        let context: Lanes<u32> = std::array::from_fn(|l| match part {
            0 => 2 * colour[l].min(COUNT_CLASSES - 1) + u32::from(self.last[l] > 1),
            _ => {
                BY_BEFORE * (colour[l] / CLASS_WIDTH).min(LATER_CLASSES - 1) + self.before[l].min(BY_BEFORE - 1)
            }
        });
        let counts = s.integers(Stream::COUNTS[part], context, coded, |l| {
            let exact = part == 0 && targets.is_some_and(|targets| !targets[l].exact.is_empty());
            if exact { escape } else { of(l).count() as u32 }
        });
        let mut most_count = 0;
        for l in 0..LANES {
            if counts[l] > escape || (counts[l] == escape && part > 0) {
                return None;
            }
            if counts[l] == escape {
                self.row(s, l, targets, form.dim)?;
            } else {
                most_count = most_count.max(counts[l]);
            }
        }
        let counts = counts.map(|count| if count == escape { 0 } else { count });
        self.before = counts;
        if part == 0 {
            self.last = counts;
        }
        let (mut last, pages) = ([0; LANES], form.atoms as u32 > PAGE);
        for k in 0..most_count {
            let mut set = 0;
            for l in 0..LANES {
                set |= u32::from(counts[l] > k) << l;
            }
            let nth = |l: usize| of(l).nth(k as usize).copied().unwrap_or_default();
            let page = match pages {
                true => s.symbols(Stream::AtomPage, [part as u32; LANES], set, |l| u32::from(nth(l).0) / PAGE),
                false => [0; LANES],
            };
            let context = page.map(|page| 2 * page.min(3) + u32::from(k > 0));
            let atom = s.symbols(Stream::ATOMS[part], context, set, |l| u32::from(nth(l).0) % PAGE);
            let context: Lanes<u32> = std::array::from_fn(|l| match k {
                0 => counts[l].wrapping_sub(1).min(FIRST_CONTEXTS - 1),
                _ => FIRST_CONTEXTS + last[l].min(LATER_CONTEXTS - 1),
            });
            let size = s.integers(Stream::VALUES[part], context, set, |l| nth(l).1.unsigned_abs().wrapping_sub(least));
            last = size;
            let negative = s.bits(Stream::VALUES[part], [1; LANES], set, |l| u32::from(nth(l).1 < 0));
            for l in 0..LANES {
                if has(set, l) {
                    let atom = PAGE * page[l] + atom[l];
                    let value = size[l].checked_add(least).filter(|&value| value < most)?.cast_signed();
                    if atom >= form.atoms as u32 {
                        return None;
                    }
                    self.codes[l].push((atom as u16, if negative[l] == 1 { -value } else { value }));
                }
            }
        }
        Some(())
    }

    /// Codes an exact row.
    fn row<S: Symbols>(&mut self, s: &mut S, l: usize, targets: Option<&[&Target; LANES]>, dim: usize) -> Option<()> {
        for k in 0..dim {
            let own = |_: usize| targets.map_or(0, |targets| targets[l].exact[k].to_bits());
            let bits = s.bits(Stream::Value0, [32; LANES], 1 << l, own);
            self.exact[l].push(f32::from_bits(bits[l]));
        }
        self.exact[l].iter().all(|v| v.is_finite()).then_some(())
    }
}

const _: () = assert!(COUNT_CLASSES as usize * 2 <= super::streams::CONTEXTS);
const _: () = assert!((FIRST_CONTEXTS + LATER_CONTEXTS) as usize <= super::streams::CONTEXTS);
const _: () = assert!(REST_PARTS <= super::streams::CONTEXTS);
