//! The placement of a primitive's splats along the axes of a trainer's PLY.

use lexisplat::{Error, Offset, Result, ShDegree};

use super::nodes::Matrix;
use crate::axes::Flip;
use crate::quaternion::{product, turned};
use crate::rows::RowsMut;
use crate::turn_sh::ShRotation;

/// The axes of glTF: x left, y up, z forward. Half a turn about z leads to them from the axes of a trainer's PLY.
pub(super) const GLTF: [bool; 3] = [true, true, false];
/// Largest relative difference of the lengths of columns, and largest absolute cosine of their angles.
const SLACK: f64 = 1e-4;
/// Largest difference of entries of a rotation from 0, 1 and -1 at which they are rounded to these values.
const SIGN_SLACK: f64 = 1e-9;

/// Changes that put splats along the axes of a trainer's PLY. They are made in the order of the fields.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placement {
    flip: Flip,
    /// Quaternion (w, x, y, z) of length 1.
    turn: Option<[f64; 4]>,
    scale: f64,
    translation: [f64; 3],
    pub(super) is_mirrored: bool,
}

impl Placement {
    /// Returns the placement of the splats of node `node`, which `matrix` puts into the scene. The axes in `changes` have
    /// signs that differ from those of the glTF.
    ///
    /// # Errors
    /// [`Error::Format`] for a matrix that scales the axes differently or shears.
    pub(super) fn of(name: &str, node: usize, matrix: &Matrix, changes: [bool; 3]) -> Result<Self> {
        let sign = |change: bool| if change { -1.0 } else { 1.0 };
        let to = GLTF.map(sign);
        // Factors to the left of the matrix apply to rows, and factors to the right of it to columns.
        let [x, y, z, translation] = matrix.map(|column| [0, 1, 2].map(|k| to[k] * column[k]));
        let mut columns = [x, y, z];
        for (column, change) in columns.iter_mut().zip(changes) {
            *column = column.map(|v| sign(change) * v);
        }
        let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
        let lengths = columns.map(|column| dot(column, column).sqrt());
        let scale = libm::cbrt(lengths.iter().product());
        if !(scale > 0.0 && scale.is_finite()) || lengths.iter().any(|v| (v / scale - 1.0).abs() > SLACK) {
            let text = format!("node {node} scales its axes by {lengths:?}: only equal scales are read");
            return Err(Error::malformed(name, text));
        }
        let columns = columns.map(|column| column.map(|v| v / scale));
        let [x, y, z] = columns;
        if [dot(x, y), dot(y, z), dot(z, x)].iter().any(|cosine| cosine.abs() > SLACK) {
            return Err(Error::malformed(name, format!("node {node} shears, which is not read")));
        }
        let volume = x[0] * (y[1] * z[2] - y[2] * z[1])
            + x[1] * (y[2] * z[0] - y[0] * z[2])
            + x[2] * (y[0] * z[1] - y[1] * z[0]);
        let is_mirrored = volume < 0.0;
        let is_sign = |row: usize, k: usize| {
            let expected = if row == k { 1.0 } else { 0.0 };
            (columns[k][row].abs() - expected).abs() <= SIGN_SLACK
        };
        if (0..9).all(|k| is_sign(k / 3, k % 3)) {
            let flip = Flip::of([0, 1, 2].map(|k| columns[k][k] < 0.0));
            return Ok(Self { flip, turn: None, scale, translation, is_mirrored });
        }
        // A mirrored rotation is a mirroring along x followed by a rotation.
        let x = if is_mirrored { x.map(|v| -v) } else { x };
        let flip = Flip::of([is_mirrored, false, false]);
        Ok(Self { flip, turn: Some(quaternion([x, y, z])), scale, translation, is_mirrored })
    }

    /// Returns the position of the origin of the splats.
    pub(super) fn translation(&self) -> [f64; 3] {
        self.translation
    }

    /// Makes the placement relative to `offset`.
    pub(super) fn rebase(&mut self, offset: Offset) {
        let numbers = offset.get();
        self.translation = [0, 1, 2].map(|k| self.translation[k] - numbers[k]);
    }

    /// Applies the placement to the splats of `out`, of `degree`.
    #[expect(clippy::cast_possible_truncation, reason = "scenes are in single precision")]
    #[expect(clippy::float_cmp, reason = "only exactly 1 and 0 change nothing")]
    pub(super) fn apply(&self, degree: ShDegree, out: RowsMut<'_>) {
        let moves = self.turn.is_some() || self.scale != 1.0 || self.translation != [0.0; 3];
        for position in out.positions {
            *position = self.flip.position(*position);
            if moves {
                let turned =
                    self.turn.map_or(position.map(f64::from), |q| turned(q, position.map(f64::from)));
                *position = [0, 1, 2].map(|k| (turned[k] * self.scale + self.translation[k]) as f32);
            }
        }
        let more = libm::log(self.scale) as f32;
        if more != 0.0 {
            out.scales.as_flattened_mut().iter_mut().for_each(|v| *v += more);
        }
        for rotation in out.rotations {
            *rotation = self.flip.rotation(*rotation);
            if let Some(q) = self.turn {
                *rotation = product(q, rotation.map(f64::from)).map(|v| v as f32);
            }
        }
        let per = degree.rest_per_channel();
        if per == 0 {
            return;
        }
        let signs = self.flip.rest();
        for channel in out.sh_rest.chunks_exact_mut(per) {
            channel.iter_mut().zip(&signs).for_each(|(v, sign)| *v *= sign);
        }
        if let Some(q) = self.turn {
            let turn = ShRotation::new(q);
            out.sh_rest.chunks_exact_mut(degree.rest()).for_each(|row| turn.apply(degree, row));
        }
    }
}

/// Returns the quaternion (w, x, y, z) of the rotation with these columns.
fn quaternion([x, y, z]: [[f64; 3]; 3]) -> [f64; 4] {
    // Each candidate has four times the products of all components with one of them. The component with the largest
    // square is used.
    let squares = [
        1.0 + x[0] + y[1] + z[2],
        1.0 + x[0] - y[1] - z[2],
        1.0 - x[0] + y[1] - z[2],
        1.0 - x[0] - y[1] + z[2],
    ];
    let (wx, wy, wz) = (y[2] - z[1], z[0] - x[2], x[1] - y[0]);
    let (xy, xz, yz) = (x[1] + y[0], z[0] + x[2], y[2] + z[1]);
    let candidates = [
        [squares[0], wx, wy, wz],
        [wx, squares[1], xy, xz],
        [wy, xy, squares[2], yz],
        [wz, xz, yz, squares[3]],
    ];
    let most = (0..4).fold(0, |most, k| if squares[k] > squares[most] { k } else { most });
    let q = candidates[most];
    let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    q.map(|v| v / length)
}
