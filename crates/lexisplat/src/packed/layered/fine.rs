//! What coarse steps leave: for each value one of three finer steps, and the low bits of rotations.

use super::streams::Stream;
use super::symbols::{LANES, Lanes, Symbols, each};
use super::walk::{DC, FACTOR, Group, REFINED, coarsened, dropped, factor};
use crate::packed::parameters::TARGETS;

/// Contexts by the number of coarse steps: none, one, more.
const BY_COUNT: u32 = 3;
/// Classes, or finenesses, that contexts are told apart by.
const CLASSES: u32 = 8;
/// Classes, and finenesses, of a context.
const CLASS_WIDTH: u32 = 2;
const FINENESS_WIDTH: u32 = 3;

/// Codes the refinement of a group from `level` missing levels to one less. Returns `None` for impossible values.
#[inline(always)]
pub(super) fn refine<S: Symbols>(s: &mut S, set: u32, group: &mut Group, level: usize) -> Option<()> {
    let mut beyond = false;
    let finer = factor(level - 1);
    for k in DC..REFINED {
        let (stream, class, width) = match k {
            DC..TARGETS => (Stream::FineDc, &group.colour, CLASS_WIDTH),
            _ => (Stream::FinePosition, &group.fineness[k - TARGETS], FINENESS_WIDTH),
        };
        let counts = group.counts[k];
        let wanted = &group.wanted[k];
        let context: Lanes<u32> = each(|l| {
            BY_COUNT * (class[l] / width).min(CLASSES - 1) + counts[l].unsigned_abs().min(BY_COUNT - 1)
        });
        // Zero is the step towards zero, which is the one that occurs most.
        let symbols = s.symbols(stream.at(level), context, set, |l| {
            let rest = coarsened(wanted[l], finer) - FACTOR * counts[l];
            (if counts[l] < 0 { 1 - rest } else { 1 + rest }).cast_unsigned()
        });
        for l in 0..LANES {
            beyond |= symbols[l] >= FACTOR.cast_unsigned();
            let rest = symbols[l].cast_signed().wrapping_sub(1);
            let rest = if counts[l] < 0 { rest.wrapping_neg() } else { rest };
            group.counts[k][l] = counts[l].wrapping_mul(FACTOR).wrapping_add(rest);
        }
    }
    for k in 0..3 {
        let full = &group.axis_bits[usize::from(k == 2)];
        let count = each(|l| dropped(full[l], level) - dropped(full[l], level - 1));
        let wanted = &group.wanted_rotation[k];
        let low = s.bits(Stream::Rotation.at(level), count, set, |l| {
            wanted[l] >> dropped(full[l], level - 1) & ((1 << count[l]) - 1)
        });
        for l in 0..LANES {
            group.rotation[k][l] = group.rotation[k][l] << count[l] | low[l];
        }
    }
    (!beyond).then_some(())
}
