//! Atoms and codes as decoders of every version make them.

use half::f16;

use crate::scene::sh::ShDegree;

/// Steps of atoms' coefficients are 2^-k for k up to this.
pub(super) const MAX_ATOM_BITS: u32 = 14;

/// Unit-norm atoms of whole numbers. `coded` gives the number of each coefficient, from its context and the number of
/// the coefficient among all.
pub(super) fn rounded_atoms(
    degree: ShDegree,
    atoms: usize,
    bits: u32,
    mut coded: impl FnMut(usize, usize) -> i64,
) -> Vec<f32> {
    let (dim, per_channel) = (degree.rest(), degree.rest_per_channel());
    let steps = f64::from(1_u32 << bits);
    let mut rows = Vec::with_capacity(atoms * dim);
    for j in 0..atoms {
        let mut row = Vec::with_capacity(dim);
        for d in 0..dim {
            // Coefficients of one degree are alike, whatever the channel.
            let context = (d % per_channel + 1).isqrt() - 1;
            #[expect(clippy::cast_precision_loss, reason = "small, or the norm check refuses it")]
            row.push(coded(context, j * dim + d) as f64 / steps);
        }
        let norm = row.iter().map(|x| x * x).sum::<f64>().sqrt();
        // An atom of zeros cannot be used; the first axis stands in so that the rest can be read.
        if norm == 0.0 {
            row[0] = 1.0;
        }
        let norm = if norm == 0.0 { 1.0 } else { norm };
        #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
        rows.extend(row.iter().map(|x| (x / norm) as f32));
    }
    rows
}

/// A code as it is kept in memory: by ascending atom, values in f16.
pub(super) fn resident(code: &[(u16, i32)], step: f32, out: &mut Vec<(u16, f16)>) {
    out.clear();
    #[expect(clippy::cast_precision_loss, reason = "f16 keeps less")]
    out.extend(code.iter().map(|&(atom, value)| (atom, f16::from_f32(value as f32 * step))));
    out.sort_by_key(|p| p.0);
}
