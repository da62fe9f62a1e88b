//! The properties of a scene that a written file lacks.

use lexisplat::{Offset, ShDegree, Splats};
use serde::Serialize;

/// The properties of a scene that a written file lacks.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Lost {
    /// SH degrees of the scene and of the file, if the file's is lower.
    pub sh_degree: Option<[u8; 2]>,
    /// Names of extra properties that were left out.
    pub extras: Vec<String>,
    /// Whether normals were left out.
    pub normals: bool,
    /// Whether the mark of anti-aliasing was left out.
    pub antialiased: bool,
    /// Offset that was left out. Positions in the file are relative to it.
    pub offset: Option<Offset>,
    /// Descriptions of how values are rounded, one phrase each; empty if values are exact.
    pub precision: Vec<String>,
    /// Number of values that were out of the format's range. The file has the end of the range instead.
    pub limited: u64,
    /// Descriptions of roundings that are coarse relative to the sizes of Gaussians, one sentence each.
    pub coarse: Vec<String>,
}

impl Lost {
    /// Returns the properties of `splats` that a file of `degree` without extras and normals lacks. `antialiased` tells
    /// whether the file keeps the mark of anti-aliasing.
    pub(crate) fn beside(splats: &Splats, degree: ShDegree, antialiased: bool) -> Self {
        Self {
            sh_degree: (degree < splats.degree).then(|| [splats.degree.get(), degree.get()]),
            extras: splats.geometry.extras.iter().map(|extra| extra.name.clone()).collect(),
            normals: !splats.geometry.normals.is_empty(),
            antialiased: splats.meta.antialiased && !antialiased,
            offset: splats.meta.offset,
            ..Self::default()
        }
    }
}
