//! Interim changes: changes of Gaussians while the next layer around them is missing.
//!
//! The Gaussians of the first layer lie apart. Until the next layer fills the space between them, they are drawn larger,
//! more or less opaque, and in the colour of the Gaussians that are missing around them.

use super::geometry_syntax::Group;
use super::parameters::{DC, OPACITY};
use super::streams::Stream;
use crate::packed::bitstream::parameters::{CHANGES, KINDS, TARGETS};
use crate::packed::entropy::lanes::{LANES, Lanes, each};
use crate::packed::entropy::symbols::Symbols;

/// Largest step of a change. The limits of values are less than two of these steps apart.
pub(in crate::packed) const MOST_STEP: u32 = 1 << 26;
/// Number of classes that share a context, and number of such groups of classes.
const CLASS_WIDTH: u32 = 2;
const CLASSES: u32 = 8;
/// Number of sizes of the change of scales that have contexts of their own when the change of the opacity is coded.
const SCALES: u32 = 3;

/// Returns the kind of a change.
#[inline(always)]
fn kind(change: usize) -> usize {
    change.min(KINDS - 1)
}

/// Codes the interim changes of a group. `wanted` holds the changes that an encoder codes; a decoder ignores it.
#[cfg_attr(target_arch = "wasm32", inline(never))]
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
pub(in crate::packed) fn interim<S: Symbols>(
    s: &mut S,
    set: u32,
    group: &mut Group,
    wanted: &[Lanes; CHANGES],
) {
    let (shape, colour) = (&group.shape, &group.colour);
    let class = |l: usize, classes: &Lanes<u32>| (classes[l] / CLASS_WIDTH).min(CLASSES - 1);
    let context = each(|l| class(l, shape));
    group.interim[0] = s.signed(Stream::InterimScale.at(0), context, set, |l| wanted[0][l]);
    let growth = &group.interim[0];
    let context = each(|l| CLASSES * growth[l].unsigned_abs().min(SCALES - 1) + class(l, shape));
    group.interim[1] = s.signed(Stream::InterimOpacity.at(0), context, set, |l| wanted[1][l]);
    for (axis, k) in (0_u32..).zip(2..CHANGES) {
        let context = each(|l| CLASSES * axis + class(l, colour));
        group.interim[k] = s.signed(Stream::InterimDc.at(0), context, set, |l| wanted[k][l]);
    }
}

/// Adds the interim changes to `values` in the lanes of `lanes`.
#[inline(always)]
pub(in crate::packed) fn change(
    values: &mut [Lanes; TARGETS],
    interim: &[Lanes; CHANGES],
    steps: &[u32; KINDS],
    lanes: &Lanes<bool>,
) {
    for (t, values) in values.iter_mut().enumerate() {
        // One change is for all three scales.
        let k = (t + 1).saturating_sub(OPACITY);
        let step = steps[kind(k)].cast_signed();
        for l in 0..LANES {
            let by = if lanes[l] { interim[k][l].wrapping_mul(step) } else { 0 };
            values[l] = values[l].wrapping_add(by);
        }
    }
}

const _: () = assert!(DC == OPACITY + 1 && CLASSES * SCALES <= super::streams::CONTEXTS as u32);
