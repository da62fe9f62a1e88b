//! LPIPS, version 0.1: Zhang et al., "The Unreasonable Effectiveness of Deep Features as a Perceptual Metric", 2018, as
//! computed by the `lpips` package 0.1.4. This crate has no weights; [`Lpips::load`] reads them.

mod conv;
mod gemm;
mod map;
mod network;
mod weights;

use std::fmt;

use lexisplat_render::Image;

use self::conv::Conv;
use self::map::Map;
pub use self::network::Network;
use self::network::{COLOURS, Pool, STAGES};
use super::rows::sum_rows;
use super::{clip, comparable};
use lexisplat_compress::{Error, Result};

/// Term added to the length of a pixel's features before the division by it (`lpips.normalize_tensor`).
const EPSILON: f64 = 1e-10;
/// Value subtracted from each colour (`lpips.ScalingLayer`), for pictures in -1..1.
const SHIFT: [f32; COLOURS] = [-0.030, -0.088, -0.188];
/// Divisor of each colour after the subtraction (`lpips.ScalingLayer`).
const SCALE: [f32; COLOURS] = [0.458, 0.448, 0.450];
/// Number of partial sums over features.
const LANES: usize = 8;

/// Range of the pixel values that are the input of the network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PixelRange {
    /// -1..1, the range for which the constants are made. The `lpips` package uses it.
    Standard,
    /// 0..1. `metrics.py` of the 3DGS repository uses this range, so tables of 3DGS papers have it (its issue 1239).
    Inria,
}

/// A network with weights that compares pictures.
pub struct Lpips {
    network: Network,
    stages: Vec<Layers>,
}

/// A stage of the network. Outputs of stages are compared.
struct Layers {
    pool: Option<Pool>,
    convs: Vec<Conv>,
    /// Weight of each feature.
    linear: Vec<f32>,
    /// Border of the output for the next layer, in pixels.
    padding_after: usize,
}

impl Lpips {
    /// Returns the network with the weights that `get` returns for a name and a shape.
    fn build(network: Network, mut get: impl FnMut(&str, &[usize]) -> Result<Vec<f32>>) -> Result<Self> {
        let shapes = network.stages();
        let mut stages = Vec::with_capacity(STAGES);
        for (number, stage) in shapes.iter().enumerate() {
            let mut convs = Vec::with_capacity(stage.convs.len());
            let mut channels = 0;
            for &shape in &stage.convs {
                let name = format!("features.{}", shape.index);
                let weights = get(&format!("{name}.weight"), &shape.weight_shape())?;
                let bias = get(&format!("{name}.bias"), &[shape.outputs])?;
                convs.push(Conv::new(shape, &weights, bias));
                channels = shape.outputs;
            }
            let linear = get(&format!("lin{number}.model.1.weight"), &[1, channels, 1, 1])?;
            // A pool reads no border.
            let next = shapes.get(number + 1).filter(|next| next.pool.is_none());
            let padding_after = next.and_then(|next| next.convs.first()).map_or(0, |conv| conv.padding);
            stages.push(Layers { pool: stage.pool, convs, linear, padding_after });
        }
        Ok(Self { network, stages })
    }

    /// Returns the network.
    #[must_use]
    pub fn network(&self) -> Network {
        self.network
    }

    /// Returns the LPIPS of two pictures. It is 0 if all features are equal, and symmetric. It is computed in `f32`, and
    /// about five digits are right. At most three maps of the widest stage are in memory: 1.3 GB for VGG16 at 1600 x
    /// 1066.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the sizes differ, if a picture has NaN or is smaller than [`Network::min_size`], or if the
    /// weights make the features overflow.
    pub fn distance(&self, a: &Image, b: &Image, range: PixelRange) -> Result<f64> {
        comparable(a, b)?;
        let (mut a, mut b) = (self.input(a, range)?, self.input(b, range)?);
        let mut total = 0.0;
        for layers in &self.stages {
            (a, b) = (self.run(layers, a)?, self.run(layers, b)?);
            total += difference(&a, &b, &layers.linear);
        }
        self.finite(total)
    }

