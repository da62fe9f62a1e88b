//! The offset of a scene that is too far from the origin for positions in single precision.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::support::error::{Error, Result};

/// Three numbers that are added to every position, in double precision, to get to the world of the scene's file. At least
/// one number is not 0, and all are finite.
///
/// Coordinates of surveys are millions of units from the origin. Single precision has steps of half a unit there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "[f64; 3]", into = "[f64; 3]")]
pub struct Offset([f64; 3]);

// None of the numbers is NaN.
impl Eq for Offset {}

impl Offset {
    /// Returns the offset of these three numbers; `None` if all are 0.
    ///
    /// # Errors
    /// [`Error::Parameter`] for numbers that are not finite.
    pub fn new(numbers: [f64; 3]) -> Result<Option<Self>> {
        if numbers.iter().any(|v| !v.is_finite()) {
            // Formatting numbers would add 10 kB to the decoder of web pages.
            return Err(Error::parameter("offset", "NaN or an infinity", "three finite numbers"));
        }
        Ok(numbers.iter().any(|v| *v != 0.0).then_some(Self(numbers)))
    }

    /// Returns the three numbers.
    #[must_use]
    pub fn get(self) -> [f64; 3] {
        self.0
    }

    /// Returns the numbers of `offset`; zeros if there is none.
    #[must_use]
    pub fn numbers(offset: Option<Self>) -> [f64; 3] {
        offset.map_or([0.0; 3], Self::get)
    }

    /// Returns the one offset of a scene of several tiles, each with its offset and its number of Gaussians. Along each axis
    /// it is the offset of the tile in the middle. Tiles without an offset do not count, because they are near the origin or
    /// large.
    #[must_use]
    pub fn shared(tiles: &[(Option<Self>, u64)]) -> Option<Self> {
        let tiles: Vec<([f64; 3], u64)> = tiles.iter().filter_map(|p| Some((p.0?.get(), p.1))).collect();
        let total = tiles.iter().map(|tile| tile.1).fold(0, u64::saturating_add);
        let middle = |axis: usize| {
            let mut along: Vec<(f64, u64)> = tiles.iter().map(|tile| (tile.0[axis], tile.1)).collect();
            along.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut before = 0_u64;
            let found = along.iter().find(|(_, count)| {
                before = before.saturating_add(*count);
                before > total / 2
            });
            found.or(along.last()).map_or(0.0, |tile| tile.0)
        };
        Self::new([middle(0), middle(1), middle(2)]).ok().flatten()
    }
}

impl TryFrom<[f64; 3]> for Offset {
    type Error = Error;

    fn try_from(numbers: [f64; 3]) -> Result<Self> {
        let zero = || Error::parameter("offset", "0, 0, 0", "a number that is not 0, or no offset");
        Self::new(numbers)?.ok_or_else(zero)
    }
}

impl From<Offset> for [f64; 3] {
    fn from(offset: Offset) -> Self {
        offset.0
    }
}

impl fmt::Display for Offset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.0;
        write!(f, "{x}, {y}, {z}")
    }
}

/// Makes positions that are relative to `from` relative to `to`. Returns the largest move of a position by rounding,
/// along an axis.
pub(crate) fn shift(positions: &mut [[f32; 3]], from: Option<Offset>, to: Option<Offset>) -> f64 {
    if from == to {
        return 0.0;
    }
    let (from, to) = (Offset::numbers(from), Offset::numbers(to));
    move_by(positions, [0, 1, 2].map(|k| from[k] - to[k]))
}

/// Moves `positions`. Returns the largest move of a position by rounding, along an axis.
pub(super) fn move_by(positions: &mut [[f32; 3]], by: [f64; 3]) -> f64 {
    let mut most = 0.0_f64;
    for position in positions {
        for (value, by) in position.iter_mut().zip(by) {
            let exact = f64::from(*value) + by;
            *value = single(exact);
            most = most.max((exact - f64::from(*value)).abs());
        }
    }
    most
}

/// Returns `value` in single precision; infinite if it is too large.
#[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
pub(crate) fn single(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offset(numbers: [f64; 3]) -> Option<Offset> {
        Offset::new(numbers).unwrap()
    }

    #[test]
    fn the_part_in_the_middle_has_the_offset_of_all() {
        let tiles = [([8e5, 1.0, 0.0], 10), ([5e5, 0.0, 0.0], 15), ([9e5, 2.0, 0.0], 8)];
        let tiles = tiles.map(|(numbers, count)| (offset(numbers), count));
        assert_eq!(Offset::shared(&tiles), offset([8e5, 1.0, 0.0]));
        assert_eq!(Offset::shared(&[(None, 3), (None, 4)]), None);
        assert_eq!(Offset::shared(&[(None, 9), (offset([1e6; 3]), 4)]), offset([1e6; 3]));
        assert_eq!(Offset::shared(&[]), None);
        assert!(Offset::new([f64::NAN, 0.0, 0.0]).is_err());
    }
}
