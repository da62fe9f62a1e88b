//! Computes the colour of a Gaussian seen from a direction, from dense or sparse SH-rest.

use std::borrow::Cow;

use lexisplat::sh::{C0, CHANNELS, COLOUR_OFFSET, MAX_COEFFICIENTS, rest_basis};
use lexisplat::{CodedRest, Column, Dictionary, ShDegree, SparseCodes};

use crate::scene::Scene;

/// Number of independent sums of a dot product, so that additions need not wait for each other. The number decides how
/// the result is rounded, so it is the same everywhere.
const LANES: usize = 4;
/// Lengths of an atom in memory, for the degrees from 1 on: its values, and zeros up to whole registers.
const PADDED: [usize; 4] = [16, 24, 48, 72];

/// The view-dependent colours of a scene.
///
/// A sparse code is expanded in registers, for the one Gaussian that is being coloured. Its colour has the same bits as that of
/// the decompressed scene, since [`lexisplat::reconstruct`] adds the same values in the same order.
#[derive(Debug)]
pub struct Radiance<'a> {
    degree: ShDegree,
    /// Highest degree that is evaluated; at most `degree`.
    shown: ShDegree,
    dc: &'a [[f32; 3]],
    rest: Rest<'a>,
}

#[derive(Debug)]
enum Rest<'a> {
    Dense(&'a [f32]),
    Sparse { codes: &'a SparseCodes, atoms: Cow<'a, [f32]> },
}

/// The atoms of a dictionary as they are multiplied with a basis.
#[cfg(feature = "gpu")]
#[derive(Debug)]
pub(crate) struct Atoms(Vec<f32>);

#[cfg(feature = "gpu")]
impl Atoms {
    pub(crate) fn of(dictionary: &Dictionary) -> Self {
        Self(padded(dictionary))
    }

    /// Returns the number of bytes in memory.
    pub(crate) fn bytes(&self) -> u64 {
        size_of_val(self.0.as_slice()) as u64
    }
}

type Basis = [f32; MAX_COEFFICIENTS - 1];

impl<'a> Radiance<'a> {
    /// Returns the radiance of `scene`. Only the dictionary is copied.
    #[must_use]
    pub fn new(scene: &Scene<'a>) -> Self {
        let rest = match scene {
            Scene::Dense(splats) => Rest::Dense(&splats.sh_rest),
            Scene::Sparse(model) => {
                Rest::Sparse { codes: model.codes(), atoms: Cow::Owned(padded(model.dictionary())) }
            }
        };
        let degree = scene.degree();
        Self { degree, shown: degree, dc: &scene.geometry().dc, rest }
    }

    /// Returns the radiance of Gaussians with dense SH of `degree`.
    #[cfg(feature = "gpu")]
    pub(crate) fn of_rows(degree: ShDegree, dc: &'a [[f32; 3]], rest: &'a [f32]) -> Self {
        Self { degree, shown: degree, dc, rest: Rest::Dense(rest) }
    }

    /// Returns the radiance of Gaussians with sparse codes over a dictionary of `degree`, which is given as its
    /// [`Atoms`]. Nothing is copied.
    #[cfg(feature = "gpu")]
    pub(crate) fn of_codes(
        degree: ShDegree,
        dc: &'a [[f32; 3]],
        codes: &'a SparseCodes,
        atoms: &'a Atoms,
    ) -> Self {
        Self { degree, shown: degree, dc, rest: Rest::Sparse { codes, atoms: Cow::Borrowed(&atoms.0) } }
    }

    /// Leaves out the bands above `degree`. `None` leaves out none.
    #[must_use]
    pub fn up_to(self, degree: Option<ShDegree>) -> Self {
        Self { shown: degree.map_or(self.degree, |most| most.min(self.degree)), ..self }
    }

