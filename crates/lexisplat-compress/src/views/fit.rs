//! Cameras in the sizes of their photos.

use std::path::Path;

use lexisplat_render::Camera;

use crate::error::{Error, Result};

/// Largest difference between the heights of a camera and its photo, in pixels, after both are scaled to the smaller of
/// their widths. Sizes are rounded, some down and some up.
const SHAPE_SLACK: f64 = 2.0;

/// Returns `camera` with the size of its photo and the same fields of view along both axes, as in the loader of the
/// 3DGS authors (`scene/cameras.py`).
pub(super) fn to_photo(camera: &Camera, (width, height): (u32, u32), photo: &Path) -> Result<Camera> {
    let narrow = f64::from(width.min(camera.width));
    let high = |w: u32, h: u32| narrow / f64::from(w) * f64::from(h);
    if (high(width, height) - high(camera.width, camera.height)).abs() > SHAPE_SLACK {
        let problem = format!(
            "is {width} x {height} pixels, and camera '{2}' is {0} x {1}; the photos belong to other cameras, or they are turned",
            camera.width, camera.height, camera.name
        );
        return Err(Error::format(photo, problem));
    }
    Ok(camera.resized(width, height))
}

/// Returns `camera` with its width and height divided by `divisor`. Halves are rounded to even, as in Python.
pub(super) fn divided(camera: &Camera, divisor: u32) -> Camera {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "no larger than the side it was"
    )]
    let side = |side: u32| ((f64::from(side) / f64::from(divisor)).round_ties_even() as u32).max(1);
    camera.resized(side(camera.width), side(camera.height))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(width: u32, height: u32) -> Camera {
        Camera {
            name: "a.jpg".into(),
            width,
            height,
            fx: 1000.0,
            fy: 900.0,
            position: [0.0; 3],
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            near: 0.2,
            split: None,
            tiles: None,
            background: None,
        }
    }

    #[test]
    fn both_focal_lengths_follow_their_side() {
        let found = to_photo(&camera(799, 532), (400, 266), Path::new("a.png")).unwrap();
        assert_eq!((found.width, found.height), (400, 266));
        assert!((found.fx - 1000.0 * 400.0 / 799.0).abs() < 1e-4, "{}", found.fx);
        assert!((found.fy - 450.0).abs() < 1e-4, "{}", found.fy);
        let same = camera(799, 532);
        assert_eq!(to_photo(&same, (799, 532), Path::new("a.png")).unwrap(), same);
    }

    #[test]
    fn shapes_may_differ_by_rounding_only() {
        let fits = |photo| to_photo(&camera(5187, 3361), photo, Path::new("x/a.png"));
        assert!(fits((1297, 840)).is_ok() && fits((1296, 841)).is_ok());
        assert!(fits((2 * 5187, 2 * 3361 + 3)).is_ok());
        assert!(fits((1297, 844)).is_err());
        let turned = fits((3361, 5187)).unwrap_err().to_string();
        assert!(turned.starts_with("x/a.png: is 3361 x 5187") && turned.contains("'a.jpg'"), "{turned}");
    }

    #[test]
    fn halves_round_to_even() {
        let sides = |width, height, divisor| {
            let found = divided(&camera(width, height), divisor);
            (found.width, found.height)
        };
        assert_eq!(sides(799, 533, 2), (400, 266));
        assert_eq!(sides(5187, 3361, 4), (1297, 840));
        assert_eq!(sides(3, 1, 8), (1, 1));
        assert_eq!(divided(&camera(9, 7), 1), camera(9, 7));
    }
}
