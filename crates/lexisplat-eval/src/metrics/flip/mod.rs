//! FLIP for pictures of low dynamic range: Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", 2020,
//! as computed by NVIDIA's `FLIP.h` (v1.7).

mod colour;
mod filters;

use std::sync::LazyLock;

use lexisplat::simd::Simd;
use lexisplat_render::Image;

use self::colour::{LIGHTNESS_SCALE, hyab, rgb_to_hunt_lab, srgb_to_ycxcz, ycxcz_to_rgb};
use self::filters::{Blur, Features, pixels_per_degree};
use super::rows::{add_across, add_rows, planes, sum_rows};
use super::{clip, comparable};
use lexisplat_compress::Result;

/// Exponent that compresses colour differences (`gqc`).
const COLOUR_EXPONENT: f64 = 0.7;
/// Share of the largest colour difference up to which differences are resolved finely (`gpc`).
const COLOUR_KNEE: f64 = 0.4;
/// Value to which this share is mapped (`gpt`).
const COLOUR_KNEE_TO: f64 = 0.95;

/// Returns the mean FLIP over all pixels of `test` and `reference`, which are in sRGB. It is 0 for identical pictures and
/// at most 1. It is symmetric. The viewing distance is 0.7 m, and the screen has a width of 0.7 m and 3840 pixels (67
/// pixels per degree), which is FLIP's default.
///
/// # Errors
/// [`lexisplat_compress::Error::Parameter`] if the sizes differ, or a picture is empty or has NaN.
pub fn flip(reference: &Image, test: &Image) -> Result<f64> {
    comparable(reference, test)?;
    let (width, height) = (reference.width as usize, reference.height as usize);
    let pictures = [reference, test].map(|image| planes(image, |pixel| srgb_to_ycxcz(pixel.map(clip))));
    let (filters, simd) = (&*FILTERS, Simd::current());
    let sum = sum_rows(
        0..height,
        || [(); 2].map(|()| Row::new(width, filters)),
        |rows, y| {
            for (row, planes) in rows.iter_mut().zip(&pictures) {
                simd.dispatch(
                    #[inline(always)]
                    || row.filter(planes, filters, y, height),
                );
            }
            let [a, b] = &*rows;
            (0..width).map(|x| pixel(a.at(x), b.at(x), filters.largest)).sum()
        },
    );
    Ok(sum / (width * height) as f64)
}

/// Constants that do not depend on the pictures.
struct Filters {
    blur: Blur,
    features: Features,
    /// Largest compressed colour difference: that of green and blue.
    largest: f64,
}

static FILTERS: LazyLock<Filters> = LazyLock::new(|| {
    let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(rgb_to_hunt_lab);
    let degree = pixels_per_degree();
    Filters {
        blur: Blur::new(degree),
        features: Features::new(degree),
        largest: hyab(green, blue).powf(COLOUR_EXPONENT),
    }
});

/// A pixel as perceived by the eye.
struct Seen {
    /// Colour in L*a*b* with the Hunt effect.
    lab: [f64; 3],
    /// Strength of an edge at the pixel.
    edge: f64,
    /// Strength of a point at the pixel.
    point: f64,
}

/// Returns the FLIP of one pixel.
fn pixel(a: Seen, b: Seen, largest: f64) -> f64 {
    let difference = hyab(a.lab, b.lab).powf(COLOUR_EXPONENT);
    let knee = COLOUR_KNEE * largest;
    let colour = if difference < knee {
        difference * (COLOUR_KNEE_TO / knee)
    } else {
        COLOUR_KNEE_TO + (difference - knee) / (largest - knee) * (1.0 - COLOUR_KNEE_TO)
    };
    let feature = (a.edge - b.edge).abs().max((a.point - b.point).abs()) / std::f64::consts::SQRT_2;
    // The square root is the exponent `gqf` of 0.5.
    colour.powf(1.0 - feature.sqrt())
}

