//! Chooses the classes of Gaussians by what they do to pictures and by their own bits.
//!
//! A class that is off by a fraction of an octave costs little, and a class that its neighbours foretell takes few bits.
//! The encoder alone chooses, so the format knows nothing of this (docs/METHOD.md, "Steps").

use super::CHUNK;
use super::bits::zigzag;
use super::canonical::MortonKey;
use super::chunk_codec::{COLOUR, SHAPE, colour_context, shape_context};
use super::entropy::CONTEXTS;
use super::floor::{Floor, Wanted};
use super::morton;
use super::neighbours::{AVERAGES, Neighbours};
use super::parameters::{LAST_CLASS, Parameters};
use crate::scene::splats::Geometry;
use crate::support::maths::{exp2, log2};
use crate::support::parallel::map_chunks;

/// Bits that move with a class of colour and of shape, for each octave of its steps: about the number of values that
/// have these steps, less those that are mostly 0. Found by trial (docs/METHOD.md).
const VALUES: [f32; 2] = [2.5, 5.0];
/// Natural logarithm of 4, by which squared errors grow with each octave of a step.
const LN_4: f32 = 1.386_294_4;
/// Symbols of a class: its number, or its signed distance from what is expected.
const SYMBOLS: usize = 2 * LAST_CLASS as usize + 1;
/// Added to every count before bits are computed, so that classes that were not used have a finite cost.
const SMOOTHING: f32 = 0.25;

/// How often, or at how many bits, each symbol of each context is used, by kind of class.
type ByContext<T> = [[[T; SYMBOLS]; CONTEXTS]; 2];

/// Chooses classes of a scene or of its parts.
#[derive(Debug)]
pub(super) struct ClassChoice {
    pub(super) floor: Floor,
    bits: Box<ByContext<f32>>,
}

impl ClassChoice {
    /// Counts what the nearest `classes` within `floor` take. `scene` is the order of the file, or of a sample of it.
    pub(super) fn new(floor: Floor, classes: &[[f32; 2]], geometry: &Geometry, scene: &[MortonKey]) -> Self {
        let mut choice = Self { floor, bits: Box::new([[[0.0; SYMBOLS]; CONTEXTS]; 2]) };
        let mut counts = Box::new([[[0_u32; SYMBOLS]; CONTEXTS]; 2]);
        for Chosen { contexts, symbols, .. } in choice.choose(classes, geometry, scene, [f32::INFINITY; 2]) {
            for kind in 0..2 {
                counts[kind][contexts[kind]][symbols[kind]] += 1;
            }
        }
        for (bits, counts) in choice.bits.as_flattened_mut().iter_mut().zip(counts.as_flattened()) {
            #[expect(clippy::cast_precision_loss, reason = "an estimate")]
            let counts = counts.map(|count| count as f32 + SMOOTHING);
            let total: f32 = counts.iter().sum();
            *bits = counts.map(|count| log2(total / count));
        }
        choice
    }

    /// The classes of Gaussians, given those before they are rounded.
    pub(super) fn classes(
        &self,
        classes: &[[f32; 2]],
        geometry: &Geometry,
        scene: &[MortonKey],
    ) -> Vec<[u8; 2]> {
        self.choose(classes, geometry, scene, VALUES).iter().map(|chosen| chosen.classes).collect()
    }

    fn choose(
        &self,
        classes: &[[f32; 2]],
        geometry: &Geometry,
        scene: &[MortonKey],
        values: [f32; 2],
    ) -> Vec<Chosen> {
        let wanted = self.floor.wanted(classes, geometry, scene);
        let parts = map_chunks(scene.len(), CHUNK, |range| {
            let mut chunk = Walk {
                choice: self,
                parameters: &self.floor.parameters,
                values,
                neighbours: Neighbours::default(),
            };
            let placed = scene[range.clone()].iter().zip(&wanted[range]);
            placed.map(|(g, wanted)| chunk.step(*g, geometry, wanted)).collect::<Vec<Chosen>>()
        });
        parts.concat()
    }
}

/// The classes of a Gaussian, of colour and of shape, and how they are coded.
#[derive(Debug, Clone, Copy)]
struct Chosen {
    classes: [u8; 2],
    contexts: [usize; 2],
    symbols: [usize; 2],
}

/// Goes over a chunk as the coder does, with exact positions instead of decoded ones.
struct Walk<'a> {
    choice: &'a ClassChoice,
    parameters: &'a Parameters,
    values: [f32; 2],
    neighbours: Neighbours,
}

