//! Convolutions, each followed by ReLU.

use super::gemm::{Sizes, Store, multiply};
use super::map::{Map, windows};

/// Approximate number of output pixels of one product. With fewer, packing the weights takes too long. With more, threads
/// have no work.
const BLOCK_PIXELS: usize = 512;
/// Smallest number of blocks into which a map is cut, so that small maps use all cores.
const MIN_BLOCKS: usize = 8;

/// Shape of a convolution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ConvShape {
    /// Number of the layer in torchvision's `features`, which is part of the names of its tensors.
    pub(super) index: usize,
    /// Number of features of an input pixel.
    pub(super) inputs: usize,
    /// Number of features of an output pixel.
    pub(super) outputs: usize,
    /// Side of the window in pixels.
    pub(super) side: usize,
    /// Distance of neighbouring windows, in pixels.
    pub(super) stride: usize,
    /// Width of the border of zeros around the map, in pixels.
    pub(super) padding: usize,
}

impl ConvShape {
    /// Returns the shape of the weights in PyTorch.
    pub(super) fn weight_shape(&self) -> [usize; 4] {
        [self.outputs, self.inputs, self.side, self.side]
    }
}

/// A convolution with its weights.
#[derive(Debug)]
pub(super) struct Conv {
    pub(super) shape: ConvShape,
    /// Weights, ordered by row of the window, pixel of the row, input and output.
    weights: Vec<f32>,
    bias: Vec<f32>,
}

impl Conv {
    /// Returns the convolution with weights in PyTorch's order: output, input, row, column. Weights and biases must have
    /// the lengths of `shape`.
    pub(super) fn new(shape: ConvShape, weights: &[f32], bias: Vec<f32>) -> Self {
        let ConvShape { inputs, outputs, side, .. } = shape;
        let window = side * side;
        let mut ordered = Vec::with_capacity(weights.len());
        for place in 0..window {
            for input in 0..inputs {
                ordered
                    .extend((0..outputs).map(|output| weights[(output * inputs + input) * window + place]));
            }
        }
        Self { shape, weights: ordered, bias }
    }

