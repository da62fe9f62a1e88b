//! Gaussians as rows of bytes and back, for temporary files.

use super::read::{ReadOptions, read_bytes};
use super::rows::ROWS_PER_TASK;
use super::write::{RowLayout, header};
use crate::scene::splats::{SceneMeta, Splats};
use crate::support::error::Result;
use crate::support::parallel::for_each_chunk_mut;

/// The rows of a PLY of scenes like a given one, which have no normals.
pub(crate) struct RowBytes {
    like: Splats,
    layout: RowLayout,
    names: Vec<String>,
    meta: SceneMeta,
}

impl RowBytes {
    /// For scenes like `empty`.
    pub(crate) fn new(empty: &Splats) -> Self {
        let mut like = Splats { meta: SceneMeta::default(), ..empty.clone() };
        // Any name may come out of a .lexi; not all can stand in a header.
        let rename = |(k, extra): (usize, &mut crate::scene::splats::Extra)| {
            std::mem::replace(&mut extra.name, format!("extra_{k}"))
        };
        let names = like.geometry.extras.iter_mut().enumerate().map(rename).collect();
        let layout = RowLayout::new(&like);
        Self { like, layout, names, meta: empty.meta.clone() }
    }

    /// Bytes of a row.
    pub(crate) fn bytes(&self) -> usize {
        self.layout.row_bytes
    }

    /// Puts the rows of `splats` into `bytes`.
    pub(crate) fn pack(&self, splats: &Splats, bytes: &mut Vec<u8>) {
        bytes.clear();
        bytes.resize(splats.len() * self.bytes(), 0);
        for_each_chunk_mut(bytes, self.bytes() * ROWS_PER_TASK, |chunk, rows| {
            self.layout.pack(splats, chunk * ROWS_PER_TASK, rows);
        });
    }

    /// The Gaussians of `rows`.
    pub(crate) fn unpack(&self, rows: &[u8]) -> Result<Splats> {
        let mut file = header(&self.like, rows.len() / self.bytes()).into_bytes();
        file.extend_from_slice(rows);
        let mut splats = read_bytes("temporary file", &file, &ReadOptions::default())?.splats;
        for (extra, name) in splats.geometry.extras.iter_mut().zip(&self.names) {
            extra.name.clone_from(name);
        }
        splats.meta = self.meta.clone();
        Ok(splats)
    }
}
