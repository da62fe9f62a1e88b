//! FLIP beside its definition, and beside NVIDIA's own.

use std::f64::consts::PI;

use super::colour::{hyab, rgb_to_hunt_lab, srgb_to_ycxcz, ycxcz_to_rgb};
use super::*;
use crate::metrics::testing::{golden, picture};
use lexisplat_compress::Error;

/// A weight for every offset of a square window.
type Kernel = Vec<((i64, i64), f64)>;

fn kernel(radius: i64, weight: impl Fn(f64, f64) -> f64) -> Kernel {
    let offsets = (-radius..=radius).flat_map(|dy| (-radius..=radius).map(move |dx| (dx, dy)));
    offsets.map(|(dx, dy)| ((dx, dy), weight(dx as f64, dy as f64))).collect()
}

/// Contrast sensitivity in 2-D: a sum of `a sqrt(pi / b) exp(-pi^2 d^2 / b)`, scaled to sum to 1.
fn sensitivity(degree: f64, terms: &[(f64, f64)]) -> Kernel {
    let mut kernel = kernel(10, |dx, dy| {
        let square = (dx * dx + dy * dy) / (degree * degree);
        terms.iter().map(|&(a, b)| a * (PI / b).sqrt() * (-PI * PI * square / b).exp()).sum()
    });
    let sum: f64 = kernel.iter().map(|k| k.1).sum();
    kernel.iter_mut().for_each(|k| k.1 /= sum);
    kernel
}

/// A derivative of a Gaussian across, its positive weights summing to 1 and its negative ones to -1.
fn derivative(degree: f64, second: bool) -> Kernel {
    let sigma = 0.5 * 0.082 * degree;
    let mut kernel = kernel(9, |dx, dy| {
        let gaussian = (-(dx * dx + dy * dy) / (2.0 * sigma * sigma)).exp();
        gaussian * if second { dx * dx / (sigma * sigma) - 1.0 } else { -dx }
    });
    let positive: f64 = kernel.iter().map(|k| k.1.max(0.0)).sum();
    let negative: f64 = kernel.iter().map(|k| -k.1.min(0.0)).sum();
    kernel.iter_mut().for_each(|k| k.1 /= if k.1 > 0.0 { positive } else { negative });
    kernel
}

fn transposed(kernel: &Kernel) -> Kernel {
    kernel.iter().map(|&((dx, dy), weight)| ((dy, dx), weight)).collect()
}

/// The definition: 2-D windows at every pixel.
fn naive(a: &Image, b: &Image) -> f64 {
    let degree = 0.7 * 3840.0 / 0.7 * PI / 180.0;
    let blurs = [
        sensitivity(degree, &[(1.0, 0.0047)]),
        sensitivity(degree, &[(1.0, 0.0053)]),
        sensitivity(degree, &[(34.1, 0.04), (13.5, 0.025)]),
    ];
    let (edge, point) = (derivative(degree, false), derivative(degree, true));
    let detectors = [edge.clone(), transposed(&edge), point.clone(), transposed(&point)];
    let (width, height) = (i64::from(a.width), i64::from(a.height));
    let opponent = |image: &Image| -> Vec<[f64; 3]> {
        image.pixels.iter().map(|p| srgb_to_ycxcz(p.map(|v| v.clamp(0.0, 1.0)))).collect()
    };
    let planes = [opponent(a), opponent(b)];
    let at = |plane: &[[f64; 3]], kernel: &Kernel, x: i64, y: i64, c: usize| -> f64 {
        let value = |dx: i64, dy: i64| {
            let (u, v) = ((x + dx).clamp(0, width - 1), (y + dy).clamp(0, height - 1));
            plane[usize::try_from(v * width + u).unwrap()][c]
        };
        kernel.iter().map(|&((dx, dy), weight)| weight * value(dx, dy)).sum()
    };
    let most = hyab(rgb_to_hunt_lab([0.0, 1.0, 0.0]), rgb_to_hunt_lab([0.0, 0.0, 1.0])).powf(0.7);
    let mut total = 0.0;
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let seen = planes.each_ref().map(|plane| {
            let colour = [0, 1, 2].map(|c| at(plane, &blurs[c], x, y, c));
            let [ex, ey, px, py] = detectors.each_ref().map(|k| at(plane, k, x, y, 0) / 116.0);
            (rgb_to_hunt_lab(ycxcz_to_rgb(colour)), ex.hypot(ey), px.hypot(py))
        });
        let [(lab_a, edge_a, point_a), (lab_b, edge_b, point_b)] = seen;
        let difference = hyab(lab_a, lab_b).powf(0.7);
        let colour = if difference < 0.4 * most {
            0.95 * difference / (0.4 * most)
        } else {
            0.95 + 0.05 * (difference - 0.4 * most) / (0.6 * most)
        };
        let feature = ((edge_a - edge_b).abs().max((point_a - point_b).abs()) / 2.0_f64.sqrt()).sqrt();
        total += colour.powf(1.0 - feature);
    }
    total / (width * height) as f64
}

#[test]
fn agrees_with_the_definition() {
    for (width, height) in [(1, 1), (5, 30), (25, 14)] {
        let (a, b) = (picture(width, height, 1), picture(width, height, 2));
        let (fast, slow) = (flip(&a, &b).unwrap(), naive(&a, &b));
        assert!((fast - slow).abs() < 1e-9, "{width} x {height}: {fast} {slow}");
        assert!(fast > 0.01, "the pictures must differ for this to mean anything: {fast}");
    }
}

/// The result of `flip-evaluator` 1.7; `benches/metrics_beside_references.py --golden` prints it.
const GOLDEN: f64 = 0.149_842;

#[test]
fn agrees_with_the_published_evaluator() {
    let [a, b] = golden();
    let found = flip(&a, &b).unwrap();
    assert!((found - GOLDEN).abs() < 1e-5, "{found}");
}

#[test]
fn identical_pictures_score_zero_and_opposite_ones_nearly_one() {
    let a = picture(30, 20, 3);
    assert!(flip(&a, &a).unwrap().abs() < 1e-300);
    let flat = |colour: [f32; 3]| Image { width: 8, height: 6, pixels: vec![colour; 48] };
    let most = flip(&flat([0.0, 1.0, 0.0]), &flat([0.0, 0.0, 1.0])).unwrap();
    assert!((most - 1.0).abs() < 1e-6, "{most}");
    assert!(flip(&flat([-3.0, 2.0, -1.0]), &flat([0.0, 1.0, 0.0])).unwrap().abs() < 1e-300);
}

#[test]
fn sizes_must_match() {
    assert!(matches!(flip(&picture(4, 5, 1), &picture(5, 4, 1)), Err(Error::Parameter { .. })));
}

#[test]
fn threads_do_not_change_the_score() {
    let (a, b) = (picture(50, 40, 4), picture(50, 40, 5));
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| flip(&a, &b)).unwrap().to_bits()
    };
    assert_eq!(on(1), on(3));
}
