//! Feature maps between the layers of a network.

use rayon::prelude::*;

/// Features of all pixels, with a border of zeros for the next layer.
#[derive(Debug, Clone)]
pub(super) struct Map {
    /// Number of pixels in a row, without borders.
    pub(super) width: usize,
    /// Number of rows, without borders.
    pub(super) height: usize,
    /// Number of features of a pixel.
    pub(super) channels: usize,
    /// Width of the border, in pixels.
    pub(super) padding: usize,
    /// Values of the rows from the top, with borders. The features of a pixel lie together.
    pub(super) values: Vec<f32>,
}

impl Map {
    /// Returns a map of zeros.
    pub(super) fn zeros(width: usize, height: usize, channels: usize, padding: usize) -> Self {
        let values = vec![0.0; (width + 2 * padding) * (height + 2 * padding) * channels];
        Self { width, height, channels, padding, values }
    }

    /// Returns the number of entries from one row to the next.
    pub(super) fn row_entries(&self) -> usize {
        (self.width + 2 * self.padding) * self.channels
    }

    /// Returns the features of row `y`, without borders.
    pub(super) fn row(&self, y: usize) -> &[f32] {
        let start = (y + self.padding) * self.row_entries() + self.padding * self.channels;
        &self.values[start..start + self.width * self.channels]
    }

    /// Calls `f` on blocks of `rows` rows in parallel. `f` receives the scratch memory of its thread, the index of the
    /// first row, and the rows with their borders.
    pub(super) fn fill_blocks<S>(
        &mut self,
        rows: usize,
        scratch: impl Fn() -> S + Sync + Send,
        f: impl Fn(&mut S, usize, &mut [f32]) + Sync + Send,
    ) {
        let entries = self.row_entries();
        let inner = entries * self.padding..entries * (self.padding + self.height);
        self.values[inner]
            .par_chunks_mut(entries * rows)
            .enumerate()
            .for_each_init(scratch, |scratch, (block, values)| f(scratch, block * rows, values));
    }

    /// Returns the largest value of every window of `side` x `side` pixels within the map; windows are `stride` pixels
    /// apart (`torch.nn.MaxPool2d`). Returns `None` if no window fits.
    pub(super) fn max_pool(&self, side: usize, stride: usize, padding: usize) -> Option<Self> {
        let (width, height) = (windows(self.width, side, stride)?, windows(self.height, side, stride)?);
        let channels = self.channels;
        let mut out = Self::zeros(width, height, channels, padding);
        out.fill_blocks(
            1,
            || (),
            |(), y, row| {
                let pixels = row[padding * channels..].chunks_exact_mut(channels).take(width);
                for (x, pixel) in pixels.enumerate() {
                    pixel.fill(f32::NEG_INFINITY);
                    for dy in 0..side {
                        let from = &self.row(y * stride + dy)[x * stride * channels..][..side * channels];
                        for other in from.chunks_exact(channels) {
                            for (most, &value) in pixel.iter_mut().zip(other) {
                                *most = if value > *most { value } else { *most };
                            }
                        }
                    }
                }
            },
        );
        Some(out)
    }
}

/// Returns the number of windows of `side`, `stride` apart, that fit into `length`.
pub(super) fn windows(length: usize, side: usize, stride: usize) -> Option<usize> {
    Some(length.checked_sub(side)? / stride + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pooling_takes_the_largest_of_each_window() {
        let mut map = Map::zeros(5, 4, 2, 1);
        let channels = map.channels;
        map.fill_blocks(
            3,
            || (),
            |(), first, rows| {
                for (dy, row) in rows.chunks_exact_mut(7 * channels).enumerate() {
                    for (x, pixel) in row[channels..6 * channels].chunks_exact_mut(channels).enumerate() {
                        let value = u8::try_from((first + dy) * 5 + x).unwrap();
                        pixel.copy_from_slice(&[f32::from(value), -f32::from(value)]);
                    }
                }
            },
        );
        let pooled = map.max_pool(2, 2, 0).unwrap();
        assert_eq!((pooled.width, pooled.height), (2, 2));
        assert_eq!(pooled.values, [6.0, 0.0, 8.0, -2.0, 16.0, -10.0, 18.0, -12.0]);
        let pooled = map.max_pool(3, 2, 1).unwrap();
        assert_eq!((pooled.width, pooled.height), (2, 1));
        assert_eq!(pooled.row(0), [12.0, 0.0, 14.0, -2.0]);
        assert_eq!(pooled.values.len(), 4 * 3 * 2);
        assert!(map.max_pool(5, 2, 0).is_none());
    }
}
