//! The cameras of a file named by the user.

use std::path::Path;

use lexisplat::{Geometry, Offset};
use lexisplat_compress::{SplitFilter, ViewOptions, find_views};
use lexisplat_render::Camera;

use crate::error::Result;

/// The cameras of a file, in the world of the scene that they show.
#[derive(Debug, Clone)]
pub(crate) struct GivenCameras {
    options: ViewOptions,
    cameras: Vec<Camera>,
}

impl GivenCameras {
    /// Reads the cameras of `file` that `split` lets through, for a scene without an offset. Pictures are at most
    /// `max_width` pixels wide. The near plane is `near`, or that of the file.
    pub(crate) fn read(file: &Path, split: SplitFilter, max_width: u32, near: Option<f32>) -> Result<Self> {
        let (cameras, max_width) = (Some(file.to_path_buf()), max_width.max(1));
        let options = ViewOptions { cameras, split, max_width, near, ..ViewOptions::default() };
        let cameras = read(&options)?;
        Ok(Self { options, cameras })
    }

    /// Returns the cameras for a scene whose positions are relative to `offset`. If the offset has changed, the file is
    /// read again, because its positions are more precise than those of cameras.
    pub(crate) fn relative_to(&mut self, offset: Option<Offset>) -> Result<&[Camera]> {
        if offset != self.options.offset {
            let options = ViewOptions { offset, ..self.options.clone() };
            *self = Self { cameras: read(&options)?, options };
        }
        Ok(&self.cameras)
    }
}

fn read(options: &ViewOptions) -> Result<Vec<Camera>> {
    let found = find_views(options, &Geometry::default())?.views;
    let cameras: Vec<Camera> = found.into_iter().map(|view| view.camera).collect();
    for camera in &cameras {
        camera.validate()?;
    }
    Ok(cameras)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The camera is 0.015625 beside the offset, which single precision cannot tell from it.
    #[test]
    fn cameras_follow_the_offset_of_the_scene() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("cameras.json");
        let list = r#"[{"img_name": "a", "width": 8, "height": 8, "fx": 8, "fy": 8,
            "position": [500000.015625, 0, 0], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}]"#;
        std::fs::write(&file, list).unwrap();
        let mut given = GivenCameras::read(&file, SplitFilter::All, 64, Some(0.5)).unwrap();
        let offset = Offset::new([500_000.0, 0.0, 0.0]).unwrap();
        for (offset, x) in [(None, 500_000.0), (offset, 0.015_625), (None, 500_000.0)] {
            let camera = &given.relative_to(offset).unwrap()[0];
            assert_eq!((camera.position, camera.near), ([x, 0.0, 0.0], 0.5));
        }
        std::fs::remove_file(&file).unwrap();
        assert!(given.relative_to(None).is_ok());
        assert!(given.relative_to(offset).is_err());
    }
}
