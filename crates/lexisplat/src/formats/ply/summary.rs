//! A description of a PLY for people and reports.

use serde::Serialize;

use super::header::{Format, Header, Property};
use super::layout::Layout;
use super::marks::mark;
use super::names::{DC, NORMAL, POSITION};
use crate::scene::extra::ScalarType;

/// The program that probably wrote a file, judged by its comments and the order of its properties.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Dialect {
    /// INRIA's code, or a program that writes the same layout: 3DGS-MCMC, Pixel-GS and this crate.
    Inria,
    /// gsplat's exporter: INRIA's order without normals.
    Gsplat,
    /// nerfstudio's `ns-export`.
    Nerfstudio,
    /// Brush.
    Brush,
    /// Postshot.
    Postshot,
    /// Another program.
    Other,
}

/// A description of a PLY, from which a [`Splats`](crate::Splats) was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct PlySummary {
    /// Probable writer.
    pub dialect: Dialect,
    /// The encoding of the values.
    pub format: Format,
    /// Number of bytes of the whole file.
    pub file_bytes: u64,
    /// Number of bytes of the header.
    pub header_bytes: u64,
    /// Number of bytes of one vertex in binary.
    pub row_bytes: u64,
    /// Number of vertices in the file, also dropped ones.
    pub vertices: u64,
    /// Number of vertices that were dropped because of NaN or infinite values.
    pub dropped: u64,
    /// Vertex properties in file order.
    pub properties: Vec<(String, ScalarType)>,
    /// Names of the elements other than the vertices.
    pub other_elements: Vec<String>,
}

impl PlySummary {
    /// Creates the description of a file of `file_bytes` bytes with this header. The caller sets `dropped`.
    pub(super) fn new(header: &Header, layout: &Layout, file_bytes: u64) -> Self {
        let vertex = &header.elements[layout.vertex];
        let scalar = |p: &Property| Some((p.name.clone(), p.kind.scalar()?));
        let properties: Vec<_> = vertex.properties.iter().filter_map(scalar).collect();
        let others = header.elements.iter().filter(|e| e.name != vertex.name);
        Self {
            dialect: dialect(&header.comments, &properties),
            format: header.format,
            file_bytes,
            header_bytes: header.bytes as u64,
            row_bytes: layout.row_bytes as u64,
            vertices: vertex.count,
            dropped: 0,
            other_elements: others.map(|e| e.name.clone()).collect(),
            properties,
        }
    }
}

fn dialect(comments: &[String], properties: &[(String, ScalarType)]) -> Dialect {
    let says = |part: &str| comments.iter().any(|c| c.to_ascii_lowercase().contains(part));
    let starts = |groups: &[&[&str]]| {
        let expected = groups.iter().copied().flatten();
        properties.len() >= groups.iter().map(|g| g.len()).sum()
            && expected.zip(properties).all(|(name, (found, _))| name == found)
    };
    if says("brush") || says("splatrendermode") {
        Dialect::Brush
    } else if says("nerfstudio") {
        Dialect::Nerfstudio
    } else if says("postshot") || comments.iter().any(|c| mark(c).is_some()) {
        Dialect::Postshot
    } else if starts(&[&POSITION, &NORMAL, &DC]) {
        Dialect::Inria
    } else if starts(&[&POSITION, &DC]) {
        Dialect::Gsplat
    } else {
        Dialect::Other
    }
}
