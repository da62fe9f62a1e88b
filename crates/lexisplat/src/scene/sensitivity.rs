//! How much pictures change with each value of each Gaussian, as plain numbers.

use crate::scene::splats::{Geometry, filter};
use crate::support::maths;

/// For each Gaussian the expected squared change of a picture's colour values, averaged over pixels and
/// channels, for a squared error of 1 in one of its values (the diagonal of a Gauss-Newton matrix).
///
/// A renderer measures it; [`Sensitivity::heuristic`] needs none.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sensitivity {
    /// By one channel of the colour, for each channel alike.
    pub colour: Vec<f32>,
    /// By the logarithm of the opacity (after the sigmoid).
    pub opacity: Vec<f32>,
    /// By the position, in world units: the symmetric matrix xx, xy, xz, yy, yz, zz.
    pub position: Vec<[f32; 6]>,
    /// By the logarithm of the standard deviation along each axis, in the scene's order.
    pub scale: Vec<[f32; 3]>,
    /// By a rotation about each of the Gaussian's own axes, in radians.
    pub rotation: Vec<[f32; 3]>,
    /// Largest change of any colour value of any picture when the Gaussian is left out; infinite where
    /// that is not known.
    pub removal: Vec<f32>,
}

/// Share of a picture's squared colour that a change of opacity shows as, beside one of colour: what
/// scenes measured with a renderer have on average.
const CONTRAST: f32 = 0.08;
/// The same shares for a change of the standard deviation along the axes, longest first.
const SCALE_SHARES: [f32; 3] = [0.6, 0.1, 0.05];
/// The same for a turn, per squared lever.
const ROTATION_SHARE: f32 = 0.1;

/// Powers of opacity and of the two longest standard deviations' product that weights measured with a
/// renderer go with.
const ALPHA_POWER: f32 = 1.7;
const AREA_POWER: f32 = 0.6;
/// A sum of guessed weights is taken to be at least this, so that its reciprocal is an f32.
const LEAST_TOTAL: f64 = 1e-30;
/// A weight below this share of what nine tenths are below counts as not seen.
const UNSEEN: f32 = 1e-4;

impl Sensitivity {
    /// `count` Gaussians that nothing depends on.
    #[must_use]
    pub fn zeros(count: usize) -> Self {
        Self {
            colour: vec![0.0; count],
            opacity: vec![0.0; count],
            position: vec![[0.0; 6]; count],
            scale: vec![[0.0; 3]; count],
            rotation: vec![[0.0; 3]; count],
            removal: vec![0.0; count],
        }
    }

