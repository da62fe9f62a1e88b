//! The dictionary of a file: learned atoms as integers, and fixed atoms, which are the same in all files.

use std::f64::consts::FRAC_1_SQRT_2;

use serde::{Deserialize, Serialize};

use crate::packed::bitstream::broken::{BrokenHead, must};
use crate::packed::entropy::adaptive_bits::{BitDecoder, BitEncoder, Bits, SignedBitModel};
use crate::scene::sh::{CHANNELS, ShDegree};

/// An orthonormal basis of colours: grey, red against blue, and green against both.
const COLOURS: [[f64; CHANNELS]; CHANNELS] = [
    [0.577_350_269_189_625_7, 0.577_350_269_189_625_7, 0.577_350_269_189_625_7],
    [FRAC_1_SQRT_2, 0.0, -FRAC_1_SQRT_2],
    [0.408_248_290_463_863_1, -0.816_496_580_927_726_1, 0.408_248_290_463_863_1],
];
/// Number of SH degrees, and of sizes of neighbouring numbers, that have bit models of their own.
const DEGREES: usize = 4;
const SIZES: usize = 5;
/// Largest absolute value of an integer of an atom.
const MOST: i32 = (1 << 15) - 1;

/// The learned atoms as integers, and whether the fixed atoms follow them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::packed) struct WholeAtoms {
    degree: ShDegree,
    /// For each learned atom and each coefficient of a channel, the numbers of the three [`COLOURS`].
    numbers: Vec<i32>,
    with_axes: bool,
}

impl WholeAtoms {
    /// Rounds the atoms `rows` to multiples of `2^-bits`.
    pub(in crate::packed) fn new(degree: ShDegree, rows: &[f32], bits: u32, with_axes: bool) -> Self {
        let per_channel = degree.rest_per_channel();
        let mut numbers = Vec::with_capacity(rows.len());
        for row in rows.chunks_exact(degree.rest().max(1)) {
            for k in 0..per_channel {
                for colour in &COLOURS {
                    let sum: f64 =
                        (0..CHANNELS).map(|c| colour[c] * f64::from(row[c * per_channel + k])).sum();
                    #[expect(
                        clippy::cast_possible_truncation,
                        reason = "unit-norm atoms in at most 2^14 steps"
                    )]
                    numbers.push(libm::rint(sum * f64::from(1_u32 << bits)) as i32);
                }
            }
        }
        Self { degree, numbers, with_axes }
    }

    /// Codes the numbers of `learned` atoms. A decoder passes no numbers. The result has the decoded numbers.
    fn code(&self, coder: &mut dyn Bits, learned: usize) -> Self {
        let per_channel = self.degree.rest_per_channel();
        let mut models = [[[SignedBitModel::default(); SIZES]; CHANNELS]; DEGREES];
        let mut numbers: Vec<i32> = Vec::with_capacity(self.numbers.len());
        for _ in 0..learned {
            let first = numbers.len();
            for k in 0..per_channel {
                let of_degree = ((k + 1).isqrt() - 1).min(DEGREES - 1);
                for colour in 0..CHANNELS {
                    let size = |back: usize| {
                        let at = numbers.len().checked_sub(back).filter(|&at| at >= first);
                        at.and_then(|at| numbers.get(at)).map_or(0, |number| number.unsigned_abs())
                    };
                    // Sizes of the previous number of the same colour, and of the grey number of the same coefficient. Grey
                    // numbers have no such second number and use the one before the previous instead.
                    let around =
                        size(CHANNELS) + if colour > 0 { size(colour) / 2 } else { size(2 * CHANNELS) };
                    let around = ((u32::BITS - around.leading_zeros()) as usize).min(SIZES - 1);
                    let model = &mut models[of_degree][colour][around];
                    numbers.push(coder.signed(model, self.numbers.get(numbers.len()).copied().unwrap_or(0)));
                }
            }
        }
        Self { numbers, ..self.clone() }
    }

    /// Returns the bytes of the learned atoms, none if there are no learned atoms.
    pub(in crate::packed) fn write(&self) -> Vec<u8> {
        if self.learned() == 0 {
            return Vec::new();
        }
        let mut encoder = BitEncoder::default();
        self.code(&mut encoder, self.learned());
        encoder.finish()
    }

    /// Returns whether the fixed atoms follow the learned ones.
    pub(in crate::packed) fn with_axes(&self) -> bool {
        self.with_axes
    }

    /// Returns the SH degree of the atoms.
    pub(in crate::packed) fn degree(&self) -> ShDegree {
        self.degree
    }

    fn learned(&self) -> usize {
        self.numbers.len() / self.degree.rest().max(1)
    }

    /// Reads the bytes that [`Self::write`] wrote for `learned` atoms.
    ///
    /// # Errors
    /// The broken rule for bytes that are not exactly the bits of these atoms.
    pub(in crate::packed) fn read(
        bytes: &[u8],
        degree: ShDegree,
        learned: usize,
        with_axes: bool,
    ) -> Result<Self, BrokenHead> {
        let blank = Self { degree, numbers: Vec::new(), with_axes };
        if learned == 0 {
            must(bytes.is_empty(), || format!("the dictionary: {} bytes for no learned atom", bytes.len()))?;
            return Ok(blank);
        }
        let mut decoder = BitDecoder::new(bytes);
        let read = blank.code(&mut decoder, learned);
        if let Some(number) = read.numbers.iter().find(|number| number.abs() > MOST) {
            return Err(BrokenHead(format!("the dictionary: a number is {number}, above {MOST} in size")));
        }
        decoder.finish("the dictionary")?;
        Ok(read)
    }

    /// Returns the atoms as unit-norm rows, in channel-major order.
    pub(in crate::packed) fn rows(&self) -> Vec<f32> {
        let (dim, per_channel) = (self.degree.rest(), self.degree.rest_per_channel());
        let mut rows = Vec::with_capacity(self.numbers.len() + if self.with_axes { dim * dim } else { 0 });
        for numbers in self.numbers.chunks_exact(dim.max(1)) {
            let mut row = vec![0.0; dim];
            for (k, numbers) in numbers.chunks_exact(CHANNELS).enumerate() {
                let [grey, red, green] = [0, 1, 2].map(|colour| f64::from(numbers[colour]));
                for c in 0..CHANNELS {
                    row[c * per_channel + k] =
                        grey * COLOURS[0][c] + red * COLOURS[1][c] + green * COLOURS[2][c];
                }
            }
            let norm = row.iter().map(|x| x * x).sum::<f64>().sqrt();
            // No code can use an atom of zeros. The first axis replaces it, so that the other atoms can be read.
            if norm == 0.0 {
                row[0] = 1.0;
            }
            let norm = if norm == 0.0 { 1.0 } else { norm };
            #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
            rows.extend(row.iter().map(|x| (x / norm) as f32));
        }
        if self.with_axes {
            rows.extend(axes(self.degree));
        }
        rows
    }
}

