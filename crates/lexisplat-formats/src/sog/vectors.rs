//! Rows of numbers, their sums and their distances.

/// Number of sums that are taken side by side. Widths of rows are multiples of it.
pub(super) const LANES: usize = 8;

/// Rows of numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rows<'a> {
    /// Values of all rows, row by row.
    pub(super) values: &'a [f32],
    /// Number of values of a row, a multiple of [`LANES`]. The last values may be padding, which is 0.
    pub(super) width: usize,
}

impl<'a> Rows<'a> {
    pub(super) fn len(self) -> usize {
        self.values.len() / self.width
    }

    pub(super) fn get(self, i: usize) -> &'a [f32] {
        &self.values[i * self.width..(i + 1) * self.width]
    }
}

/// Returns the squared distance of two rows.
pub(super) fn distance(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; LANES];
    for (a, b) in a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0) {
        for k in 0..LANES {
            let v = a[k] - b[k];
            sums[k] += v * v;
        }
    }
    let [a, b, c, d, e, f, g, h] = sums;
    ((a + b) + (c + d)) + ((e + f) + (g + h))
}

/// Adds a row to `sums`.
pub(super) fn add(sums: &mut [f64], row: &[f32]) {
    sums.iter_mut().zip(row).for_each(|(sum, v)| *sum += f64::from(*v));
}
