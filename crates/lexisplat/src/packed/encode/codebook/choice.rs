//! Choice of the number of atoms that a small scene learns, and of their precision.

use super::costs::Costs;
use super::{Codebook, PRICE, RateAndDistortion, StopRule, first_atoms, learn};
use crate::packed::bitstream::{WholeAtoms, axes};
use crate::scene::sh::ShDegree;
use crate::sparse::learn::unit_axis;
use crate::support::error::{Error, Result};
use crate::support::progress::Progress;

/// Divisors of the number of atoms that a scene justifies. Each quotient is tried as the number of learned atoms.
const DIVISORS: [usize; 3] = [4, 2, 1];
/// Steps of values that are tried, as shares of the usual step. With few atoms, errors are larger at the same step.
const STEPS: [f32; 5] = [1.0, 0.9, 0.8, 0.7, 0.6];
/// Price of an error above that of the reference, as a multiple of the usual price of an error. The reference is the first
/// dictionary that is tried, with at least as many learned atoms as coefficients. An error below that of the reference
/// earns nothing, so that pictures stay as good.
const EXCESS: f64 = 2.0;
/// Most bits by which atoms are rounded more coarsely than usual.
const FEWER_BITS: u32 = 3;
/// Least bits to which atoms are rounded.
const LEAST_BITS: u32 = 2;

/// A dictionary with its costs and its step of values.
pub(in crate::packed) struct Choice {
    pub(in crate::packed) atoms: WholeAtoms,
    pub(in crate::packed) costs: Costs,
    /// The step of values, as a share of the usual step.
    pub(in crate::packed) step: f32,
}

/// Returns the dictionary with the least cost: the bits of the codes of `rows` and of the dictionary itself, plus a price
/// for an error above that of the reference. The reference has `max(pays, coefficients)` learned atoms.
/// `bits_of(rows, atoms, costs)` returns the usual number of bits to which atoms are rounded.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled) if `progress` cancels.
pub(in crate::packed) fn choose(
    degree: ShDegree,
    rows: &[f32],
    classes: &[u8],
    pays: usize,
    bits_of: impl Fn(&[f32], &[f32], &Costs) -> u32,
    progress: &dyn Progress,
) -> Result<Choice> {
    let dim = degree.rest();
    let mut tried: Vec<(usize, bool, f32)> = vec![(pays.max(dim), false, 1.0)];
    let mut counts: Vec<usize> = DIVISORS.iter().map(|divisor| pays / divisor).collect();
    counts.insert(0, 0);
    counts.dedup();
    tried.extend(STEPS.iter().flat_map(|&step| counts.iter().map(move |&count| (count, true, step))));
    let mut usual_error = f64::INFINITY;
    let mut best: Option<(f64, Choice)> = None;
    for (count, with_axes, step) in tried {
        let scaled: Vec<f32> = rows.iter().map(|x| x / step).collect();
        let fixed = if with_axes { axes(degree) } else { Vec::new() };
        let mut first = first_atoms(dim, count, &scaled);
        first.extend(&fixed);
        let fixed = fixed.len() / dim;
        let (learned, costs) = learn(dim, &scaled, classes, first, fixed, StopRule::Balanced, progress)?;
        let usual = bits_of(&scaled, &learned, &costs);
        let no_code_pays = || {
            let book = Codebook::new(dim, learned.clone(), costs.clone());
            book.encode(&scaled, classes, StopRule::Balanced).pairs.is_empty()
        };
        if !with_axes && no_code_pays() {
            // A dictionary has at least one atom.
            let atoms = WholeAtoms::new(degree, &unit_axis(dim, 0).collect::<Vec<f32>>(), LEAST_BITS, false);
            return Ok(Choice { atoms, costs: Costs::initial(1, dim), step });
        }
        let own = learned.get(..learned.len() - fixed * dim).unwrap_or_default();
        let fewest = if own.is_empty() || !with_axes {
            usual
        } else {
            usual.saturating_sub(FEWER_BITS).max(LEAST_BITS)
        };
        for bits in (fewest..=usual).rev() {
            let atoms = WholeAtoms::new(degree, own, bits, with_axes);
            let RateAndDistortion { bits, error } =
                Codebook::new(dim, atoms.rows(), costs.clone()).rate_and_distortion(&scaled, classes);
            let error = error * f64::from(step) * f64::from(step);
            if best.is_none() {
                usual_error = error;
            }
            let bits = bits + 8.0 * atoms.write().len() as f64;
            let cost = f64::from(PRICE) * bits + EXCESS * (error - usual_error).max(0.0);
            if best.as_ref().is_none_or(|best| cost < best.0) {
                best = Some((cost, Choice { atoms, costs: costs.clone(), step }));
            }
        }
    }
    best.map(|best| best.1).ok_or_else(|| Error::parameter("atoms", 0, "at least one"))
}
