//! Facts about the values of a PLY.

use super::position_facts::PositionFacts;

/// The facts that `PlyFile::fill` finds.
#[derive(Debug, Default)]
pub(super) struct Found {
    /// Rows with NaN or infinite values, ascending.
    pub(super) bad: Vec<usize>,
    /// The first such property of the first of these rows, in INRIA's order.
    pub(super) bad_property: Option<String>,
    /// Whether any Gaussian whose values are all finite has a normal.
    pub(super) normals: bool,
    /// Number of infinite opacities.
    pub(super) sure: usize,
    /// Facts about positions that are finer than f32, until the offset is decided.
    pub(super) position_facts: PositionFacts,
    /// Number of Gaussians with a scale of minus infinity.
    pub(super) flat: usize,
}

impl Found {
    /// Adds the facts about the next rows.
    pub(super) fn add(&mut self, next: Self) {
        self.bad.extend(next.bad);
        self.bad_property = self.bad_property.take().or(next.bad_property);
        self.normals |= next.normals;
        self.sure += next.sure;
        self.position_facts.add(next.position_facts);
        self.flat += next.flat;
    }
}