    /// Returns the colour of Gaussian `i` for the unit vector `direction`, which points from the camera to the Gaussian:
    /// `max(0, 0.5 + C0 * dc + sum_k basis_k * rest_k)` in each channel, over the evaluated bands. The colour is NaN
    /// where the sum is not finite.
    ///
    /// # Panics
    /// If the scene has no Gaussian `i`.
    #[must_use]
    #[inline(always)]
    pub fn colour(&self, i: usize, direction: [f32; 3]) -> [f32; 3] {
        let per_channel = self.degree.rest_per_channel();
        let mut rest = [0.0; CHANNELS];
        if self.shown.rest_per_channel() > 0 {
            // The basis is zero above the evaluated degree, which leaves those bands out.
            let basis = rest_basis(self.shown, direction);
            rest = match &self.rest {
                Rest::Dense(all) => {
                    let dim = self.degree.rest();
                    dense(&all[i * dim..(i + 1) * dim], per_channel, &basis)
                }
                Rest::Sparse { codes, atoms } => match codes.row(i) {
                    CodedRest::Exact(row) => dense(row, per_channel, &basis),
                    CodedRest::Code(column) => sparse(column, atoms, per_channel, &basis),
                },
            };
        }
        std::array::from_fn(|c| {
            let sum = COLOUR_OFFSET + C0 * self.dc[i][c] + rest[c];
            if sum.is_finite() { sum.max(0.0) } else { f32::NAN }
        })
    }
}

/// Returns the dot products of the three channels of a channel-major row with the basis.
#[inline(always)]
fn dense(row: &[f32], per_channel: usize, basis: &Basis) -> [f32; CHANNELS] {
    // With a number of coefficients that the compiler knows, the loops become a few vector instructions.
    match per_channel {
        3 => dense_of::<3>(row, basis),
        8 => dense_of::<8>(row, basis),
        15 => dense_of::<15>(row, basis),
        24 => dense_of::<24>(row, basis),
        _ => [0.0; CHANNELS],
    }
}

/// Returns the result of [`dense`] for `N` coefficients a channel.
#[inline(always)]
fn dense_of<const N: usize>(row: &[f32], basis: &Basis) -> [f32; CHANNELS] {
    let mut sums = [0.0; CHANNELS];
    for (sum, channel) in sums.iter_mut().zip(row.as_chunks::<N>().0) {
        let mut lanes = [0.0_f32; LANES];
        let products: [f32; N] = std::array::from_fn(|k| channel[k] * basis[k]);
        for k in 0..N / LANES {
            for lane in 0..LANES {
                lanes[lane] += products[k * LANES + lane];
            }
        }
        for lane in 0..N % LANES {
            lanes[lane] += products[N / LANES * LANES + lane];
        }
        *sum = (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
    }
    sums
}

/// Returns the dot products of the three channels of a code's row with the basis.
#[inline(always)]
fn sparse(code: Column<'_>, atoms: &[f32], per_channel: usize, basis: &Basis) -> [f32; CHANNELS] {
    match per_channel {
        3 => dense_of::<3>(&sum::<{ PADDED[0] }>(code, atoms), basis),
        8 => dense_of::<8>(&sum::<{ PADDED[1] }>(code, atoms), basis),
        15 => dense_of::<15>(&sum::<{ PADDED[2] }>(code, atoms), basis),
        24 => dense_of::<24>(&sum::<{ PADDED[3] }>(code, atoms), basis),
        _ => [0.0; CHANNELS],
    }
}

/// Returns the sum of `value * atom` over the nonzeros of a code. The sums of all coefficients are independent of each other.
#[inline(always)]
fn sum<const N: usize>(code: Column<'_>, atoms: &[f32]) -> [f32; N] {
    let atoms = atoms.as_chunks::<N>().0;
    let mut sums = [0.0_f32; N];
    code.each(|atom, value| {
        for (sum, coefficient) in sums.iter_mut().zip(&atoms[atom]) {
            *sum += value * coefficient;
        }
    });
    sums
}

/// Returns the atoms, each filled up to its length in [`PADDED`].
fn padded(dictionary: &Dictionary) -> Vec<f32> {
    let Some(length) = usize::from(dictionary.degree().get()).checked_sub(1).map(|k| PADDED[k]) else {
        return Vec::new();
    };
    let mut atoms = vec![0.0; dictionary.len() * length];
    for (j, row) in atoms.chunks_exact_mut(length).enumerate() {
        row[..dictionary.dim()].copy_from_slice(dictionary.atom(j));
    }
    atoms
}
