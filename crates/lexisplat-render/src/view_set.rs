//! A set of cameras, with warnings about their files.

use lexisplat::Offset;

use crate::camera::{Camera, single};

/// Largest distance of a principal point from the centre of the picture without a warning, in pixels on either axis.
/// Rounding the size of a picture moves the principal point by as much.
const CENTRE_SLACK: f64 = 0.5;

/// Cameras, and oddities of their files.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ViewSet {
    /// The cameras. Every camera passes [`Camera::validate`].
    pub cameras: Vec<Camera>,
    /// Position of each camera before rounding.
    pub positions: Vec<[f64; 3]>,
    /// Values that were ignored or look wrong, one sentence each.
    pub warnings: Vec<String>,
}

impl ViewSet {
    /// Returns a set of cameras with their positions before rounding.
    pub(crate) fn new(placed: Vec<(Camera, [f64; 3])>, warnings: Vec<String>) -> Self {
        let (cameras, positions) = placed.into_iter().unzip();
        Self { cameras, positions, warnings }
    }

    /// Returns the cameras for a scene whose positions are relative to `offset`. The offset is subtracted in double
    /// precision. Without an offset nothing changes.
    #[must_use]
    pub fn relative_to(mut self, offset: Option<Offset>) -> Self {
        let Some(offset) = offset.map(Offset::get) else { return self };
        for (camera, position) in self.cameras.iter_mut().zip(&mut self.positions) {
            *position = [0, 1, 2].map(|k| position[k] - offset[k]);
            camera.position = position.map(single);
        }
        self
    }
}

/// Returns the width and height, in pixels, of the photo with the given name; `None` if they are not known. It is called
/// only if the file of cameras does not state the size.
pub type SizeOf<'a> = &'a mut dyn FnMut(&str) -> Option<(u32, u32)>;

/// Counts principal points that are off the centre, for one warning about all of them.
#[derive(Debug, Default)]
pub(crate) struct PrincipalPoints {
    off: usize,
    most: f64,
}

impl PrincipalPoints {
    /// Examines the principal point `centre` of a picture of `width * height` pixels.
    pub(crate) fn see(&mut self, centre: [f64; 2], width: u32, height: u32) {
        let [x, y] = centre;
        let (x, y) = ((x - f64::from(width) / 2.0).abs(), (y - f64::from(height) / 2.0).abs());
        let off = x.max(y);
        if off > CENTRE_SLACK {
            self.off += 1;
            self.most = self.most.max(off);
        }
    }

    /// Returns the warning, if there is a reason for one.
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

    /// The camera is 0.015625 beside the offset, which single precision cannot tell from it.
    #[test]
    fn an_offset_is_subtracted_before_rounding() {
        let far = [500_000.015_625, 4_649_776.5, -3.0];
        let list = format!(
            r#"[{{"img_name": "a", "width": 8, "height": 8, "fx": 8, "fy": 8, "position": {far:?},
                "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}}]"#
        );
        let transforms = format!(
            r#"{{"w": 8, "h": 8, "fl_x": 8, "frames": [{{"file_path": "a", "transform_matrix":
                [[1, 0, 0, {}], [0, 1, 0, {}], [0, 0, 1, {}], [0, 0, 0, 1]]}}]}}"#,
            far[0], far[1], far[2]
        );
        let model = |x: f64| format!("1 1 0 0 0 {x} {} {} 1 a\n\n", -far[1], -far[2]);
        let colmap =
            crate::read_colmap_text("m", b"1 PINHOLE 8 8 8 8 4 4\n", model(-far[0]).as_bytes()).unwrap();
        let read = |text: &str| crate::read_views_bytes("v", text.as_bytes(), &mut |_| None).unwrap();
        let offset = Offset::new([500_000.0, 4_649_776.0, 0.0]).unwrap();
        for set in [read(&list), read(&transforms), colmap] {
            assert_eq!(set.clone().relative_to(None), set);
            let set = set.relative_to(offset);
            assert_eq!(set.cameras[0].position, [0.015_625, 0.5, -3.0]);
            assert_eq!(set.positions[0], [0.015_625, 0.5, -3.0]);
        }
    }

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
