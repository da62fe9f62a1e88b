//! Views as bytes. They pass from the process that measures a part of a scene to the process that refits the part.

use lexisplat_render::Camera;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::packing_views::PackingViews;

/// Name of the bytes in errors.
const MEMO: &str = "memo";

/// The generated views of a [`PackingViews`].
#[derive(Serialize, Deserialize)]
struct Memo {
    measuring: Vec<View>,
    judging: Vec<View>,
}

/// A generated camera.
#[derive(Serialize, Deserialize)]
struct View {
    name: String,
    size: [u32; 2],
    focal: [f32; 2],
    position: [f32; 3],
    rotation: [[f32; 3]; 3],
    near: f32,
    background: Option<[f32; 3]>,
}

impl From<&Camera> for View {
    fn from(camera: &Camera) -> Self {
        let Camera { width, height, fx, fy, position, rotation, near, background, .. } = *camera;
        let (size, focal) = ([width, height], [fx, fy]);
        Self { name: camera.name.clone(), size, focal, position, rotation, near, background }
    }
}

impl From<View> for Camera {
    fn from(view: View) -> Self {
        let View { name, size: [width, height], focal: [fx, fy], position, rotation, near, background } =
            view;
        Self { name, width, height, fx, fy, position, rotation, near, split: None, tiles: None, background }
    }
}

/// Returns the bytes of `views`, which a search found.
pub(crate) fn memo_of(views: &PackingViews) -> Vec<u8> {
    let list = |cameras: &[Camera]| cameras.iter().map(View::from).collect();
    let memo = Memo { measuring: list(views.measuring()), judging: list(views.judging()) };
    // Vectors of numbers and names can always be serialised.
    serde_json::to_vec(&memo).unwrap_or_default()
}

/// Returns the views whose bytes [`memo_of`] made.
///
/// # Errors
/// [`Error::Parameter`] for any other bytes.
pub(crate) fn views_of(memo: &[u8]) -> Result<PackingViews> {
    let read: Memo = serde_json::from_slice(memo)
        .map_err(|error| Error::parameter(MEMO, error.to_string(), "views that were found"))?;
    let list = |views: Vec<View>| -> Vec<Camera> { views.into_iter().map(Camera::from).collect() };
    let (measuring, judging) = (list(read.measuring), list(read.judging));
    for camera in measuring.iter().chain(&judging) {
        camera.validate()?;
    }
    Ok(PackingViews::of_found(measuring, judging))
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat_render::{Renderer, orbit};
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    #[test]
    fn views_come_back_to_the_bit() {
        let splats = scene(&SampleOptions::new(1500, 3));
        let views = PackingViews::found(&mut Renderer::cpu(), &splats, &Silent).unwrap();
        let again = views_of(&memo_of(&views)).unwrap();
        assert_eq!((again.measuring(), again.judging()), (views.measuring(), views.judging()));
        assert!(!again.are_given());
        assert_eq!(again.fitting(&splats), views.fitting(&splats));
    }

    #[test]
    fn other_bytes_are_refused() {
        for bytes in [&b""[..], b"{}", b"[1]", br#"{"measuring":[],"judging":[{"name":"a"}]}"#] {
            assert!(matches!(views_of(bytes), Err(Error::Parameter { .. })));
        }
        let splats = scene(&SampleOptions::new(300, 3));
        let camera = orbit(&splats.geometry, 1, 64, 48).swap_remove(0);
        let views = PackingViews::of_found(vec![Camera { fx: -1.0, ..camera }], Vec::new());
        assert!(views_of(&memo_of(&views)).is_err());
    }
}
