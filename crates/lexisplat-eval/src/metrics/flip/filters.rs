//! Filters of FLIP: the blur of the eye at the viewing distance, and detectors of edges and points at the width that the
//! eye sees.

use std::f64::consts::PI;

/// Distance from eye to screen in metres (FLIP's default viewing condition, paper section 5).
const DISTANCE: f64 = 0.7;
/// Width of the screen in metres.
const SCREEN_METRES: f64 = 0.7;
/// Width of the screen in pixels.
const SCREEN_PIXELS: f64 = 3840.0;

/// Contrast sensitivity as sums of Gaussians in space, `a sqrt(pi / b) exp(-pi^2 x^2 / b)` with x in degrees (FLIP paper,
/// table 1, after Johnson and Fairchild 2001): `(a, b)` of Y.
const ACHROMATIC: (f64, f64) = (1.0, 0.0047);
/// `(a, b)` of Cx. The second Gaussian of Cx has weight 0.
const RED_GREEN: (f64, f64) = (1.0, 0.0053);
/// `(a, b)` of both Gaussians of Cz.
const BLUE_YELLOW: [(f64, f64); 2] = [(34.1, 0.04), (13.5, 0.025)];
/// Largest `b` of all channels. It determines the radius of all filters.
const WIDEST: f64 = 0.04;
/// Radius of the filters, in standard deviations.
const DEVIATIONS: f64 = 3.0;

/// Perceived width of edges and points, in degrees (`gw`, from Thorpe et al.; FLIP paper section 4.2).
const FEATURE_WIDTH: f64 = 0.082;

/// Returns the number of pixels in one degree of the field of view: 67.02.
pub(super) fn pixels_per_degree() -> f64 {
    DISTANCE * (SCREEN_PIXELS / SCREEN_METRES) * (PI / 180.0)
}

/// Weights of the blur of each channel along one axis. All have the same odd length. The 2-D weights of Y and Cx are
/// products of the weights down and across. The 2-D weights of Cz are the sum of two such products.
pub(super) struct Blur {
    pub(super) y: Vec<f64>,
    pub(super) cx: Vec<f64>,
    pub(super) cz: [Vec<f64>; 2],
}

impl Blur {
    pub(super) fn new(pixels_per_degree: f64) -> Self {
        let radius = (DEVIATIONS * (WIDEST / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil();
        let gaussian = |b: f64| -> Vec<f64> {
            taps(radius).map(|x| (-PI * PI / b * (x / pixels_per_degree).powi(2)).exp()).collect()
        };
        let one = |(_, b)| {
            let mut weights = gaussian(b);
            scale_to(&mut weights, 1.0);
            weights
        };
        // The 2-D weights are `a sqrt(pi / b)` times a Gaussian, so the weights of each axis get the root of this factor.
        // Then all weights are scaled so that the 2-D weights of both Gaussians sum to 1.
        let mut cz = BLUE_YELLOW.map(|(a, b)| {
            let factor = (a * (PI / b).sqrt()).sqrt();
            gaussian(b).into_iter().map(|weight| factor * weight).collect::<Vec<f64>>()
        });
        let total = cz.iter().map(|weights| weights.iter().sum::<f64>().powi(2)).sum::<f64>().sqrt();
        cz.iter_mut().flatten().for_each(|weight| *weight /= total);
        Self { y: one(ACHROMATIC), cx: one(RED_GREEN), cz }
    }
}

/// Weights of the feature detectors along one axis. All have the same odd length.
pub(super) struct Features {
    /// A Gaussian that sums to 1.
    pub(super) smooth: Vec<f64>,
    /// First derivative of the Gaussian. Positive weights sum to 1, and negative weights to -1.
    pub(super) edge: Vec<f64>,
    /// Second derivative of the Gaussian. Positive weights sum to 1, and negative weights to -1.
    pub(super) point: Vec<f64>,
}

impl Features {
    pub(super) fn new(pixels_per_degree: f64) -> Self {
        let deviation = 0.5 * FEATURE_WIDTH * pixels_per_degree;
        let radius = (DEVIATIONS * deviation).ceil();
        let gaussian = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
        let mut smooth: Vec<f64> = taps(radius).map(gaussian).collect();
        scale_to(&mut smooth, 1.0);
        let mut edge: Vec<f64> = taps(radius).map(|x| -x * gaussian(x)).collect();
        balance(&mut edge);
        let mut point: Vec<f64> =
            taps(radius).map(|x| (x * x / (deviation * deviation) - 1.0) * gaussian(x)).collect();
        balance(&mut point);
        Self { smooth, edge, point }
    }
}

/// Pixel offsets of a filter.
fn taps(radius: f64) -> impl Iterator<Item = f64> {
    std::iter::successors(Some(-radius), |x| Some(x + 1.0)).take_while(move |&x| x <= radius)
}

fn scale_to(weights: &mut [f64], sum: f64) {
    let factor = sum / weights.iter().sum::<f64>();
    weights.iter_mut().for_each(|weight| *weight *= factor);
}

/// Scales positive weights to sum to 1, and negative weights to sum to -1.
fn balance(weights: &mut [f64]) {
    let positive: f64 = weights.iter().filter(|&&w| w > 0.0).sum();
    let negative: f64 = -weights.iter().filter(|&&w| w < 0.0).sum::<f64>();
    for weight in weights {
        *weight /= if *weight > 0.0 { positive } else { negative };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_have_the_published_size_and_sums() {
        let degree = pixels_per_degree();
        assert!((degree - 67.0206).abs() < 1e-4);
        let blur = Blur::new(degree);
        assert!([&blur.y, &blur.cx, &blur.cz[0], &blur.cz[1]].iter().all(|w| w.len() == 21));
        assert!((blur.y.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!((blur.cx.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let both: f64 = blur.cz.iter().map(|w| w.iter().sum::<f64>().powi(2)).sum();
        assert!((both - 1.0).abs() < 1e-12);
        let features = Features::new(degree);
        assert_eq!([&features.smooth, &features.edge, &features.point].map(Vec::len), [19; 3]);
        assert!((features.smooth.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        for weights in [features.edge, features.point] {
            assert!(weights.iter().sum::<f64>().abs() < 1e-12);
            assert!((weights.iter().map(|w| w.abs()).sum::<f64>() - 2.0).abs() < 1e-12);
        }
    }
}