/// Returns the fixed atoms: each coefficient alone, first in grey, then in the other colours.
pub(in crate::packed) fn axes(degree: ShDegree) -> Vec<f32> {
    let (dim, per_channel) = (degree.rest(), degree.rest_per_channel());
    let mut rows = vec![0.0; dim * dim];
    for (j, row) in rows.chunks_exact_mut(dim.max(1)).enumerate() {
        for (c, weight) in COLOURS[j / per_channel].iter().enumerate() {
            #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
            {
                row[c * per_channel + j % per_channel] = *weight as f32;
            }
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support::rng::SplitMix64;

    #[test]
    fn atoms_come_back_with_unit_norms() {
        let mut rng = SplitMix64::new(2);
        for (degree, learned, bits, with_axes) in
            [(1, 3, 5, true), (3, 40, 6, false), (4, 0, 4, true), (2, 1, 14, false)]
        {
            let degree = ShDegree::new(degree).unwrap();
            let dim = degree.rest();
            let rows: Vec<f32> = (0..learned)
                .flat_map(|_| {
                    let row: Vec<f32> = (0..dim).map(|_| (rng.next() % 2001) as f32 / 1000.0 - 1.0).collect();
                    let norm = row.iter().map(|x| x * x).sum::<f32>().sqrt();
                    row.into_iter().map(move |x| x / norm)
                })
                .collect();
            let atoms = WholeAtoms::new(degree, &rows, bits, with_axes);
            let bytes = atoms.write();
            assert_eq!(WholeAtoms::read(&bytes, degree, learned, with_axes), Ok(atoms.clone()));
            assert!(WholeAtoms::read(&[&bytes[..], &[7]].concat(), degree, learned, with_axes).is_err());
            let read = atoms.rows();
            assert_eq!(read.len(), (learned + if with_axes { dim } else { 0 }) * dim);
            for row in read.chunks_exact(dim) {
                let norm = row.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
                assert!((norm - 1.0).abs() < 1e-5, "{norm}");
            }
            let step = 1.0 / (1_u32 << bits) as f32;
            assert!(read.iter().zip(&rows).all(|(a, b)| (a - b).abs() < 2.0 * step));
        }
    }

    #[test]
    fn fixed_atoms_are_orthonormal() {
        let degree = ShDegree::new(3).unwrap();
        let rows = axes(degree);
        for (i, a) in rows.chunks_exact(45).enumerate() {
            for (j, b) in rows.chunks_exact(45).enumerate() {
                let product: f32 = a.iter().zip(b).map(|(x, y)| x * y).sum();
                assert!((product - if i == j { 1.0 } else { 0.0 }).abs() < 1e-6, "{i} {j} {product}");
            }
        }
    }
}
