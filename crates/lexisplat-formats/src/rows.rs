//! What a reader of a format gives: Gaussians that any range can be decoded of.

use std::fmt::Debug;
use std::ops::Range;

use lexisplat::{SceneMeta, ShDegree};
use serde_json::Value;

/// Gaussians in the bytes of a file, or in bytes that were inflated from it.
pub(crate) trait Rows: Debug + Send + Sync {
    /// Decodes Gaussians `range` into `out`, whose arrays have as many entries. All have the axes of a trainer's PLY.
    /// Opacities may be infinite. The range is within the scene.
    fn fill(&self, range: Range<usize>, out: RowsMut<'_>);

    /// Whether all values but opacities are finite, whatever the bytes are.
    fn is_finite(&self) -> bool;
}

/// The arrays that [`Rows::fill`] fills, as in [`lexisplat::Geometry`] and [`lexisplat::Splats`].
#[derive(Debug)]
pub(crate) struct RowsMut<'a> {
    pub(crate) positions: &'a mut [[f32; 3]],
    /// SH coefficient 0.
    pub(crate) dc: &'a mut [[f32; 3]],
    /// Before the sigmoid.
    pub(crate) opacities: &'a mut [f32],
    /// Natural logarithms.
    pub(crate) scales: &'a mut [[f32; 3]],
    /// (w, x, y, z).
    pub(crate) rotations: &'a mut [[f32; 4]],
    /// `degree.rest()` values a Gaussian, channel-major within each.
    pub(crate) sh_rest: &'a mut [f32],
}

impl RowsMut<'_> {
    /// The same arrays for a while.
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
    /// Takes away the first `n` Gaussians, of `rest` values of SH-rest each.
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

/// A file whose header is valid and whose Gaussians are all there.
#[derive(Debug)]
pub(crate) struct Described<'a> {
    pub(crate) rows: Box<dyn Rows + 'a>,
    /// Number of Gaussians.
    pub(crate) len: usize,
    pub(crate) degree: ShDegree,
    pub(crate) meta: SceneMeta,
    /// What is odd about the file, one sentence each.
    pub(crate) warnings: Vec<String>,
    /// What `lexisplat info` says of the file, in order: names as in JSON, and values.
    pub(crate) facts: Vec<(&'static str, Value)>,
}
