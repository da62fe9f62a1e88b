//! Refinements: each coarse step becomes one of three finer steps, and rotations get more of their low bits.

use super::coarseness::{FACTOR, dropped, factor};
use super::geometry_syntax::{Group, REFINED, coarsened};
use super::parameters::DC;
use super::streams::Stream;
use crate::packed::bitstream::broken::Broken;
use crate::packed::bitstream::parameters::TARGETS;
use crate::packed::entropy::lanes::{LANES, Lanes, each};
use crate::packed::entropy::shifts::power;
use crate::packed::entropy::symbols::Symbols;

/// Number of contexts by the number of coarse steps: none, one, more.
const BY_COUNT: u32 = 3;
/// Number of groups of classes, or of finenesses, with contexts of their own.
const CLASSES: u32 = 8;
/// Number of classes, and of finenesses, that share a context.
const CLASS_WIDTH: u32 = 2;
const FINENESS_WIDTH: u32 = 3;

/// Codes the refinement of a group from `missing` missing refinements to one fewer. Returns the rule that a damaged file
/// breaks.
#[cfg_attr(target_arch = "wasm32", inline(never))]
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
pub(in crate::packed) fn refine<S: Symbols>(
    s: &mut S,
    set: u32,
    group: &mut Group,
    missing: usize,
) -> Result<(), Broken> {
    let mut beyond = false;
    let finer = factor(missing - 1);
    for k in DC..REFINED {
        // Divisors are constants in each branch, since vector registers divide by nothing else.
        let (stream, class): (_, Lanes<u32>) = match k {
            DC..TARGETS => (Stream::FineDc, each(|l| group.colour[l] / CLASS_WIDTH)),
            _ => {
                let fineness = &group.fineness[k - TARGETS];
                (Stream::FinePosition, each(|l| fineness[l] / FINENESS_WIDTH))
            }
        };
        let counts = group.counts[k];
        let wanted = &group.wanted[k];
        let context: Lanes<u32> =
            each(|l| BY_COUNT * class[l].min(CLASSES - 1) + counts[l].unsigned_abs().min(BY_COUNT - 1));
        // Symbol 0 is the step towards zero, which occurs most.
        let symbols = s.symbols(stream.at(missing), context, set, |l| {
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
        let count = each(|l| dropped(full[l], missing) - dropped(full[l], missing - 1));
        let wanted = &group.wanted_rotation[k];
        let low = s.bits(Stream::Rotation.at(missing), count, set, |l| {
            wanted[l] >> dropped(full[l], missing - 1) & ((1 << count[l]) - 1)
        });
        for l in 0..LANES {
            group.rotation[k][l] = group.rotation[k][l].wrapping_mul(power(count[l])) | low[l];
        }
    }
    if beyond { Err(Broken("has a finer step above 2")) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::packed::entropy::lanes::has;
    use crate::packed::entropy::rans_decoder::SymbolDecoder;
    use crate::packed::entropy::rans_encoder::SymbolRecorder;
    use crate::packed::entropy::script::tables_of;
    use crate::packed::entropy::tables::Lookup;

    fn of<const N: usize, T: Copy>(values: &[T], first: usize) -> [Lanes<T>; N] {
        std::array::from_fn(|k| each_of(values, first + 7 * k))
    }

    fn each_of<T: Copy>(values: &[T], first: usize) -> Lanes<T> {
        std::array::from_fn(|l| values[(first + 5 * l) % values.len()])
    }

    /// Returns a group that has only the base of the values that it codes.
    fn group(refinements: usize, wanted: &[i32], codes: &[u32]) -> Group {
        let axis_bits: [Lanes<u32>; 2] = of(codes, 3);
        let axis_bits = axis_bits.map(|bits| bits.map(|b| 1 + b % 15));
        let full = |k: usize| &axis_bits[usize::from(k == 2)];
        let code: [Lanes<u32>; 3] = of(codes, 11);
        let wanted_rotation = std::array::from_fn(|k| each(|l| code[k][l] & ((1 << full(k)[l]) - 1)));
        let wanted: [Lanes; REFINED] = of(wanted, 0);
        let counts = wanted.map(|lanes| lanes.map(|w| coarsened(w, factor(refinements))));
        let zeros = [0; LANES];
        Group {
            number: [0; LANES],
            cell: [zeros; 3],
            colour: each_of(codes, 1).map(|c| c % 16),
            shape: [0; LANES],
            coarse: [zeros; TARGETS],
            steps: [zeros; TARGETS],
            base: counts,
            counts,
            rotation: std::array::from_fn(|k| {
                each(|l| wanted_rotation[k][l] >> dropped(full(k)[l], refinements))
            }),
            axis_bits,
            needle: [false; LANES],
            moves: [zeros; 3],
            fineness: of(codes, 2).map(|f: Lanes<u32>| f.map(|f| f % 24)),
            wanted,
            wanted_rotation,
            interim: Default::default(),
        }
    }

    fn assert_refined(group: &Group, wants: &Group, set: u32, missing: usize) {
        for l in (0..LANES).filter(|&l| has(set, l)) {
            for k in DC..REFINED {
                assert_eq!(group.counts[k][l], coarsened(wants.wanted[k][l], factor(missing)));
            }
            for k in 0..3 {
                let full = wants.axis_bits[usize::from(k == 2)][l];
                assert_eq!(group.rotation[k][l], wants.wanted_rotation[k][l] >> dropped(full, missing));
            }
        }
    }

    proptest! {
        #[test]
        fn refinements_lead_to_what_is_wanted(
            wanted in prop::collection::vec(prop_oneof![-20..20_i32, -1_000_000_000..=1_000_000_000], 20),
            codes in prop::collection::vec(any::<u32>(), 30),
            set in 1_u32..1 << LANES,
            refinements in 1..=crate::packed::bitstream::coarseness::MAX_REFINEMENTS,
        ) {
            let blank = group(refinements, &wanted, &codes);
            let (mut recorder, mut coded) = (SymbolRecorder::default(), blank.clone());
            for missing in (1..=refinements).rev() {
                refine(&mut recorder, set, &mut coded, missing).unwrap();
                assert_refined(&coded, &blank, set, missing - 1);
            }
            recorder.each(|_, symbol| assert!(symbol <= 2), |_, _| ());
            let (_, tables) = tables_of(&recorder).unwrap();
            let (range, lookup) = (recorder.finish(&tables, LANES), Lookup::new(&tables));
            let mut decoder = SymbolDecoder::new(&lookup, &range, LANES, false).unwrap();
            let zeros = [0; LANES];
            let mut decoded = Group { wanted: [zeros; REFINED], wanted_rotation: [[0; LANES]; 3], ..blank.clone() };
            for missing in (1..=refinements).rev() {
                refine(&mut decoder, set, &mut decoded, missing).unwrap();
                assert_refined(&decoded, &blank, set, missing - 1);
            }
            prop_assert_eq!(decoder.check_end(), Ok(()));
        }
    }
}
