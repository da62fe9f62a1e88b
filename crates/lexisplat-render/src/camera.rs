//! Pinhole cameras.

use lexisplat::packed::Eye;

use crate::conventions::NEAR_Z;
use crate::error::{Error, Result};
use crate::tile_set::TileSet;

/// Largest width or height of a picture, in pixels.
pub const MAX_SIDE: u32 = 16_384;

/// Largest difference of an entry of `rotation * rotation^T` from the entry of the identity. In files that trainers wrote
/// it is within 1e-6. With a larger difference the view is scaled or skewed, and is not a camera's.
const ORTHONORMAL_TOLERANCE: f32 = 1e-2;

/// The part of a data set that a camera belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Split {
    /// Seen in training.
    Train,
    /// Held out.
    Test,
}

/// A pinhole camera whose optical axis meets the picture in its centre, as INRIA's `cameras.json`
/// describes it.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Name of the photo, as in the file, or of the generated view.
    pub name: String,
    /// Picture width in pixels, 1 to [`MAX_SIDE`].
    pub width: u32,
    /// Picture height in pixels, 1 to [`MAX_SIDE`].
    pub height: u32,
    /// Focal length in pixel widths, above 0.
    pub fx: f32,
    /// Focal length in pixel heights, above 0.
    pub fy: f32,
    /// Camera centre in world units.
    pub position: [f32; 3],
    /// Camera-to-world rotation, row by row. Its columns are the camera's right, down and forward
    /// directions in the world.
    pub rotation: [[f32; 3]; 3],
    /// Distance of the near plane in world units, above 0. Gaussians that are not beyond it are not drawn. The default is
    /// the trainer's, [`NEAR_Z`](crate::conventions::NEAR_Z).
    pub near: f32,
    /// Part of the data set that the camera belongs to, if the file states it.
    pub split: Option<Split>,
    /// The tiles to draw; `None` draws the whole picture. On a GPU sensitivities are measured on the whole picture in
    /// either case.
    pub tiles: Option<TileSet>,
    /// Colour behind the scene, 0 to 1 a channel. `None` is the background of [`RenderOptions`](crate::RenderOptions) where the
    /// picture is drawn with options, and black elsewhere.
    pub background: Option<[f32; 3]>,
}

impl Camera {
    /// Returns a camera with numbers rounded to single precision, without a split, and with the trainer's near plane.
    /// `size` is the width and height, `focal` the focal lengths along x and y. Numbers that overflow become infinite,
    /// and [`Self::validate`] refuses them.
    #[must_use]
    pub fn rounded(
        name: String,
        [width, height]: [u32; 2],
        focal: [f64; 2],
        position: [f64; 3],
        rotation: [[f64; 3]; 3],
    ) -> Self {
        let [fx, fy] = focal.map(single);
        let (position, rotation) = (position.map(single), rotation.map(|row| row.map(single)));
        Self {
            name,
            width,
            height,
            fx,
            fy,
            position,
            rotation,
            near: NEAR_Z,
            split: None,
            tiles: None,
            background: None,
        }
    }

    /// Returns this camera with another background.
    #[must_use]
    pub fn with_background(self, background: impl Into<Option<[f32; 3]>>) -> Self {
        Self { background: background.into(), ..self }
    }

    /// Returns this camera with the near plane at distance `near`, in world units. `None` keeps the near plane.
    #[must_use]
    pub fn with_near(self, near: impl Into<Option<f32>>) -> Self {
        Self { near: near.into().unwrap_or(self.near), ..self }
    }

    /// Returns this camera with pictures at most `width` pixels wide and the same field of view. A wider picture is
    /// scaled down, and its height rounded to whole pixels.
    #[must_use]
    pub fn with_max_width(&self, width: u32) -> Self {
        let width = width.max(1);
        if self.width <= width {
            return self.clone();
        }
        let (from_width, from_height) = (u64::from(self.width), u64::from(self.height));
        let height = (from_height * u64::from(width) + from_width / 2) / from_width;
        // The new height is at most the old one, so it fits.
        self.resized(width, u32::try_from(height).unwrap_or(self.height).max(1))
    }

