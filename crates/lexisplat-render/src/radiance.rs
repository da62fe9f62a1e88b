//! Computes the colour of a Gaussian seen from a direction, from dense or sparse SH-rest.

use std::borrow::Cow;

use glam::Vec4;
use lexisplat::sh::{C0, CHANNELS, COLOUR_OFFSET, MAX_COEFFICIENTS, rest_basis};
use lexisplat::{CodedRest, Column, Dictionary, ShDegree, SparseCodes};

use crate::scene::Scene;

/// Number of independent sums of a dot product, so that additions need not wait for each other. The number decides how
/// the result is rounded, so it is the same everywhere.
const LANES: usize = 4;
/// Number of values of a coefficient of an atom in memory: one for each channel, and a zero, so that they fill a register.
const PADDED: usize = 4;

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
    pub fn colour(&self, i: usize, direction: [f32; 3]) -> [f32; 3] {
        let mut only = [(i, direction)];
        self.colours(&mut only, |&seen| seen, |only, colour| only.1 = colour);
        only[0].1
    }

    /// Gives each of `items` its [`Self::colour`]. `seen` returns the Gaussian of an item and the direction to it.
    ///
    /// # Panics
    /// If the scene does not have a Gaussian that `seen` returns.
    #[inline(always)]
    pub(crate) fn colours<T>(
        &self,
        items: &mut [T],
        seen: impl Fn(&T) -> (usize, [f32; 3]),
        set: impl Fn(&mut T, [f32; 3]),
    ) {
        if self.shown.rest_per_channel() == 0 {
            return self.each(items, seen, set, |_, _| [0.0; CHANNELS]);
        }
        // With a number of coefficients that the compiler knows, the loops over them become a few vector instructions.
        match self.degree.rest_per_channel() {
            3 => self.colours_of::<T, 3, { 3 * PADDED }>(items, seen, set),
            8 => self.colours_of::<T, 8, { 8 * PADDED }>(items, seen, set),
            15 => self.colours_of::<T, 15, { 15 * PADDED }>(items, seen, set),
            _ => self.colours_of::<T, 24, { 24 * PADDED }>(items, seen, set),
        }
    }

    /// Does the work of [`Self::colours`] for `N` coefficients a channel, for which an atom takes `LEN` values in memory.
    #[inline(always)]
    fn colours_of<T, const N: usize, const LEN: usize>(
        &self,
        items: &mut [T],
        seen: impl Fn(&T) -> (usize, [f32; 3]),
        set: impl Fn(&mut T, [f32; 3]),
    ) {
        match &self.rest {
            Rest::Dense(all) => {
                let rows = all.as_chunks::<N>().0.as_chunks::<CHANNELS>().0;
                self.each(
                    items,
                    seen,
                    set,
                    #[inline(always)]
                    |i, direction| dense(&rows[i], &rest_basis(self.shown, direction)),
                );
            }
            Rest::Sparse { codes, atoms } => {
                let atoms = atoms.as_chunks::<LEN>().0;
                let mut rows = codes.rows();
                self.each(
                    items,
                    seen,
                    set,
                    #[inline(always)]
                    |i, direction| match rows.row(i) {
                        CodedRest::Code(column) if column.is_empty() => [0.0; CHANNELS],
                        CodedRest::Code(column) => {
                            sparse::<N, LEN>(column, atoms, &rest_basis(self.shown, direction))
                        }
                        CodedRest::Exact(row) => match row.as_chunks::<N>().0.as_chunks::<CHANNELS>().0 {
                            [row, ..] => dense(row, &rest_basis(self.shown, direction)),
                            [] => [0.0; CHANNELS],
                        },
                    },
                );
            }
        }
    }

    /// Colours `items`. `rest` returns the sum over all bands but the first for a Gaussian and the direction to it. The basis is
    /// zero above the evaluated degree, which leaves those bands out.
    #[inline(always)]
    fn each<T>(
        &self,
        items: &mut [T],
        seen: impl Fn(&T) -> (usize, [f32; 3]),
        set: impl Fn(&mut T, [f32; 3]),
        mut rest: impl FnMut(usize, [f32; 3]) -> [f32; CHANNELS],
    ) {
        for item in items {
            let (i, direction) = seen(item);
            set(item, self.finished(i, rest(i, direction)));
        }
    }

    /// Returns the colour of Gaussian `i`. `rest` is the sum over all bands but the first.
    #[inline(always)]
    fn finished(&self, i: usize, rest: [f32; CHANNELS]) -> [f32; CHANNELS] {
        std::array::from_fn(|c| {
            let sum = COLOUR_OFFSET + C0 * self.dc[i][c] + rest[c];
            if sum.is_finite() { sum.max(0.0) } else { f32::NAN }
        })
    }
}

