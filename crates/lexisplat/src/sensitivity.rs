//! How much pictures change with each value of each Gaussian, as plain numbers.

use crate::maths;
use crate::splats::Geometry;

/// For each Gaussian the expected squared change of a picture's colour values, averaged over pixels and
/// channels, for a squared error of 1 in one of its values (the diagonal of a Gauss-Newton matrix).
///
/// A renderer measures it; [`Sensitivity::guess`] needs none.
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
        fn filter<T>(values: &mut Vec<T>, keep: &[bool]) {
            let mut keep = keep.iter();
            values.retain(|_| keep.next() == Some(&true));
        }
        filter(&mut self.colour, keep);
        filter(&mut self.opacity, keep);
        filter(&mut self.position, keep);
        filter(&mut self.scale, keep);
        filter(&mut self.rotation, keep);
        filter(&mut self.removal, keep);
    }

    /// An estimate from the Gaussians alone: what is opaque and large shows. Knows nothing of what hides
    /// what, so files made with it are larger for the same quality than with a measured one.
    #[must_use]
    pub fn guess(geometry: &Geometry) -> Self {
        let n = geometry.len();
        let mut out = Self::zeros(n);
        out.removal.fill(f32::INFINITY);
        let mut total = 0.0_f64;
        for i in 0..n {
            let mut sorted = geometry.scales[i];
            sorted.sort_by(|a, b| b.total_cmp(a));
            let alpha = maths::log_sigmoid(geometry.opacities[i]);
            let weight = maths::exp(1.7 * alpha + 0.6 * (sorted[0] + sorted[1]));
            out.colour[i] = if weight.is_finite() { weight } else { 0.0 };
            total += f64::from(out.colour[i]);
        }
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        let unit = (1.0 / (3.0 * total.max(f64::MIN_POSITIVE))) as f32;
        for i in 0..n {
            out.colour[i] *= unit;
            let shape = CONTRAST * out.colour[i];
            out.opacity[i] = shape;
            let scales = geometry.scales[i];
            let mut order = [0, 1, 2];
            order.sort_by(|&a, &b| scales[b].total_cmp(&scales[a]));
            for (&axis, share) in order.iter().zip(SCALE_SHARES) {
                out.scale[i][axis] = share * shape;
            }
            for k in 0..3 {
                let ratio = maths::exp(scales[(k + 1) % 3] - scales[(k + 2) % 3]);
                let lever = (ratio - 1.0 / ratio).clamp(-100.0, 100.0);
                out.rotation[i][k] = ROTATION_SHARE * shape * lever * lever;
            }
            let middle = scales[order[1]];
            let along = shape * maths::exp(-2.0 * middle.clamp(-30.0, 30.0));
            out.position[i] = [along, 0.0, 0.0, along, 0.0, along];
        }
        out
    }

    /// This one, measured, mixed with a guess that knows nothing of views: weights are the geometric mean
    /// of both, the guess having `share` of the say. What the views hardly showed then keeps a weight,
    /// for other views may show it.
    ///
    /// # Panics
    /// If the two differ in length.
    #[must_use]
    pub fn blended(&self, guess: &Self, share: f32) -> Self {
        assert_eq!(self.len(), guess.len(), "one entry a Gaussian in both");
        let sum = |values: &[f32]| values.iter().map(|&v| f64::from(v)).sum::<f64>();
        let total = sum(&self.colour);
        if total <= 0.0 {
            return guess.clone();
        }
        let mut sorted = self.colour.clone();
        sorted.sort_by(f32::total_cmp);
        let floor = sorted[sorted.len() * 9 / 10] * UNSEEN;
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        let unit = (total / sum(&guess.colour).max(f64::MIN_POSITIVE)) as f32;
        let mixed: Vec<f32> = self
            .colour
            .iter()
            .zip(&guess.colour)
            .map(|(&seen, &guessed)| {
                let guessed = (guessed * unit).max(f32::MIN_POSITIVE);
                let log = (1.0 - share) * maths::ln(seen.max(floor).max(f32::MIN_POSITIVE))
                    + share * maths::ln(guessed);
                maths::exp(log)
            })
            .collect();
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        let back = (total / sum(&mixed)) as f32;
        let mut out = self.clone();
        for (i, mixed) in mixed.iter().enumerate() {
            let seen = self.colour[i];
            let (source, weight) = if seen > floor { (self, seen) } else { (guess, guess.colour[i]) };
            let factor = mixed * back / weight.max(f32::MIN_POSITIVE);
            out.colour[i] = source.colour[i] * factor;
            out.opacity[i] = source.opacity[i] * factor;
            out.position[i] = source.position[i].map(|v| v * factor);
            out.scale[i] = source.scale[i].map(|v| v * factor);
            out.rotation[i] = source.rotation[i].map(|v| v * factor);
        }
        out
    }
}