    /// Returns this camera with pictures of exactly this size and the same field of view, without a tile set. The aspect must
    /// be nearly the same.
    #[must_use]
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let scale = |focal: f32, new: u32, old: u32| {
            single(f64::from(focal) * (f64::from(new) / f64::from(old.max(1))))
        };
        let (fx, fy) = (scale(self.fx, width, self.width), scale(self.fy, height, self.height));
        Self { width, height, fx, fy, tiles: None, ..self.clone() }
    }

    /// Returns the eye of this camera, for the choice of what is drawn within a budget. The cone holds the whole picture.
    #[must_use]
    pub fn eye(&self) -> Eye {
        let aside = [self.width as f32 / self.fx, self.height as f32 / self.fy].map(|side| 0.5 * side);
        Eye::at(self.position)
            .with_forward(self.rotation.map(|row| row[2]))
            .with_half_angle(aside[0].hypot(aside[1]).atan())
            .with_pixel(1.0 / self.fx.max(self.fy))
    }

    /// Returns this camera with half the width and half the height. A tile set becomes the tiles of the smaller picture
    /// that contain its tiles.
    #[must_use]
    pub fn halved(&self) -> Self {
        let [width, height] = [self.width, self.height].map(|side| (side / 2).max(1));
        self.resized(width, height).with_tiles(self.tiles.as_ref().map(TileSet::halved))
    }

    /// Returns this camera with the tiles to draw.
    #[must_use]
    pub fn with_tiles(self, tiles: impl Into<Option<TileSet>>) -> Self {
        Self { tiles: tiles.into(), ..self }
    }

    /// Returns the number of pixels that the camera draws.
    #[must_use]
    pub fn drawn_pixels(&self) -> u64 {
        let whole = u64::from(self.width) * u64::from(self.height);
        self.tiles.as_ref().map_or(whole, TileSet::pixels)
    }

    /// Returns the width and height of the picture that the camera draws. For the picture of a tile set see [`TileSet`].
    #[must_use]
    pub fn picture_size(&self) -> [u32; 2] {
        self.tiles.as_ref().map_or([self.width, self.height], TileSet::picture_size)
    }

    /// Returns the place in the whole picture, as (column, row), of pixel number `drawn` of the drawn picture, counted
    /// row by row. Returns `None` if the place is beyond the border.
    #[must_use]
    pub fn place_of_drawn(&self, drawn: usize) -> Option<[usize; 2]> {
        let [width, height] = [self.width, self.height].map(|side| side as usize);
        let place = match &self.tiles {
            None => [drawn % width, drawn / width],
            Some(set) => set.place_of_drawn(drawn)?,
        };
        (place[0] < width && place[1] < height).then_some(place)
    }

    /// Returns the number in the drawn picture of the pixel at `place`, a (column, row) of the whole picture. Returns
    /// `None` if the pixel is not drawn.
    #[must_use]
    pub fn drawn_at(&self, [column, row]: [usize; 2]) -> Option<usize> {
        let [width, height] = [self.width, self.height].map(|side| side as usize);
        match &self.tiles {
            _ if column >= width || row >= height => None,
            None => Some(row * width + column),
            Some(set) => set.drawn_at([column, row]),
        }
    }

    /// Returns `point`, in world units, in this camera's view space: x right, y down, z forward.
    #[must_use]
    #[inline]
    pub fn to_view(&self, point: [f32; 3]) -> [f32; 3] {
        let d: [f32; 3] = std::array::from_fn(|i| point[i] - self.position[i]);
        let r = &self.rotation;
        std::array::from_fn(|i| r[0][i] * d[0] + r[1][i] * d[1] + r[2][i] * d[2])
    }

    /// Checks that the fields are in their documented ranges, and that the rotation is orthonormal within 1e-2. Mirrored
    /// rotations are accepted, because some published files have them.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the field and its value.
    pub fn validate(&self) -> Result<()> {
        for (name, side) in [("width", self.width), ("height", self.height)] {
            if !(1..=MAX_SIDE).contains(&side) {
                return Err(Error::parameter(name, side, format!("1 to {MAX_SIDE} pixels")));
            }
        }
        for (name, length) in [("fx", self.fx), ("fy", self.fy), ("near", self.near)] {
            if !(length.is_finite() && length > 0.0) {
                return Err(Error::parameter(name, length, "a finite number above 0"));
            }
        }
        if let Some(tiles) = &self.tiles {
            tiles.check(self.width, self.height)?;
        }
        if let Some(background) = self.background.filter(|colour| !colour.iter().all(|v| v.is_finite())) {
            return Err(Error::parameter("background", format!("{background:?}"), "finite numbers"));
        }
        if !self.position.iter().all(|v| v.is_finite()) {
            return Err(Error::parameter("position", format!("{:?}", self.position), "finite numbers"));
        }
        for (i, a) in self.rotation.iter().enumerate() {
            for (j, b) in self.rotation.iter().enumerate() {
                let dot: f32 = a.iter().zip(b).map(|(x, y)| x * y).sum();
                let off = (dot - if i == j { 1.0 } else { 0.0 }).abs();
                if off.is_nan() || off > ORTHONORMAL_TOLERANCE {
                    let expected = format!(
                        "an orthonormal matrix (rows {i} and {j} multiply to {dot}, off by more than {ORTHONORMAL_TOLERANCE})"
                    );
                    return Err(Error::parameter("rotation", format!("{:?}", self.rotation), expected));
                }
            }
        }
        Ok(())
    }
}