/// Returns the dot products of the three channels of a row with the basis.
#[inline(always)]
fn dense<const N: usize>(row: &[[f32; N]; CHANNELS], basis: &Basis) -> [f32; CHANNELS] {
    // Registers are spelled out. From plain arrays the compiler makes one vector of the three channels, which it gathers
    // from memory one by one.
    let (basis, basis_end) = basis[..N].as_chunks::<LANES>();
    let basis_end = filled(basis_end);
    let mut sums = [0.0; CHANNELS];
    for (sum, channel) in sums.iter_mut().zip(row) {
        let (channel, end) = channel.as_chunks::<LANES>();
        let mut lanes = Vec4::ZERO;
        for (own, basis) in channel.iter().zip(basis) {
            lanes += Vec4::from_array(*own) * Vec4::from_array(*basis);
        }
        if !end.is_empty() {
            lanes += filled(end) * basis_end;
        }
        *sum = (lanes.x + lanes.y) + (lanes.z + lanes.w);
    }
    sums
}

/// Returns up to [`LANES`] values, filled up with zeros.
#[inline(always)]
fn filled(values: &[f32]) -> Vec4 {
    let at = |k: usize| values.get(k).copied().unwrap_or(0.0);
    Vec4::new(at(0), at(1), at(2), at(3))
}

/// Returns the dot products of the three channels of a code's row with the basis. Products are added in the order of [`dense`], the
/// channels side by side.
#[inline(always)]
fn sparse<const N: usize, const LEN: usize>(
    code: Column<'_>,
    atoms: &[[f32; LEN]],
    basis: &Basis,
) -> [f32; CHANNELS] {
    // The sums of all coefficients are independent of each other.
    let mut rest = [0.0_f32; LEN];
    code.each(
        #[inline(always)]
        |atom, value| {
            for (sum, coefficient) in rest.iter_mut().zip(&atoms[atom]) {
                *sum += value * coefficient;
            }
        },
    );
    let mut lanes = [Vec4::ZERO; LANES];
    for (k, (channels, &basis)) in rest.as_chunks::<PADDED>().0.iter().zip(&basis[..N]).enumerate() {
        lanes[k % LANES] += Vec4::from_array(*channels) * basis;
    }
    ((lanes[0] + lanes[1]) + (lanes[2] + lanes[3])).truncate().to_array()
}

/// Returns the atoms, each as its coefficients, of which each has the values of its channels and zeros up to [`PADDED`].
fn padded(dictionary: &Dictionary) -> Vec<f32> {
    let per_channel = dictionary.degree().rest_per_channel();
    let mut atoms = vec![0.0; dictionary.len() * per_channel * PADDED];
    if per_channel == 0 {
        return atoms;
    }
    for (j, padded) in atoms.chunks_exact_mut(per_channel * PADDED).enumerate() {
        for (c, channel) in dictionary.atom(j).chunks_exact(per_channel).enumerate() {
            for (k, &coefficient) in channel.iter().enumerate() {
                padded[k * PADDED + c] = coefficient;
            }
        }
    }
    atoms
}
