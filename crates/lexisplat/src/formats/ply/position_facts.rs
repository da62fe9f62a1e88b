//! Positions that single precision may not hold, and the offset that is subtracted from them before they are rounded.

use std::ops::Range;

use crate::scene::offset::Offset;
use crate::scene::rounding::Rounding;

/// Half the distance of neighbouring values in single precision is at most this share of the values.
const HALF_STEP: f64 = 1.0 / (1_u64 << 24) as f64;
/// Largest remaining rounding with an offset, as a share of the rounding without it. Otherwise the offset is not worth it.
const WORTH: f64 = 0.5;

/// Facts about positions in double precision.
#[derive(Debug, Default)]
pub(super) struct PositionFacts {
    /// The largest move of a position by rounding, along an axis.
    error: f64,
    /// The least and the largest coordinate along each axis.
    bounds: Option<[[f64; 3]; 2]>,
    /// A sample of positions with the sizes of their Gaussians, in the order of rows.
    sample: Vec<([f64; 3], f64)>,
}

/// The decision on an offset.
#[derive(Debug, PartialEq)]
pub(super) struct Settled {
    pub(super) offset: Option<Offset>,
    /// A warning about the rounding.
    pub(super) warnings: Vec<String>,
}

impl PositionFacts {
    /// Returns the facts about `rows` without the rows `bad`, which are sorted. One of `stride` rows is in the sample.
    pub(super) fn of(
        rows: Range<usize>,
        stride: usize,
        bad: &[usize],
        positions: &[f64],
        scales: &[f32],
    ) -> Self {
        let mut facts = Self::default();
        let (positions, scales) = (positions.as_chunks::<3>().0, scales.as_chunks::<3>().0);
        for (row, (position, scales)) in rows.zip(positions.iter().zip(scales)) {
            if bad.binary_search(&row).is_ok() {
                continue;
            }
            facts.see(*position);
            if row % stride == 0 {
                facts.sample.push((*position, Rounding::size_of(*scales)));
            }
        }
        facts
    }

    fn see(&mut self, position: [f64; 3]) {
        let [least, most] = self.bounds.get_or_insert([position; 2]);
        for (k, value) in position.into_iter().enumerate() {
            let rounded = f64::from(crate::scene::offset::single(value));
            self.error = self.error.max((value - rounded).abs());
            (least[k], most[k]) = (least[k].min(value), most[k].max(value));
        }
    }

    /// Adds the facts about the next rows.
    pub(super) fn add(&mut self, next: Self) {
        self.error = self.error.max(next.error);
        self.sample.extend(next.sample);
        let Some([lower, upper]) = next.bounds else { return };
        let [least, most] = self.bounds.get_or_insert([lower, upper]);
        for k in 0..3 {
            (least[k], most[k]) = (least[k].min(lower[k]), most[k].max(upper[k]));
        }
    }

    /// Decides on an offset. The result has one only if rounding without it would be coarse.
    pub(super) fn settle(self) -> Settled {
        let size = Rounding::median(self.sample.iter().map(|sampled| sampled.1).collect());
        let plain = Rounding { error: self.error, size };
        let Some(told) = plain.warning("32-bit floats") else {
            return Settled { offset: None, warnings: Vec::new() };
        };
        let left = |offset: Offset| Rounding { error: self.error_with(offset), size };
        let offset = self.offset().filter(|offset| left(*offset).error <= WORTH * plain.error);
        let Some(offset) = offset else { return Settled { offset: None, warnings: vec![told] } };
        let mut warnings = vec![format!("{told}; they are kept relative to an offset of {offset}")];
        warnings.extend(left(offset).warning("relative to the offset, 32-bit floats"));
        Settled { offset: Some(offset), warnings }
    }

    /// Returns a bound of the rounding of positions relative to `offset`; infinite if they leave single precision.
    fn error_with(&self, offset: Offset) -> f64 {
        let farthest = self.bounds.iter().flatten().fold(0.0_f64, |most, corner| {
            corner.iter().zip(offset.get()).fold(most, |most, (v, o)| most.max((v - o).abs()))
        });
        if farthest < f64::from(f32::MAX) { farthest * HALF_STEP } else { f64::INFINITY }
    }

