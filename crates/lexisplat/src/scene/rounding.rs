//! The distance by which rounding moves positions, against the sizes of Gaussians.

/// Largest move by rounding that needs no warning, as a share of the median size. Pictures cannot show a hundredth of a
/// Gaussian's standard deviation.
const COARSE: f64 = 0.01;
/// Largest number of Gaussians whose sizes and positions stand for those of all Gaussians.
const SAMPLE: usize = 4096;

/// The largest move of a scene's positions by rounding, and the size of the scene's Gaussians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rounding {
    /// The largest move along an axis, in the scene's units.
    pub error: f64,
    /// The median over Gaussians of the middle one of the three standard deviations, in the scene's units.
    pub size: f64,
}

impl Rounding {
    /// Returns whether the move is above a hundredth of the size.
    #[must_use]
    pub fn is_coarse(&self) -> bool {
        self.error > COARSE * self.size
    }

    /// Returns the move as a share of the size; 0 if nothing moves.
    pub(crate) fn share(&self) -> f64 {
        if self.error > 0.0 { self.error / self.size } else { 0.0 }
    }

    /// Returns a sentence with both numbers, if the move is coarse. `what` names the cause of the rounding, such as `32-bit
    /// floats`.
    #[must_use]
    pub fn warning(&self, what: &str) -> Option<String> {
        let Self { error, size } = self;
        let text = || {
            format!(
                "{what} move positions by up to {}, and the median Gaussian has a size of {}",
                short(*error),
                short(*size)
            )
        };
        self.is_coarse().then(text)
    }

    /// Returns the middle one of three standard deviations, which are given by their natural logarithms.
    #[must_use]
    pub fn size_of(scales: [f32; 3]) -> f64 {
        let [a, b, c] = scales;
        libm::exp(f64::from(a.min(b).max(a.max(b).min(c))))
    }

    /// Returns the median of `sizes`; 0 if there are none.
    #[must_use]
    pub fn median(mut sizes: Vec<f64>) -> f64 {
        let middle = sizes.len() / 2;
        sizes.sort_unstable_by(f64::total_cmp);
        sizes.get(middle).copied().unwrap_or(0.0)
    }
}

/// Returns the step between the Gaussians that are looked at in a scene of `count` Gaussians. It is at least 1.
pub(crate) fn sample(count: usize) -> usize {
    count.div_ceil(SAMPLE).max(1)
}

/// Returns `value` as text, with at least two significant digits.
fn short(value: f64) -> String {
    if !(1e-4..1e5).contains(&value) {
        return format!("{value:.1e}");
    }
    let digits = (0..8).find(|digits| value * 10_f64.powi(*digits) >= 10.0).unwrap_or(8);
    format!("{value:.*}", usize::try_from(digits).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_coarse_rounding_is_told_with_both_numbers() {
        let rounding = Rounding { error: 0.25, size: 0.112 };
        let expected =
            "32-bit floats move positions by up to 0.25, and the median Gaussian has a size of 0.11";
        assert_eq!(rounding.warning("32-bit floats").unwrap(), expected);
        assert_eq!(Rounding { error: 0.0011, ..rounding }.warning("x"), None);
        assert_eq!(Rounding { error: 0.0, size: 0.0 }.warning("x"), None);
        assert_eq!([123.4, 0.012_34, 1.5e-6].map(short), ["123", "0.012", "1.5e-6"]);
    }

    #[test]
    fn sizes_are_medians() {
        let [one, two, three] = [0.0, 1.0, 2.0];
        for scales in
            [[one, two, three], [three, one, two], [two, three, one], [f32::NEG_INFINITY, two, three]]
        {
            assert!((Rounding::size_of(scales) - std::f64::consts::E).abs() < 1e-9, "{scales:?}");
        }
        assert!((Rounding::median(vec![3.0, 1.0, 2.0]) - 2.0).abs() < 1e-12);
        assert_eq!((sample(0), sample(4096), sample(4097)), (1, 1, 2));
    }
}
