//! The pose of a camera, and its text in files, links and scripts.

use std::fmt;

use glam::{DMat3, DQuat};

use crate::camera::Camera;

/// Number of decimals of a quaternion's components. Half a unit of the last decimal turns the view by less than 2e-7
/// radians, below 1/500 of a pixel of a picture 4000 pixels wide.
const ROTATION_DECIMALS: usize = 7;
/// Number of significant digits of the pivot's distance and of the focal length.
const DIGITS: usize = 8;
/// Largest unit of the last decimal of a position, as a share of the pivot's distance. Half of it moves objects at the
/// pivot by less than 1/1000 of a pixel in a picture 4000 pixels wide.
const POSITION_PART: f64 = 1e-7;
/// Largest number of decimals of a position.
const MOST_DECIMALS: f64 = 30.0;
/// Largest number of steps to a quaternion that is rounded to itself. Random quaternions take up to 3.
const STEPS: usize = 16;
/// Largest difference from 1 of the length of a quaternion in a text.
const LENGTH_TOLERANCE: f64 = 1e-2;
/// Range of focal lengths, in units of the picture's shorter side. Other focal lengths give no picture in single
/// precision.
const FOCALS: std::ops::RangeInclusive<f64> = 1e-6..=1e6;
/// Number of numbers in a text before the optional [`MIRRORED`].
const NUMBERS: usize = 9;
/// Word after the numbers of a mirrored camera.
const MIRRORED: &str = "mirrored";

/// The pose of a camera: its place, direction, pivot and focal length.
///
/// Its text is `X:Y:Z:I:J:K:W:DISTANCE:FOCAL`, followed by `:mirrored` for a mirrored camera. Positions are rounded to
/// 1e-7 of the distance or finer, the quaternion to 7 decimals, distance and focal length to 8 digits. The text of a pose
/// that was read from such a text is the same text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Camera centre in world units.
    pub position: [f64; 3],
    /// Unit quaternion i, j, k, w from camera to world. The camera's axes are right, down and forward.
    pub rotation: [f64; 4],
    /// Whether the camera's right axis is negated before the rotation. Some published cameras are mirrored in this way.
    pub mirrored: bool,
    /// Distance of the pivot, which is straight ahead, in world units.
    pub distance: f64,
    /// Focal length, in units of the picture's shorter side.
    pub focal: f64,
}

impl Pose {
    /// Returns the pose with these axes: the directions right, down and forward in the world, which are orthonormal.
    #[must_use]
    pub fn of(position: [f64; 3], axes: [[f64; 3]; 3], distance: f64, focal: f64) -> Self {
        let axes = DMat3::from_cols_array_2d(&axes);
        let mirrored = axes.determinant() < 0.0;
        let rotation = DQuat::from_mat3(&handed(axes, mirrored)).to_array();
        Self { position, rotation, mirrored, distance, focal }
    }

    /// Returns the pose of `camera`, whose pivot is at this distance.
    #[must_use]
    pub fn of_camera(camera: &Camera, distance: f64) -> Self {
        let axes = DMat3::from_cols_array_2d(&camera.rotation.map(|row| row.map(f64::from))).transpose();
        let short = f64::from(camera.width.min(camera.height).max(1));
        let position = camera.position.map(f64::from);
        Self::of(position, axes.to_cols_array_2d(), distance, f64::from(camera.fy) / short)
    }

    /// Returns the camera of this pose for a picture of this width and height, whose near plane is at distance `near`.
    #[must_use]
    pub fn camera(&self, size: [u32; 2], near: f32) -> Camera {
        let focal = self.focal * f64::from(size[0].min(size[1]));
        let axes = self.axes();
        let rotation = [0, 1, 2].map(|row| axes.map(|axis| axis[row]));
        Camera::rounded("first view".to_owned(), size, [focal; 2], self.position, rotation).with_near(near)
    }

    /// Returns the directions right, down and forward in the world.
    #[must_use]
    pub fn axes(&self) -> [[f64; 3]; 3] {
        let rotation = DQuat::from_array(self.rotation).normalize();
        handed(DMat3::from_quat(rotation), self.mirrored).to_cols_array_2d()
    }