/// Filtered rows of one picture. The border of the picture is repeated outside of it.
struct Row {
    /// Y, Cx and twice Cz, blurred down the columns. The border is repeated to each side.
    blurred: [Vec<f64>; 4],
    /// Y filtered down the columns by the smooth, edge and point weights.
    derived: [Vec<f64>; 3],
    /// Blurred YCxCz.
    colour: [Vec<f64>; 3],
    /// Derivatives of Y: edges across and down, points across and down.
    slopes: [Vec<f64>; 4],
}

impl Row {
    fn new(width: usize, filters: &Filters) -> Self {
        fn rows<const N: usize>(length: usize) -> [Vec<f64>; N] {
            [(); N].map(|()| vec![0.0; length])
        }
        Self {
            blurred: rows(width + filters.blur.y.len() - 1),
            derived: rows(width + filters.features.smooth.len() - 1),
            colour: rows(width),
            slopes: rows(width),
        }
    }

    #[inline(always)]
    fn filter(&mut self, [luma, cx, cz]: &[Vec<f64>; 3], filters: &Filters, y: usize, height: usize) {
        let Filters { blur, features, .. } = filters;
        let jobs = [(luma, &blur.y), (cx, &blur.cx), (cz, &blur.cz[0]), (cz, &blur.cz[1])];
        for (row, (plane, weights)) in self.blurred.iter_mut().zip(jobs) {
            down(row, weights, plane, y, height);
        }
        let weights = [&features.smooth, &features.edge, &features.point];
        for (row, weights) in self.derived.iter_mut().zip(weights) {
            down(row, weights, luma, y, height);
        }
        for row in self.colour.iter_mut().chain(&mut self.slopes) {
            row.fill(0.0);
        }
        let [out_y, out_cx, out_cz] = &mut self.colour;
        let [in_y, in_cx, in_cz, in_cz2] = &self.blurred;
        add_across(out_y, &blur.y, in_y);
        add_across(out_cx, &blur.cx, in_cx);
        add_across(out_cz, &blur.cz[0], in_cz);
        add_across(out_cz, &blur.cz[1], in_cz2);
        let [smooth, edge, point] = &self.derived;
        let [edge_across, edge_down, point_across, point_down] = &mut self.slopes;
        add_across(edge_across, &features.edge, smooth);
        add_across(edge_down, &features.smooth, edge);
        add_across(point_across, &features.point, smooth);
        add_across(point_down, &features.smooth, point);
    }

    fn at(&self, x: usize) -> Seen {
        let colour = self.colour.each_ref().map(|row| row[x]);
        let [edge_across, edge_down, point_across, point_down] = self.slopes.each_ref().map(|row| row[x]);
        // Features are of Y scaled to 0..1. The offset of Y has no effect, because the weights sum to 0.
        Seen {
            lab: rgb_to_hunt_lab(ycxcz_to_rgb(colour)),
            edge: (edge_across * edge_across + edge_down * edge_down).sqrt() / LIGHTNESS_SCALE,
            point: (point_across * point_across + point_down * point_down).sqrt() / LIGHTNESS_SCALE,
        }
    }
}

/// Filters `plane` down its columns at row `y`. Writes the result into the middle of `out`, and repeats its ends to each
/// side.
#[inline(always)]
fn down(out: &mut [f64], weights: &[f64], plane: &[f64], y: usize, height: usize) {
    let width = plane.len() / height;
    let reach = weights.len() / 2;
    let middle = &mut out[reach..reach + width];
    middle.fill(0.0);
    add_rows(middle, weights, |k| {
        let row = (y + k).saturating_sub(reach).min(height - 1);
        &plane[row * width..(row + 1) * width]
    });
    let (first, last) = (out[reach], out[reach + width - 1]);
    out[..reach].fill(first);
    out[reach + width..].fill(last);
}

#[cfg(test)]
mod tests;