    /// Returns the output of the layer with a border of `padding` zeros, or `None` if no window fits. The border of
    /// `input` must be as wide as the padding of this layer.
    ///
    /// The pixels of a window's row lie together in memory. Each row of the window is therefore one matrix product with
    /// overlapping input rows, and the products are added. One product covers several output rows with their borders.
    pub(super) fn apply(&self, input: &Map, padding: usize) -> Option<Map> {
        let ConvShape { inputs, outputs, side, stride, .. } = self.shape;
        let padded = input.width + 2 * input.padding;
        let (width, height) =
            (windows(padded, side, stride)?, windows(input.height + 2 * input.padding, side, stride)?);
        let mut out = Map::zeros(width, height, outputs, padding);
        // With a stride above 1 the output pixels of consecutive rows are not evenly spaced.
        let rows =
            if stride == 1 { (BLOCK_PIXELS / padded).clamp(1, height.div_ceil(MIN_BLOCKS)) } else { 1 };
        let row_entries = out.row_entries();
        out.fill_blocks(rows, Vec::new, |sums: &mut Vec<f32>, first, block| {
            let pixels = (block.len() / row_entries - 1) * padded + width;
            let sizes = Sizes { rows: pixels, depth: side * inputs, columns: outputs };
            sums.resize(pixels * outputs, 0.0);
            for (row, weights) in self.weights.chunks_exact(sizes.depth * outputs).enumerate() {
                let start = (first * stride + row) * input.row_entries();
                let store = if row == 0 { Store::Replace } else { Store::Add };
                multiply(sizes, &input.values[start..], stride * inputs, weights, sums, store);
            }
            let lines = sums.chunks(padded * outputs);
            for (row, line) in block.chunks_exact_mut(row_entries).zip(lines) {
                let to = row[padding * outputs..].chunks_exact_mut(outputs);
                for (to, from) in to.zip(line.chunks_exact(outputs)).take(width) {
                    for ((to, from), bias) in to.iter_mut().zip(from).zip(&self.bias) {
                        *to = (from + bias).max(0.0);
                    }
                }
            }
        });
        Some(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(count: usize, seed: u32) -> Vec<f32> {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f32::from(u16::try_from(state >> 16).unwrap()) / 32_768.0 - 1.0
        };
        (0..count).map(|_| next()).collect()
    }

    /// The convolution by its definition, in `f64`.
    fn naive(shape: ConvShape, weights: &[f32], bias: &[f32], input: &Map) -> Vec<f64> {
        let ConvShape { inputs, outputs, side, stride, padding, .. } = shape;
        let (width, height) = (
            (input.width + 2 * padding - side) / stride + 1,
            (input.height + 2 * padding - side) / stride + 1,
        );
        let mut out = Vec::new();
        for (y, x, o) in
            (0..height).flat_map(|y| (0..width).flat_map(move |x| (0..outputs).map(move |o| (y, x, o))))
        {
            let mut sum = f64::from(bias[o]);
            for (dy, dx) in (0..side).flat_map(|dy| (0..side).map(move |dx| (dy, dx))) {
                let (v, u) = ((y * stride + dy).checked_sub(padding), (x * stride + dx).checked_sub(padding));
                let (Some(v), Some(u)) = (v, u) else { continue };
                if v >= input.height || u >= input.width {
                    continue;
                }
                for i in 0..inputs {
                    let weight = weights[((o * inputs + i) * side + dy) * side + dx];
                    sum += f64::from(weight) * f64::from(input.row(v)[u * inputs + i]);
                }
            }
            out.push(sum.max(0.0));
        }
        out
    }

    #[test]
    fn agrees_with_the_definition() {
        for (width, height, inputs, outputs, side, stride, padding) in [
            (9, 7, 2, 5, 3, 1, 1),
            (40, 33, 3, 8, 3, 1, 1),
            (23, 19, 3, 4, 11, 4, 2),
            (6, 9, 4, 3, 5, 1, 2),
            (1, 1, 3, 2, 3, 1, 1),
            (700, 3, 2, 3, 3, 1, 1),
            (5, 5, 1, 1, 1, 1, 0),
        ] {
            let shape = ConvShape { index: 0, inputs, outputs, side, stride, padding };
            let mut input = Map::zeros(width, height, inputs, padding);
            let values = numbers(width * height * inputs, 1);
            input.fill_blocks(
                1,
                || (),
                |(), y, row| {
                    row[padding * inputs..][..width * inputs]
                        .copy_from_slice(&values[y * width * inputs..][..width * inputs]);
                },
            );
            let weights = numbers(outputs * inputs * side * side, 2);
            let bias: Vec<f32> = numbers(outputs, 3).iter().map(|bias| bias + 0.7).collect();
            let slow = naive(shape, &weights, &bias, &input);
            let conv = Conv::new(shape, &weights, bias);
            for after in [0, 2] {
                let fast = conv.apply(&input, after).unwrap();
                let found: Vec<f32> = (0..fast.height).flat_map(|y| fast.row(y).to_vec()).collect();
                assert_eq!(found.len(), slow.len());
                for (found, slow) in found.iter().zip(&slow) {
                    assert!((f64::from(*found) - slow).abs() < 1e-4, "{shape:?}: {found} {slow}");
                }
                assert!(slow.iter().any(|&v| v > 0.1), "some output must be on: {shape:?}");
                let inside: f64 = found.iter().map(|&v| f64::from(v)).sum();
                let all: f64 = fast.values.iter().map(|&v| f64::from(v)).sum();
                assert!((all - inside).abs() < 1e-6, "borders stay zero");
            }
        }
    }

    #[test]
    fn an_input_smaller_than_the_window_has_no_output() {
        let shape = ConvShape { index: 0, inputs: 1, outputs: 1, side: 11, stride: 4, padding: 2 };
        let conv = Conv::new(shape, &[0.0; 121], vec![0.0]);
        assert!(conv.apply(&Map::zeros(6, 30, 1, 2), 0).is_none());
        assert!(conv.apply(&Map::zeros(7, 7, 1, 2), 0).is_some());
    }
}
