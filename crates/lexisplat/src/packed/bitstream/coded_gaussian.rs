//! The values of a Gaussian that the encoder codes.

use crate::packed::bitstream::parameters::{CHANGES, ColourAndShape, TARGETS};
use crate::packed::bitstream::values::{across, main_axis};
use crate::support::maths::{Vec3, atan2, dot, square_of_axis};

/// A Gaussian as the encoder codes it.
#[derive(Debug, Clone, Default)]
pub(in crate::packed) struct CodedGaussian {
    /// Number of its cell on the Morton curve. It is at least that of the previous Gaussian in its lane.
    pub(in crate::packed) cell: u64,
    pub(in crate::packed) classes: ColourAndShape<u8>,
    /// The logarithms of the scales and of the opacity, and the coordinates of the base colour, as multiples of
    /// `2^-VALUE_BITS`.
    pub(in crate::packed) values: [i32; TARGETS],
    /// Its axes, longest first, right-handed.
    pub(in crate::packed) axes: [Vec3; 3],
    /// Position relative to the centre of the cell, in world units.
    pub(in crate::packed) offset: [f64; 3],
    /// Pairs `(atom, value)` with values in steps that are not 0, largest first.
    pub(in crate::packed) code: Vec<(u16, i32)>,
    /// The squared change of pictures without the Gaussian.
    pub(in crate::packed) energy: f32,
    /// The interim changes, in steps.
    pub(in crate::packed) interim: [i32; CHANGES],
    /// The exact SH-rest row if the Gaussian has no code; otherwise empty.
    pub(in crate::packed) exact: Vec<f32>,
}

impl CodedGaussian {
    /// Returns the codes of the rotation with all bits: the two coordinates of the main axis with `direction` bits each,
    /// and the turn about it with `turn` bits. The main axis is the longest one of a `needle`, otherwise the shortest one.
    pub(in crate::packed) fn rotation_codes(&self, [direction, turn]: [u32; 2], needle: bool) -> [u32; 3] {
        let (main, other) = if needle { (0, 1) } else { (2, 0) };
        let cell = |x: f32, bits: u32| -> u32 {
            let size = (1_u32 << bits) as f32;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let cell = (x * size).floor().max(0.0).min(size - 1.0) as u32;
            cell
        };
        let middle = |code: u32, bits: u32| (code as f32 + 0.5) / (1_u32 << bits) as f32;
        let codes = square_of_axis(self.axes[main]).map(|x| cell((x + 1.0) * 0.5, direction));
        let u = main_axis(middle(codes[0], direction), middle(codes[1], direction));
        let [first, second] = across(u);
        let angle = atan2(dot(self.axes[other], second), dot(self.axes[other], first));
        let half_turn = std::f32::consts::PI;
        [codes[0], codes[1], cell(angle.rem_euclid(half_turn) / half_turn, turn)]
    }
}
