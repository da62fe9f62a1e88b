//! Which cameras to draw from.

use std::path::Path;

use lexisplat::Geometry;
use lexisplat_render::{Camera, Split, orbit, read_cameras};

use crate::error::{Error, Result};

/// Widest picture drawn unless asked otherwise, as the field does (INRIA `utils/camera_utils.py`).
pub const DEFAULT_MAX_WIDTH: u32 = 1600;
/// Views of an automatic orbit.
pub const DEFAULT_ORBIT: u16 = 8;
/// Size of an orbit's pictures before the width cap, in pixels.
pub const ORBIT_SIZE: (u32, u32) = (960, 640);

/// Which views of a cameras file to use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SplitFilter {
    /// All of them.
    #[default]
    All,
    /// Those marked `train`.
    Train,
    /// Those marked `test`.
    Test,
}

/// Cameras from an INRIA `cameras.json`, or an orbit of `orbit_views` fitted to `geometry`.
///
/// # Errors
/// What [`read_cameras`] says; [`Error::Parameter`] if the filter leaves no camera.
pub fn choose_views(
    cameras: Option<&Path>,
    filter: SplitFilter,
    orbit_views: u16,
    max_width: u32,
    geometry: &Geometry,
) -> Result<Vec<Camera>> {
    let found = match cameras {
        Some(path) => read_cameras(path)?,
        None => orbit(geometry, orbit_views.into(), ORBIT_SIZE.0, ORBIT_SIZE.1),
    };
    let wanted = match filter {
        SplitFilter::All => None,
        SplitFilter::Train => Some(Split::Train),
        SplitFilter::Test => Some(Split::Test),
    };
    let views: Vec<Camera> = found
        .iter()
        .filter(|camera| wanted.is_none() || camera.split == wanted)
        .map(|camera| camera.with_max_width(max_width))
        .collect();
    if views.is_empty() {
        let value = format!("{filter:?}").to_lowercase();
        let expected = format!("a split that some of the {} cameras are marked with", found.len());
        return Err(Error::parameter("split", value, expected));
    }
    Ok(views)
}
