//! The interface of format readers: Gaussians, of which any range can be decoded.

use std::fmt::Debug;
use std::ops::Range;

use lexisplat::{SceneMeta, ShDegree};
use serde_json::Value;

/// Gaussians in the bytes of a file, or in bytes that were inflated from a file.
pub(crate) trait Rows: Debug + Send + Sync {
    /// Decodes Gaussians `range` into `out`, whose arrays must have the length of the range. Values have the axes of a
    /// trainer's PLY. Opacities may be infinite. The range must be within the scene.
    fn fill(&self, range: Range<usize>, out: RowsMut<'_>);

    /// Returns whether all values but opacities are finite for any content of the bytes.
    fn is_finite(&self) -> bool;
}

/// The arrays that [`Rows::fill`] fills, as in [`lexisplat::Geometry`] and [`lexisplat::Splats`].
#[derive(Debug)]
pub(crate) struct RowsMut<'a> {
    pub(crate) positions: &'a mut [[f32; 3]],
    /// SH coefficient 0 of each channel.
    pub(crate) dc: &'a mut [[f32; 3]],
    /// Opacities before the sigmoid.
    pub(crate) opacities: &'a mut [f32],
    /// Natural logarithms of the standard deviations.
    pub(crate) scales: &'a mut [[f32; 3]],
    /// Quaternions (w, x, y, z).
    pub(crate) rotations: &'a mut [[f32; 4]],
    /// SH-rest: `degree.rest()` values of each Gaussian, channel-major.
    pub(crate) sh_rest: &'a mut [f32],
}

impl RowsMut<'_> {
    /// Returns the same arrays with a shorter lifetime.
    pub(crate) fn reborrow(&mut self) -> RowsMut<'_> {
        RowsMut {
            positions: self.positions,
            dc: self.dc,
            opacities: self.opacities,
            scales: self.scales,
            rotations: self.rotations,
            sh_rest: self.sh_rest,
        }
    }
}

impl<'a> RowsMut<'a> {
    /// Splits off the first `n` Gaussians, which have `rest` values of SH-rest each.
    pub(crate) fn take(&mut self, n: usize, rest: usize) -> Self {
        fn split<'a, T>(from: &mut &'a mut [T], n: usize) -> &'a mut [T] {
            from.split_off_mut(..n).unwrap_or_default()
        }
        RowsMut {
            positions: split(&mut self.positions, n),
            dc: split(&mut self.dc, n),
            opacities: split(&mut self.opacities, n),
            scales: split(&mut self.scales, n),
            rotations: split(&mut self.rotations, n),
            sh_rest: split(&mut self.sh_rest, n * rest),
        }
    }
}

/// A file with a valid header and with all its Gaussians.
#[derive(Debug)]
pub(crate) struct Described<'a> {
    pub(crate) rows: Box<dyn Rows + 'a>,
    /// Number of Gaussians.
    pub(crate) len: usize,
    pub(crate) degree: ShDegree,
    pub(crate) meta: SceneMeta,
    /// Oddities of the file, one sentence each.
    pub(crate) warnings: Vec<String>,
    /// Facts about the file for `lexisplat info`, in order: names of JSON members, and values.
    pub(crate) facts: Vec<(&'static str, Value)>,
}