impl Walk<'_> {
    fn step(&mut self, placed: MortonKey, geometry: &Geometry, wanted: &[Wanted; 2]) -> Chosen {
        let cell = morton::decode(placed.cell).unwrap_or_default();
        #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
        let centre = self.parameters.centre(cell).map(|v| v as f32);
        let average = self.neighbours.average(centre, 0.5 * self.parameters.cell);
        let (around, known) = (average.unwrap_or([0.0; AVERAGES]), average.is_some());

        let first = colour_context(&around, known);
        let colour = self.best(0, first, &wanted[0], usize::from);
        let (second, nearest) = shape_context(colour, &around, known);
        let nearest = i64::try_from(nearest).unwrap_or_default();
        let symbol = |class: u8| usize::try_from(zigzag(i64::from(class) - nearest)).unwrap_or_default();
        let shape = self.best(1, second, &wanted[1], symbol);

        let mut values = [0.0; AVERAGES];
        values[COLOUR] = f32::from(colour);
        values[SHAPE] = f32::from(shape) - f32::from(colour);
        self.neighbours.push(geometry.positions[placed.index()], values);
        Chosen {
            classes: [colour, shape],
            contexts: [first, second],
            symbols: [usize::from(colour), symbol(shape)],
        }
    }

    /// The class of least cost among the nearest one and its two neighbours.
    fn best(&self, kind: usize, context: usize, wanted: &Wanted, symbol: impl Fn(u8) -> usize) -> u8 {
        let nearest = wanted.nearest();
        if self.values[kind].is_infinite() {
            return nearest;
        }
        let bits = &self.choice.bits[kind][context];
        let cost = |class: u8| {
            let off = f32::from(class) - wanted.class;
            // The error and the bits of values, in bits, where a class that is not off has the least sum.
            self.values[kind] * (exp2(2.0 * off) / LN_4 - off) + bits[symbol(class)]
        };
        let least = nearest.saturating_sub(1);
        let most = (nearest + 1).min(wanted.most);
        (least..=most).min_by(|&a, &b| cost(a).total_cmp(&cost(b))).unwrap_or(nearest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packed::canonical::Grid;
    use crate::support::testing::scene;

    /// A scene in the order of the file, and a floor that limits nothing.
    fn setting() -> (Geometry, Vec<MortonKey>, Floor) {
        let geometry = scene(400, 3).geometry;
        let grid = Grid::fit(&geometry.positions);
        let mut order = grid.keys(&geometry);
        order.sort_unstable();
        let parameters = Parameters { origin: grid.origin, cell: grid.cell, ..Parameters::default() };
        (geometry, order, Floor::none(parameters))
    }

    #[test]
    fn a_class_between_two_follows_its_neighbours() {
        let (geometry, scene, floor) = setting();
        // All Gaussians but every tenth are of class 4 of colour and 6 of shape. Those are a little nearer to the next
        // class, or at another one.
        for (off, expected) in [(0.55, [4, 6]), (2.0, [6, 8])] {
            let odd = |i: usize| if i % 10 == 5 { off } else { 0.0 };
            let classes: Vec<[f32; 2]> = (0..400).map(|i| [4.0 + odd(i), 6.0 + odd(i)]).collect();
            let choice = ClassChoice::new(floor.clone(), &classes, &geometry, &scene);
            let chosen = choice.classes(&classes, &geometry, &scene);
            for (i, found) in chosen.iter().enumerate() {
                assert_eq!(*found, if i % 10 == 5 { expected } else { [4, 6] }, "{i} {off}");
            }
        }
    }

    #[test]
    fn no_class_is_off_by_more_than_one_or_beyond_the_last() {
        let (geometry, scene, floor) = setting();
        let mut random = crate::support::rng::SplitMix64::new(7);
        let mut class = || (random.below(1900)) as f32 * 0.01 - 2.0;
        let classes: Vec<[f32; 2]> = (0..400).map(|_| [class(), class()]).collect();
        let choice = ClassChoice::new(floor, &classes, &geometry, &scene);
        for (found, wanted) in choice.classes(&classes, &geometry, &scene).iter().zip(&classes) {
            for kind in 0..2 {
                let nearest = wanted[kind].round().clamp(0.0, f32::from(LAST_CLASS));
                assert!(found[kind] <= LAST_CLASS && (f32::from(found[kind]) - nearest).abs() <= 1.0);
            }
        }
    }
}
