//! Draws scenes on the processor, for browsers without WebGPU. It runs in a worker.

mod compose;

use lexisplat_render::gpu::{SceneForm, ScenePart};
use lexisplat_render::{CpuScene, Drawn, squared_error};
use wasm_bindgen::prelude::*;

use self::compose::Layout;
use crate::processor_view::View;
use crate::thrown;

/// Number of channels of a pixel.
const CHANNELS: f64 = 3.0;

/// Draws one or two scenes by the rules and with the code of `lexisplat render --device cpu`. Scenes come in the parts that
/// [`Chunk::part`](crate::Chunk) makes of them.
#[wasm_bindgen]
#[derive(Debug, Default)]
pub struct Processor {
    scenes: [Option<CpuScene>; 2],
    /// The pictures of the last view, as far as they are whole.
    pictures: [Option<Drawn>; 2],
    /// PSNR of the second picture against the first, in dB. It is infinite for equal pictures.
    psnr: Option<f64>,
}

#[wasm_bindgen]
impl Processor {
    /// Returns a renderer without scenes.
    #[wasm_bindgen(constructor)]
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Begins a scene in a slot, 0 or 1, in place of the one that is there.
    ///
    /// # Errors
    /// An error if the bytes are not from [`Chunk.form`](crate::Chunk).
    pub fn form(&mut self, slot: usize, bytes: &[u8]) -> Result<(), JsError> {
        let form = SceneForm::from_bytes(bytes).map_err(thrown)?;
        *self.slot(slot)? = Some(CpuScene::new(form));
        Ok(())
    }

    /// Puts part `index` of the scene of a slot, and replaces the part with this index.
    ///
    /// # Errors
    /// An error if the bytes are not from [`Chunk.part`](crate::Chunk), or there is no scene.
    pub fn part(&mut self, slot: usize, index: usize, bytes: &[u8]) -> Result<(), JsError> {
        let scene = self.slot(slot)?.as_mut().ok_or_else(|| thrown("a part of a scene without its form"))?;
        scene.put(index, &ScenePart::from_bytes(bytes).map_err(thrown)?).map_err(thrown)
    }

    /// Removes part `index` of the scene of a slot.
    ///
    /// # Errors
    /// An error if there is no such slot.
    pub fn remove_part(&mut self, slot: usize, index: usize) -> Result<(), JsError> {
        if let Some(scene) = self.slot(slot)? {
            scene.remove(index);
        }
        Ok(())
    }

    /// Removes the scene of a slot.
    ///
    /// # Errors
    /// An error if there is no such slot.
    pub fn remove(&mut self, slot: usize) -> Result<(), JsError> {
        *self.slot(slot)? = None;
        Ok(())
    }

    fn slot(&mut self, slot: usize) -> Result<&mut Option<CpuScene>, JsError> {
        self.scenes.get_mut(slot).ok_or_else(|| thrown(format!("slot is {slot}, expected 0 or 1")))
    }

    /// Begins the pictures of a view, which the viewer gives as numbers. Pictures of the last view are forgotten.
    ///
    /// # Errors
    /// An error for numbers that are no view.
    pub fn begin(&mut self, view: &[f32]) -> Result<(), JsError> {
        let view = View::from_numbers(view).ok_or_else(|| thrown("these numbers are no view"))?;
        (self.pictures, self.psnr) = ([None, None], None);
        for (scene, wanted) in self.scenes.iter_mut().zip(view.wanted) {
            if let Some(scene) = scene.as_mut().filter(|_| wanted) {
                scene.begin(&view.camera, &view.options).map_err(thrown)?;
            }
        }
        Ok(())
    }

    /// Draws some rows. Returns whether the pictures are whole.
    pub fn advance(&mut self) -> bool {
        for (scene, picture) in self.scenes.iter_mut().zip(&mut self.pictures) {
            if let Some(scene) = scene.as_mut().filter(|scene| scene.is_drawing()) {
                *picture = scene.advance();
                return false;
            }
        }
        if let ([Some(first), Some(second)], None) = (&self.pictures, self.psnr) {
            self.psnr = squared_error(&first.image, &second.image).ok().map(|sum| {
                #[expect(clippy::cast_precision_loss, reason = "a number of pixels")]
                let pixels = first.image.pixels.len() as f64;
                -10.0 * (sum / (CHANNELS * pixels)).log10()
            });
        }
        true
    }

    /// Returns the pictures in one, for a mode by its number, the place of the wipe's line and the gain of differences: red, green,
    /// blue and opacity of each pixel, 8 bits each. Returns nothing if a picture is missing.
    #[must_use]
    pub fn compose(&self, mode: u32, split: f32, gain: f32) -> Option<Composed> {
        let pictures = self.pictures.each_ref().map(|drawn| drawn.as_ref().map(|drawn| &drawn.image));
        let (width, height, data) = compose::compose(pictures, Layout::of(mode, split, gain)?)?;
        Some(Composed { width, height, data })
    }

    /// Returns figures of the last view: the PSNR of the second picture against the first, in dB; then for each slot the number
    /// of Gaussians that may touch the picture, of Gaussians of the scene, and of bytes of its geometry and of its SH. NaN
    /// stands for what there is not.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "far below 2^53")]
    pub fn figures(&self) -> Vec<f64> {
        let mut figures = vec![self.psnr.unwrap_or(f64::NAN)];
        for (scene, picture) in self.scenes.iter().zip(&self.pictures) {
            figures.push(picture.as_ref().map_or(f64::NAN, |drawn| drawn.gaussians as f64));
            figures.extend(match scene {
                Some(scene) => {
                    let bytes = scene.bytes();
                    [scene.len() as f64, bytes.geometry as f64, bytes.sh as f64]
                }
                None => [f64::NAN; 3],
            });
        }
        figures
    }
}

/// Pictures in one.
#[wasm_bindgen]
#[derive(Debug)]
pub struct Composed {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    data: Vec<u8>,
}

#[wasm_bindgen]
impl Composed {
    /// Returns red, green, blue and opacity of each pixel, at the first call only.
    pub fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.data)
    }
}