    /// Returns the pose of a text. Returns `None` if a number is missing, is not finite or gives no picture in single
    /// precision, or if the length of the quaternion is not 1.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let (numbers, mirrored) = match text.strip_suffix(MIRRORED).and_then(|rest| rest.strip_suffix(':')) {
            Some(numbers) => (numbers, true),
            None => (text, false),
        };
        // One more part than allowed is enough to see that there are too many.
        let parts = numbers.split(':').take(NUMBERS + 1).map(|part| part.trim().parse().ok());
        let numbers: Vec<f64> = parts.collect::<Option<_>>()?;
        let [x, y, z, i, j, k, w, distance, focal] = <[f64; NUMBERS]>::try_from(numbers).ok()?;
        let (position, rotation) = ([x, y, z], [i, j, k, w]);
        let lengths = f64::from(f32::MIN_POSITIVE)..=f64::from(f32::MAX);
        let is_placed = position.iter().all(|v| v.abs() <= *lengths.end());
        let is_turned = (DQuat::from_array(rotation).length() - 1.0).abs() <= LENGTH_TOLERANCE;
        let is_drawn = lengths.contains(&distance) && FOCALS.contains(&focal);
        let rotation = DQuat::from_array(rotation).normalize().to_array();
        (is_placed && is_turned && is_drawn).then_some(Self { position, rotation, mirrored, distance, focal })
    }

    /// Returns the pose of a link that a viewer copied, which has the text after `view=`, or of the text alone.
    #[must_use]
    pub fn from_link(link: &str) -> Option<Self> {
        let text = link.rsplit_once("view=").map_or(link, |(_, text)| text);
        text.split(['&', ',']).next().and_then(Self::parse)
    }
}

/// Returns `axes`. The first axis is negated if `mirrored` is set.
fn handed(axes: DMat3, mirrored: bool) -> DMat3 {
    let sign = if mirrored { -1.0 } else { 1.0 };
    DMat3::from_cols(axes.x_axis * sign, axes.y_axis, axes.z_axis)
}

impl fmt::Display for Pose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let distance = significant(self.distance);
        // The rounded distance determines the decimals, so that a pose that is read back is written in the same way.
        let digits = -(distance * POSITION_PART).log10().floor();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 30; NaN becomes 0")]
        let decimals = digits.clamp(0.0, MOST_DECIMALS) as usize;
        for value in self.position {
            write!(f, "{}:", rounded(value, decimals))?;
        }
        for value in settled(self.rotation) {
            write!(f, "{value}:")?;
        }
        write!(f, "{distance}:{}", significant(self.focal))?;
        if self.mirrored { write!(f, ":{MIRRORED}") } else { Ok(()) }
    }
}

/// Returns `value` rounded to `decimals` decimals. Zero is never negative. Values that are not finite do not change.
fn rounded(value: f64, decimals: usize) -> f64 {
    // The text is rounded, because a power of ten is not exact in binary.
    format!("{value:.decimals$}").parse().unwrap_or(value) + 0.0
}

/// Returns `value` with [`DIGITS`] significant digits.
fn significant(value: f64) -> f64 {
    format!("{value:.*e}", DIGITS - 1).parse().unwrap_or(value)
}