    /// Returns the median of the sample along each axis, rounded to a multiple of a power of two near half the extent of
    /// most of the sample. It has few digits, and subtracting it from a position is exact. A few Gaussians far away
    /// hardly change it.
    fn offset(&self) -> Option<Offset> {
        let along = [0, 1, 2].map(|axis| {
            let mut along: Vec<f64> = self.sample.iter().map(|sampled| sampled.0[axis]).collect();
            along.sort_unstable_by(f64::total_cmp);
            along
        });
        let at = |axis: usize, part: usize, parts: usize| {
            let along: &Vec<f64> = &along[axis];
            along.get(along.len() * part / parts).copied().unwrap_or(0.0)
        };
        let extent = (0..3).map(|axis| at(axis, 9, 10) - at(axis, 1, 10)).fold(0.0_f64, f64::max);
        let grid = if extent > 0.0 { libm::exp2(libm::floor(libm::log2(extent / 2.0))) } else { 0.0 };
        let round = |value: f64| if grid > 0.0 { libm::round(value / grid) * grid } else { value };
        Offset::new([0, 1, 2].map(|axis| round(at(axis, 1, 2)))).ok().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `count` positions around `centre` in a cube of side 2, and sizes of `size`.
    fn facts(centre: [f64; 3], count: usize, size: f64) -> PositionFacts {
        let positions: Vec<f64> = (0..count)
            .flat_map(|i| {
                let k = i as f64 / count as f64;
                [k, (k * 7.0).fract(), (k * 31.0).fract()].map(|v| 2.0 * v - 1.0)
            })
            .zip(centre.into_iter().cycle())
            .map(|(v, c)| c + v)
            .collect();
        let scale = crate::scene::offset::single(libm::log(size));
        PositionFacts::of(0..count, 2, &[3], &positions, &vec![scale; 3 * count])
    }

    #[test]
    fn only_far_positions_get_an_offset() {
        for centre in [[0.0; 3], [100.0, 0.0, -30.0]] {
            assert_eq!(facts(centre, 500, 0.05).settle(), Settled { offset: None, warnings: Vec::new() });
        }
        let found = facts([500_000.4, 4_649_776.3, 100.0], 500, 0.05).settle();
        assert_eq!(found.offset, Offset::new([500_000.5, 4_649_776.5, 100.0]).unwrap());
        assert_eq!(found.warnings.len(), 1, "{:?}", found.warnings);
        let said = "32-bit floats move positions by up to 0.25, and the median Gaussian has a size of 0.050; they are \
                    kept relative to an offset of 500000.5, 4649776.5, 100";
        assert_eq!(found.warnings[0], said);
    }

    /// If no offset helps, there is a warning.
    #[test]
    fn a_rounding_that_is_left_is_told() {
        let mut wide = facts([0.0; 3], 500, 1e-9);
        wide.add(PositionFacts::of(500..501, 1, &[], &[1e7, 0.0, 0.0], &[0.0; 3]));
        let found = wide.settle();
        assert_eq!((found.offset, found.warnings.len()), (None, 1));
        let mut far = facts([5e8, 0.0, 0.0], 500, 0.01);
        far.add(PositionFacts::of(500..501, 1, &[], &[5.02e8, 0.0, 0.0], &[0.0; 3]));
        let found = far.settle();
        assert!(found.offset.is_some());
        assert!(found.warnings[1].starts_with("relative to the offset, 32-bit floats move"), "{found:?}");
    }

    #[test]
    fn rows_may_come_in_any_pieces() {
        let whole = facts([4e6, 1e6, 4e6], 300, 0.02);
        let (positions, sizes): (Vec<_>, Vec<_>) = whole.sample.iter().copied().unzip();
        assert_eq!((positions.len(), sizes.len()), (150, 150));
        let flat = positions.as_flattened();
        let scales = vec![crate::scene::offset::single(libm::log(0.02)); flat.len()];
        let piece = |range: Range<usize>| {
            let values = 3 * range.start..3 * range.end;
            PositionFacts::of(range, 1, &[], &flat[values.clone()], &scales[values])
        };
        let mut sum = PositionFacts::default();
        [0..1, 1..70, 70..150].map(piece).into_iter().for_each(|one| sum.add(one));
        assert_eq!(sum.settle(), piece(0..150).settle());
    }
}
