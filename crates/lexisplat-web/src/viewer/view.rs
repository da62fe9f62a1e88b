//! What is drawn, and what was drawn.

use lexisplat_render::{Camera, RenderOptions};
use lexisplat_view::{Arrangement, Picture};

/// All values on which a picture on the canvas depends.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct View {
    /// The models to draw, if they are open.
    pub(super) wanted: [bool; 2],
    /// The camera, at the size of the canvas.
    pub(super) camera: Camera,
    pub(super) options: RenderOptions,
    pub(super) arrangement: Arrangement,
    /// Factor on both sides of pictures, 0 to 1.
    pub(super) scale: f64,
}

impl View {
    /// Returns the camera of the pictures.
    pub(super) fn scaled_camera(&self) -> Camera {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the width")]
        let width = (f64::from(self.camera.width) * self.scale).round() as u32;
        self.camera.with_max_width(width)
    }

    /// Returns the place of the pictures on a canvas of this size: left, top, width and height. Cameras with an aspect of
    /// their own leave borders.
    pub(super) fn place(&self, (width, height): (u32, u32)) -> [f32; 4] {
        let own = (
            self.camera.width.saturating_mul(self.arrangement.columns()).min(width),
            self.camera.height.min(height),
        );
        let offset = [(width - own.0) / 2, (height - own.1) / 2];
        #[expect(clippy::cast_precision_loss, reason = "sides are far below 2^24")]
        let place = [offset[0] as f32, offset[1] as f32, own.0 as f32, own.1 as f32];
        place
    }
}

/// A view that was drawn.
#[derive(Debug, Clone)]
pub(super) struct Drawn {
    pub(super) view: View,
    /// The pictures on the GPU. There are none if the processor drew them.
    pub(super) pictures: [Option<Picture>; 2],
    /// Number of Gaussians that may touch each picture.
    pub(super) visible: [Option<u32>; 2],
    pub(super) milliseconds: f64,
    /// PSNR of the second picture against the first, in dB.
    pub(super) psnr: Option<f64>,
    pub(super) identical: bool,
}

impl Drawn {
    /// Returns whether this is `view`, or a finer picture of it.
    pub(super) fn shows(&self, view: &View) -> bool {
        self.has_pictures_of(view) && self.view.arrangement == view.arrangement
    }

    pub(super) fn has_pictures_of(&self, view: &View) -> bool {
        let all = self.view.wanted.iter().zip(view.wanted).all(|(&has, wants)| has || !wants);
        all && self.view.scale >= view.scale
            && self.view.camera == view.camera
            && self.view.options == view.options
    }

    /// Returns the same pictures as they are arranged in `view`.
    pub(super) fn arranged(self, view: View) -> Self {
        let view = View { wanted: self.view.wanted, scale: self.view.scale, ..view };
        Self { view, ..self }
    }
}