    /// Returns the picture in the form in which the first layer reads it.
    fn input(&self, image: &Image, range: PixelRange) -> Result<Map> {
        if image.width.min(image.height) < self.network.min_size() {
            return Err(self.too_small(image.width, image.height));
        }
        let padding = self.stages.first().and_then(|s| s.convs.first()).map_or(0, |c| c.shape.padding);
        let width = image.width as usize;
        let mut map = Map::zeros(width, image.height as usize, COLOURS, padding);
        map.fill_blocks(
            1,
            || (),
            |(), y, row| {
                let to = row[padding * COLOURS..].chunks_exact_mut(COLOURS);
                for (to, pixel) in to.zip(&image.pixels[y * width..(y + 1) * width]) {
                    for (c, (to, &value)) in to.iter_mut().zip(pixel).enumerate() {
                        let value = clip(value);
                        let value = if range == PixelRange::Standard { 2.0 * value - 1.0 } else { value };
                        *to = (value - SHIFT[c]) / SCALE[c];
                    }
                }
            },
        );
        Ok(map)
    }

    /// Returns the output of a stage.
    fn run(&self, layers: &Layers, mut map: Map) -> Result<Map> {
        let (width, height) = (map.width, map.height);
        let small = || self.too_small(width, height);
        let paddings = layers.convs.iter().map(|c| c.shape.padding).chain([layers.padding_after]);
        let mut paddings = paddings.collect::<Vec<usize>>().into_iter();
        let first = paddings.next().unwrap_or(0);
        if let Some(pool) = layers.pool {
            map = map.max_pool(pool.side, pool.stride, first).ok_or_else(small)?;
        }
        for (conv, padding) in layers.convs.iter().zip(paddings) {
            map = conv.apply(&map, padding).ok_or_else(small)?;
        }
        Ok(map)
    }

    fn too_small(&self, width: impl fmt::Display, height: impl fmt::Display) -> Error {
        let (network, least) = (self.network, self.network.min_size());
        let expected = format!("at least {least} x {least} pixels for LPIPS with {network}");
        Error::parameter("picture", format!("{width} x {height}"), expected)
    }

    fn finite(&self, distance: f64) -> Result<f64> {
        if distance.is_finite() {
            return Ok(distance);
        }
        let expected = format!("weights of {} that do not overflow on pictures", self.network);
        Err(Error::parameter("lpips", distance, expected))
    }
}

impl fmt::Debug for Lpips {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Lpips").field("network", &self.network).finish_non_exhaustive()
    }
}

/// Returns the mean over pixels of the weighted squared difference of features. The features of each pixel are first
/// scaled to length 1.
fn difference(a: &Map, b: &Map, weights: &[f32]) -> f64 {
    let channels = weights.len();
    let row = |y| -> f64 {
        let pixels = a.row(y).chunks_exact(channels).zip(b.row(y).chunks_exact(channels));
        pixels
            .map(|(a, b)| {
                let (length_a, length_b) = (length(a) + EPSILON, length(b) + EPSILON);
                sum_lanes(channels, |i| {
                    let difference = f64::from(a[i]) / length_a - f64::from(b[i]) / length_b;
                    f64::from(weights[i]) * difference * difference
                })
            })
            .sum()
    };
    sum_rows(0..a.height, || (), |(), y| row(y)) / (a.width * a.height) as f64
}

fn length(features: &[f32]) -> f64 {
    sum_lanes(features.len(), |i| f64::from(features[i]) * f64::from(features[i])).sqrt()
}

/// Returns the sum of `term` over `0..count`, in [`LANES`] partial sums that a processor can compute at once.
#[inline]
fn sum_lanes(count: usize, term: impl Fn(usize) -> f64) -> f64 {
    let whole = count - count % LANES;
    let mut sums = [0.0; LANES];
    for start in (0..whole).step_by(LANES) {
        for (lane, sum) in sums.iter_mut().enumerate() {
            *sum += term(start + lane);
        }
    }
    sums.iter().sum::<f64>() + (whole..count).map(term).sum::<f64>()
}

#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;
