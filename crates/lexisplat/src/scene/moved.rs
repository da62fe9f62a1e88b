//! Moves of scenes, and changes of their offsets.

use super::offset::{Offset, move_by, shift};
use super::rounding::Rounding;
use super::splats::Splats;
use crate::support::error::{Error, Result};

impl Splats {
    /// Makes positions relative to `offset` instead of the scene's own offset. Every Gaussian stays at its place, except for
    /// rounding. A first view is removed unless the offset is the same. Returns the rounding.
    pub fn rebase(&mut self, offset: Option<Offset>) -> Rounding {
        let error = shift(&mut self.geometry.positions, self.meta.offset, offset);
        self.meta.view = self.meta.view.take().filter(|_| self.meta.offset == offset);
        self.meta.offset = offset;
        Rounding { error, size: self.median_size() }
    }

    /// Moves every Gaussian by `by`. The positions change if single precision can hold the result. If rounding would be
    /// [coarse](Rounding::is_coarse), positions stay as they are and the offset changes. A first view is removed.
    ///
    /// # Errors
    /// [`Error::Parameter`] for numbers that are not finite, and for positions that leave single precision.
    pub fn translate(&mut self, by: [f64; 3]) -> Result<()> {
        let all = Offset::numbers(self.meta.offset);
        let all = [0, 1, 2].map(|k| all[k] + by[k]);
        let offset = Offset::new(all)?;
        let mut moved = self.geometry.positions.clone();
        let rounding = Rounding { error: move_by(&mut moved, all), size: self.median_size() };
        if let Some(value) = moved.as_flattened().iter().find(|v| !v.is_finite()) {
            return Err(Error::parameter("position", value, "finite positions after all changes"));
        }
        self.meta.view = None;
        if rounding.is_coarse() {
            self.meta.offset = offset;
        } else {
            (self.geometry.positions, self.meta.offset) = (moved, None);
        }
        Ok(())
    }

    /// Returns the median of the sizes of a sample of Gaussians; 0 if there are none.
    #[must_use]
    pub fn median_size(&self) -> f64 {
        let chosen = super::rounding::sample(self.len());
        Rounding::median(self.geometry.scales.iter().step_by(chosen).map(|s| Rounding::size_of(*s)).collect())
    }
}

/// Makes the positions of both scenes relative to one offset ([`Offset::shared`]). Returns the larger of the two
/// roundings.
pub fn unite(a: &mut Splats, b: &mut Splats) -> Rounding {
    let shared = Offset::shared(&[(a.meta.offset, a.len() as u64), (b.meta.offset, b.len() as u64)]);
    let (a, b) = (a.rebase(shared), b.rebase(shared));
    if a.share() >= b.share() { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::offset::single;
    use crate::support::testing::scene;

    fn offset(numbers: [f64; 3]) -> Option<Offset> {
        Offset::new(numbers).unwrap()
    }

    #[test]
    fn small_moves_change_positions_and_large_ones_the_offset() {
        let original = scene(300, 7);
        let mut splats = original.clone();
        splats.translate([0.5, -0.25, 1.0]).unwrap();
        assert_eq!(splats.meta.offset, None);
        let expected = original.geometry.positions[5].map(f64::from);
        let expected = [expected[0] + 0.5, expected[1] - 0.25, expected[2] + 1.0].map(single);
        assert_eq!(splats.geometry.positions[5], expected);
        let mut splats = original.clone();
        splats.translate([5e5, 4_649_776.25, 0.0]).unwrap();
        assert_eq!(splats.meta.offset, offset([5e5, 4_649_776.25, 0.0]));
        assert_eq!(splats.geometry, original.geometry);
        splats.translate([-5e5, -4_649_776.25, 0.0]).unwrap();
        assert_eq!(splats, original);
        assert!(splats.translate([1e300, 0.0, 0.0]).is_err());
        assert_eq!(splats, original);
    }

    #[test]
    fn rebasing_says_what_it_rounds() {
        let mut splats = scene(300, 7);
        splats.meta.offset = offset([5e5, 0.0, 0.0]);
        let original = splats.clone();
        let rounding = splats.rebase(offset([5e5 + 1.0, 0.0, 0.0]));
        assert!(!rounding.is_coarse(), "{rounding:?}");
        let rounding = splats.rebase(None);
        assert!(rounding.is_coarse() && rounding.error > 0.01, "{rounding:?}");
        for (a, b) in splats.geometry.positions.iter().zip(&original.geometry.positions) {
            assert!((f64::from(a[0]) - f64::from(b[0]) - 5e5).abs() <= rounding.error + 1e-6);
        }
    }
}