/// Returns a rounded quaternion of the same rotation that is rounded to itself after it is scaled to length 1. Its first
/// component that is not 0, in the order from w on, is above 0.
fn settled(rotation: [f64; 4]) -> [f64; 4] {
    let round = |q: [f64; 4]| q.map(|v| rounded(v, ROTATION_DECIMALS));
    let mut now = round(rotation);
    for _ in 0..STEPS {
        let next = round(DQuat::from_array(now).normalize().to_array());
        if next == now {
            break;
        }
        now = next;
    }
    let [i, j, k, w] = now;
    let first = [w, i, j, k].into_iter().find(|v| *v != 0.0).unwrap_or(1.0);
    now.map(|v| v * first.signum() + 0.0)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_text_is_short_and_readable() {
        let turned = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];
        let pose = Pose::of([1.5, -0.25, 1.0 / 3.0], turned, 4.0, 0.9);
        assert_eq!(pose.to_string(), "1.5:-0.25:0.3333333:0:1:0:0:4:0.9");
        let mirrored = Pose { mirrored: true, ..pose };
        assert_eq!(Pose::parse(&mirrored.to_string()).unwrap().to_string(), mirrored.to_string());
        assert_eq!(mirrored.axes()[0], [1.0, 0.0, 0.0]);
    }

    #[test]
    fn a_link_has_a_pose() {
        let text = "1.5:-0.25:0:0:1:0:0:4:0.9";
        let pose = Pose::parse(text);
        assert!(pose.is_some());
        for link in [text, &format!("view={text}"), &format!("https://a.b/?budget=3#view={text}&mode=first")]
        {
            assert_eq!(Pose::from_link(link), pose, "{link}");
        }
        for bad in ["", "view=", "1:2:3", "camera=4"] {
            assert_eq!(Pose::from_link(bad), None, "{bad}");
        }
    }

    #[test]
    fn nonsense_is_no_pose() {
        assert!(Pose::parse("0:0:0:0:0:0:1:1:1").is_some());
        for bad in [
            "",
            "0:0:0:0:0:0:1:1",
            "0:0:0:0:0:0:1:1:1:1",
            "0:0:0:0:0:0:1:1:1:mirror",
            "0:0:0:0:0:0:1:1:1mirrored",
            "mirrored",
            "nan:0:0:0:0:0:1:1:1",
            "1e300:0:0:0:0:0:1:1:1",
            "0:0:0:0:0:0:0:1:1",
            "0:0:0:0:0:nan:1:1:1",
            "0:0:0:1:0:0:1:1:1",
            "0:0:0:0:0:0:1:0:1",
            "0:0:0:0:0:0:1:-1:1",
            "0:0:0:0:0:0:1:inf:1",
            "0:0:0:0:0:0:1:1:0",
            "0:0:0:0:0:0:1:1:1e9",
            "0:0:0:0:0:0:1:1:x",
        ] {
            assert_eq!(Pose::parse(bad), None, "{bad}");
        }
    }

    #[test]
    fn what_is_not_finite_is_written_and_refused() {
        for value in [f64::NAN, f64::INFINITY, 0.0] {
            let rotation = [value; 4];
            let pose =
                Pose { position: [value; 3], rotation, mirrored: false, distance: value, focal: value };
            assert_eq!(Pose::parse(&pose.to_string()), None);
        }
    }

    proptest! {
        #[test]
        fn a_text_read_back_is_written_the_same(
            position in prop::array::uniform3(-1e3..1e3_f64),
            axis in prop::array::uniform3(-1.0..1.0_f64),
            angle in prop_oneof![
                -6.3..6.3_f64,
                Just(0.0), Just(std::f64::consts::PI), Just(-std::f64::consts::FRAC_PI_2),
            ],
            exponent in -6.0..6.0_f64,
            focal in 0.05..20.0_f64,
            mirrored: bool,
        ) {
            let axis = DVec3::from_array(axis).try_normalize().unwrap_or(DVec3::Y);
            let (scale, distance) = (10_f64.powf(exponent), 10_f64.powf(exponent) * 3.7);
            let axes = handed(DMat3::from_axis_angle(axis, angle), mirrored);
            let position = DVec3::from_array(position) * scale;
            let pose = Pose::of(position.to_array(), axes.to_cols_array_2d(), distance, focal);
            let text = pose.to_string();
            let read = Pose::parse(&text).unwrap();
            let again = Pose::of(read.position, read.axes(), read.distance, read.focal);
            prop_assert_eq!(again.to_string(), text);
            prop_assert!((DVec3::from_array(read.position) - position).length() <= 1e-7 * distance);
            for (got, want) in read.axes().as_flattened().iter().zip(axes.to_cols_array()) {
                prop_assert!((got - want).abs() < 1e-6);
            }
            prop_assert!((read.distance / distance - 1.0).abs() < 1e-7 && (read.focal / focal - 1.0).abs() < 1e-7);
        }
    }
}
