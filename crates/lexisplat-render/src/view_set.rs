//! A set of cameras, with warnings about the files they were read from.

use crate::camera::Camera;

/// A principal point farther than this from the picture's centre, in pixels on either axis, is worth a
/// warning. Rounding a picture's size moves it by as much.
const CENTRE_SLACK: f64 = 0.5;

/// Cameras, and what is odd about their files.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ViewSet {
    /// The cameras; every one passes [`Camera::validate`].
    pub cameras: Vec<Camera>,
    /// What was ignored or looks wrong, one sentence each.
    pub warnings: Vec<String>,
}

/// Returns the width and height, in pixels, of the photo of a name; `None` if they are not known. It is asked
/// only where the cameras' file does not say.
pub type SizeOf<'a> = &'a mut dyn FnMut(&str) -> Option<(u32, u32)>;

/// Counts the principal points that are off the centre, for one warning about all of them.
#[derive(Debug, Default)]
pub(crate) struct PrincipalPoints {
    off: usize,
    most: f64,
}

impl PrincipalPoints {
    /// Looks at the principal point `centre` of a picture of `width * height` pixels.
    pub(crate) fn see(&mut self, centre: [f64; 2], width: u32, height: u32) {
        let [x, y] = centre;
        let (x, y) = ((x - f64::from(width) / 2.0).abs(), (y - f64::from(height) / 2.0).abs());
        let off = x.max(y);
        if off > CENTRE_SLACK {
            self.off += 1;
            self.most = self.most.max(off);
        }
    }

    /// The warning, if there is something to warn of.
    pub(crate) fn warning(&self) -> Option<String> {
        (self.off > 0).then(|| {
            let cameras = if self.off == 1 { "camera" } else { "cameras" };
            format!(
                "principal point of {} {cameras} is up to {:.1} pixels off the centre; it is ignored, as the 3DGS authors' loader does",
                self.off, self.most
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn principal_points_are_told_once() {
        let mut points = PrincipalPoints::default();
        points.see([399.5, 266.4], 799, 532);
        assert_eq!(points.warning(), None);
        points.see([387.2, 266.0], 799, 532);
        points.see([400.5, 270.0], 799, 532);
        let warning = points.warning().unwrap();
        assert!(warning.starts_with("principal point of 2 cameras is up to 12.3 pixels"), "{warning}");
    }
}
