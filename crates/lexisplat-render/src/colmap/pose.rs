//! COLMAP's poses as cameras.

use glam::{DMat3, DQuat, DVec3};

use super::intrinsics::Intrinsics;
use crate::camera::Camera;
use crate::error::Result;

/// An image: its name, the number of its camera, and its pose.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Posed {
    pub(super) name: String,
    pub(super) camera: u32,
    /// World-to-camera rotation as a quaternion (w, x, y, z), of any length above 0 as in COLMAP.
    pub(super) quaternion: [f64; 4],
    /// World-to-camera translation, applied after the rotation, in world units.
    pub(super) translation: [f64; 3],
}

impl Posed {
    /// Returns the image as a camera with `intrinsics`, and its position before rounding.
    pub(super) fn camera(&self, intrinsics: &Intrinsics) -> Result<(Camera, [f64; 3]), String> {
        let [w, x, y, z] = self.quaternion;
        let quaternion = DQuat::from_xyzw(x, y, z, w);
        let squares = quaternion.length_squared();
        if !(squares.is_normal() && DVec3::from_array(self.translation).is_finite()) {
            return Err(format!(
                "not a pose: quaternion {:?}, translation {:?}",
                self.quaternion, self.translation
            ));
        }
        let to_camera = DMat3::from_quat(quaternion.normalize());
        let position = -(to_camera.transpose() * DVec3::from_array(self.translation));
        let size = [intrinsics.width, intrinsics.height];
        // The columns of the world-to-camera rotation are the rows of the camera-to-world rotation.
        let rotation = to_camera.to_cols_array_2d();
        let camera =
            Camera::rounded(self.name.clone(), size, intrinsics.focal, position.to_array(), rotation);
        camera.validate().map_err(|e| e.to_string())?;
        Ok((camera, position.to_array()))
    }
}
