//! What is found in the values of a PLY.

use super::places::Places;

/// What `PlyFile::fill` found.
#[derive(Debug, Default)]
pub(super) struct Found {
    /// Rows with NaN or infinite values, ascending.
    pub(super) bad: Vec<usize>,
    /// The first such property of the first one, in INRIA's order.
    pub(super) bad_property: Option<String>,
    /// Whether any Gaussian whose values are all finite has a normal.
    pub(super) normals: bool,
    /// Number of infinite opacities.
    pub(super) sure: usize,
    /// What positions are like that are finer than f32, while the file is looked at.
    pub(super) places: Places,
    /// Number of Gaussians with a scale of minus infinity.
    pub(super) flat: usize,
}

impl Found {
    /// Adds what was found in the next rows.
    pub(super) fn add(&mut self, next: Self) {
        self.bad.extend(next.bad);
        self.bad_property = self.bad_property.take().or(next.bad_property);
        self.normals |= next.normals;
        self.sure += next.sure;
        self.places.add(next.places);
        self.flat += next.flat;
    }
}