    /// Number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        self.colour.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.colour.is_empty()
    }

    /// Keeps what `keep`, one entry a Gaussian, says.
    ///
    /// # Panics
    /// If `keep` differs in length.
    pub fn retain(&mut self, keep: &[bool]) {
        assert_eq!(self.len(), keep.len(), "one entry a Gaussian");
        filter(&mut self.colour, keep);
        filter(&mut self.opacity, keep);
        filter(&mut self.position, keep);
        filter(&mut self.scale, keep);
        filter(&mut self.rotation, keep);
        filter(&mut self.removal, keep);
    }

    /// Appends that of further Gaussians.
    pub(crate) fn append(&mut self, mut other: Self) {
        self.colour.append(&mut other.colour);
        self.opacity.append(&mut other.opacity);
        self.position.append(&mut other.position);
        self.scale.append(&mut other.scale);
        self.rotation.append(&mut other.rotation);
        self.removal.append(&mut other.removal);
    }

    /// What it is if the pictures are only `share` of all there are, and the others do not show these
    /// Gaussians.
    pub(crate) fn share(&mut self, share: f32) {
        let shapes = self.position.as_flattened_mut().iter_mut();
        let shapes = shapes.chain(self.scale.as_flattened_mut()).chain(self.rotation.as_flattened_mut());
        self.colour.iter_mut().chain(&mut self.opacity).chain(shapes).for_each(|v| *v *= share);
    }

    /// An estimate from the Gaussians alone: what is opaque and large shows. Knows nothing of what hides
    /// what, so files made with it are larger for the same quality than with a measured one.
    #[must_use]
    pub fn heuristic(geometry: &Geometry) -> Self {
        Self::heuristic_part(geometry, heuristic_total(0.0, geometry))
    }

    /// [`Self::heuristic`] of a part of a scene whose [`heuristic_total`] is `total`.
    pub(crate) fn heuristic_part(geometry: &Geometry, total: f64) -> Self {
        let n = geometry.len();
        let mut out = Self::zeros(n);
        out.removal.fill(f32::INFINITY);
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        let unit = (1.0 / (3.0 * total.max(LEAST_TOTAL))) as f32;
        for i in 0..n {
            out.set_heuristic(geometry, i, heuristic_weight(geometry, i) * unit);
        }
        out
    }

    /// Everything of Gaussian `i` but its removal, guessed from its sensitivity to colour.
    fn set_heuristic(&mut self, geometry: &Geometry, i: usize, colour: f32) {
        let shape = CONTRAST * colour;
        self.colour[i] = colour;
        self.opacity[i] = shape;
        let scales = geometry.scales[i];
        let order = maths::longest_first(scales);
        for (&axis, share) in order.iter().zip(SCALE_SHARES) {
            self.scale[i][axis] = share * shape;
        }
        for k in 0..3 {
            let ratio = maths::exp(scales[(k + 1) % 3] - scales[(k + 2) % 3]);
            let lever = (ratio - 1.0 / ratio).clamp(-100.0, 100.0);
            self.rotation[i][k] = ROTATION_SHARE * shape * lever * lever;
        }
        let middle = scales[order[1]];
        let along = shape * maths::exp(-2.0 * middle.clamp(-30.0, 30.0));
        self.position[i] = [along, 0.0, 0.0, along, 0.0, along];
    }

    /// Mixes what was measured with a guess that knows nothing of views: weights become the geometric mean
    /// of both, the guess having `share` of the say. What the views hardly showed then keeps a weight,
    /// for other views may show it. `geometry` is that of the same Gaussians.
    ///
    /// # Panics
    /// If the two differ in length.
    pub fn blend_with_prior(&mut self, geometry: &Geometry, share: f32) {
        assert_eq!(self.len(), geometry.len(), "one entry a Gaussian in both");
        let n = self.len();
        let total: f64 = self.colour.iter().map(|&v| f64::from(v)).sum();
        if total <= 0.0 {
            let removal = std::mem::take(&mut self.removal);
            *self = Self { removal, ..Self::heuristic(geometry) };
            return;
        }
        let mut sorted = self.colour.clone();
        sorted.sort_by(f32::total_cmp);
        let floor = sorted[sorted.len() * 9 / 10] * UNSEEN;
        drop(sorted);
        let guessed: f64 = (0..n).map(|i| f64::from(heuristic_weight(geometry, i))).sum();
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        let unit = (total / guessed.max(LEAST_TOTAL)) as f32;
        let mixed: Vec<f32> = (0..n)
            .map(|i| {
                let guessed = (heuristic_weight(geometry, i) * unit).max(f32::MIN_POSITIVE);
                let seen = self.colour[i].max(floor).max(f32::MIN_POSITIVE);
                maths::exp((1.0 - share) * maths::ln(seen) + share * maths::ln(guessed))
            })
            .collect();
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        let back = (total / mixed.iter().map(|&v| f64::from(v)).sum::<f64>()) as f32;
        for (i, &mixed) in mixed.iter().enumerate() {
            let wanted = mixed * back;
            let seen = self.colour[i];
            if seen <= floor {
                self.set_heuristic(geometry, i, wanted);
                continue;
            }
            let factor = wanted / seen;
            self.colour[i] = wanted;
            self.opacity[i] *= factor;
            let rows = self.position[i].iter_mut().chain(&mut self.scale[i]).chain(&mut self.rotation[i]);
            rows.for_each(|v| *v *= factor);
        }
    }
}

/// Adds to `sum`, one after the other, what the weights of all Gaussians are expected to be proportional to.
pub(crate) fn heuristic_total(sum: f64, geometry: &Geometry) -> f64 {
    (0..geometry.len()).fold(sum, |sum, i| sum + f64::from(heuristic_weight(geometry, i)))
}

/// What a Gaussian's weight is expected to be proportional to.
fn heuristic_weight(geometry: &Geometry, i: usize) -> f32 {
    let scales = geometry.scales[i];
    let [longest, middle, _] = maths::longest_first(scales).map(|k| scales[k]);
    let alpha = maths::log_sigmoid(geometry.opacities[i]);
    let weight = maths::exp(ALPHA_POWER * alpha + AREA_POWER * (longest + middle));
    if weight.is_finite() { weight } else { 0.0 }
}
