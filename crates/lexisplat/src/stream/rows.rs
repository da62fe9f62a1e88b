//! Gaussians as rows of bytes, for temporary files.

use crate::scene::extra::{Extra, for_extra};
use crate::scene::splats::{Geometry, Splats};
use crate::support::parallel::for_each_chunk_mut;

/// Number of rows that one thread converts at a time.
const CHUNK_ROWS: usize = 1024;

/// The layout of the rows of scenes with the properties of a given scene and without normals. A row has the Gaussian's
/// values of each array one after the other, as they lie in memory.
pub(crate) struct RowLayout {
    like: Splats,
    /// Number of bytes of one Gaussian in each array.
    widths: Vec<usize>,
}

impl RowLayout {
    /// Creates the layout for scenes with the properties of `empty`, which has no Gaussians.
    pub(crate) fn new(empty: Splats) -> Self {
        let float = size_of::<f32>();
        let mut widths: Vec<usize> =
            [3, 3, empty.degree.rest(), 1, 3, 4].iter().map(|values| values * float).collect();
        widths.extend(empty.geometry.extras.iter().map(|extra| extra.values.width()));
        Self { like: empty, widths }
    }

    /// Returns the number of bytes of a row.
    pub(crate) fn bytes(&self) -> usize {
        self.widths.iter().sum()
    }

    /// Replaces `rows` by the rows of `splats`. The values of `splats` do not change.
    pub(crate) fn pack(&self, splats: &mut Splats, rows: &mut Vec<u8>) {
        rows.clear();
        rows.resize(splats.len() * self.bytes(), 0);
        let columns = columns(splats);
        for_each_chunk_mut(rows, self.bytes() * CHUNK_ROWS, |chunk, rows| {
            for (i, row) in (chunk * CHUNK_ROWS..).zip(rows.chunks_exact_mut(self.bytes())) {
                let mut rest = row;
                for (column, &width) in columns.iter().zip(&self.widths) {
                    let (value, tail) = rest.split_at_mut(width);
                    value.copy_from_slice(&column[i * width..][..width]);
                    rest = tail;
                }
            }
        });
    }

    /// Returns the Gaussians of `rows`.
    pub(crate) fn unpack(&self, rows: &[u8]) -> Splats {
        let n = rows.len() / self.bytes();
        let mut splats = self.like.clone();
        splats.sh_rest = vec![0.0; n * splats.degree.rest()];
        splats.geometry = Geometry { extras: splats.geometry.extras, ..Geometry::zeros(n) };
        for Extra { values, .. } in &mut splats.geometry.extras {
            for_extra!(values, v => v.resize(n, Default::default()));
        }
        let mut offset = 0;
        for (column, &width) in columns(&mut splats).into_iter().zip(&self.widths) {
            // Scenes of SH degree 0 have no SH-rest, so the width may be 0.
            for_each_chunk_mut(column, (width * CHUNK_ROWS).max(1), |chunk, values| {
                let rows = rows[chunk * CHUNK_ROWS * self.bytes()..].chunks_exact(self.bytes());
                for (value, row) in values.chunks_exact_mut(width).zip(rows) {
                    value.copy_from_slice(&row[offset..offset + width]);
                }
            });
            offset += width;
        }
        splats
    }
}

/// Returns the bytes of every array, in the order of a row.
fn columns(splats: &mut Splats) -> Vec<&mut [u8]> {
    let g = &mut splats.geometry;
    let mut out: Vec<&mut [u8]> = vec![
        bytemuck::cast_slice_mut(&mut g.positions),
        bytemuck::cast_slice_mut(&mut g.dc),
        bytemuck::cast_slice_mut(&mut splats.sh_rest),
        bytemuck::cast_slice_mut(&mut g.opacities),
        bytemuck::cast_slice_mut(&mut g.scales),
        bytemuck::cast_slice_mut(&mut g.rotations),
    ];
    out.extend(
        g.extras.iter_mut().map(|extra| for_extra!(&mut extra.values, v => bytemuck::cast_slice_mut(v))),
    );
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ShDegree, SplatSource};

    #[test]
    fn rows_give_the_scene_back() {
        for (count, degree) in [(0, 3), (1, 0), (2 * CHUNK_ROWS + 7, 1)] {
            let mut splats = crate::support::testing::scene(count, 3);
            splats = splats.with_degree_cut(ShDegree::new(degree).unwrap());
            let numbers = || (0..count).map(|i| i as f64);
            splats.geometry.extras = vec![
                Extra { name: "a_name".into(), values: vec![7_u8; count].into() },
                Extra { name: String::new(), values: numbers().collect::<Vec<f64>>().into() },
            ];
            splats.meta.comments = vec!["a".into()];
            let layout = RowLayout::new(splats.empty());
            let mut rows = vec![1];
            layout.pack(&mut splats, &mut rows);
            assert_eq!(rows.len(), count * layout.bytes());
            assert_eq!(layout.unpack(&rows), splats);
        }
    }
}