/// Rounds to `f32`. Values that overflow become infinite.
#[expect(clippy::cast_possible_truncation, reason = "cameras are f32 by design")]
pub(crate) fn single(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
pub(crate) fn straight_ahead(width: u32, height: u32, focal: f32) -> Camera {
    Camera {
        name: "straight ahead".into(),
        width,
        height,
        fx: focal,
        fy: focal,
        position: [0.0; 3],
        rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        near: NEAR_Z,
        split: None,
        tiles: None,
        background: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wide_camera_is_scaled_with_its_field_of_view() {
        let camera = Camera { fy: 4285.0, ..straight_ahead(5025, 3312, 4328.0) };
        let small = camera.with_max_width(1600);
        assert_eq!((small.width, small.height), (1600, 1055));
        assert!((small.fx - 4328.0 * 1600.0 / 5025.0).abs() < 1e-3);
        assert!((small.fy - 4285.0 * 1055.0 / 3312.0).abs() < 1e-3);
        assert_eq!(camera.with_max_width(5025), camera);
        let sliver = straight_ahead(10_000, 1, 1.0).with_max_width(10);
        assert_eq!((sliver.width, sliver.height), (10, 1));
    }

    #[test]
    fn the_camera_sees_its_columns_as_axes() {
        // Looks along world x, its right is world -y, its down world -z.
        let camera = Camera {
            position: [1.0, 2.0, 3.0],
            rotation: [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]],
            ..straight_ahead(8, 8, 8.0)
        };
        camera.validate().unwrap();
        assert_eq!(camera.to_view([6.0, 2.0, 3.0]), [0.0, 0.0, 5.0]);
        assert_eq!(camera.to_view([1.0, 1.0, 3.0]), [1.0, 0.0, 0.0]);
        assert_eq!(camera.to_view([1.0, 2.0, 1.0]), [0.0, 2.0, 0.0]);
    }

    #[test]
    fn impossible_cameras_are_refused_by_field() {
        let good = straight_ahead(8, 8, 8.0);
        let mut scaled = good.clone();
        scaled.rotation[1][1] = 1.1;
        let bad = [
            ("width", Camera { width: 0, ..good.clone() }),
            ("height", Camera { height: MAX_SIDE + 1, ..good.clone() }),
            ("fx", Camera { fx: 0.0, ..good.clone() }),
            ("fy", Camera { fy: f32::NAN, ..good.clone() }),
            ("near", good.clone().with_near(0.0)),
            ("background", good.clone().with_background([0.0, f32::NAN, 0.0])),
            ("position", Camera { position: [0.0, f32::INFINITY, 0.0], ..good }),
            ("rotation", scaled),
        ];
        for (field, camera) in bad {
            let message = camera.validate().unwrap_err().to_string();
            assert!(message.starts_with(field), "{message}");
        }
    }
}
