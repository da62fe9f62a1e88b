//! The viewer's side of drawing on the processor, in a worker. The page passes scenes and views on to the worker, and the worker's figures
//! back.

use lexisplat_render::gpu::SceneBytes;
use lexisplat_view::Mode;
use wasm_bindgen::prelude::*;

use super::Viewer;
use super::view::{Drawn, View};
use crate::processor_view;

/// Number of figures of a slot.
const FIGURES: usize = 4;

/// What the worker said of its scenes, and what it draws.
#[derive(Debug, Default)]
pub(super) struct Worker {
    /// Bytes of its memory, which does not shrink.
    pub(super) resident: u64,
    pub(super) gaussians: [Option<u32>; 2],
    pub(super) bytes: [Option<SceneBytes>; 2],
    /// The view that was begun, and the last pictures if they are those of that view.
    begun: Option<(View, Option<Drawn>)>,
}

#[wasm_bindgen]
impl Viewer {
    /// Begins to draw on the processor what changed since the last picture, with both sides of pictures multiplied by `scale`, at most
    /// 1. Returns `None` if there is nothing to do. Otherwise the worker has to draw, and [`Self::drawn`] to be called, unless the
    /// worker was stopped.
    ///
    /// The numbers are whether the last pictures are only arranged anew (1) or not (0), the mode, the line of the wipe, the gain of
    /// differences, left, top, width and height of the picture's place on the canvas, and the view, which ends with the colour behind
    /// the scene.
    pub fn begin(&mut self, scale: f64) -> Option<Vec<f32>> {
        let view = self.wanted_view(scale)?;
        let before = self.drawn.take().filter(|before| before.has_pictures_of(&view));
        let arrangement = view.arrangement;
        let mode = Mode::ALL.iter().position(|&mode| mode == arrangement.mode).unwrap_or(0);
        #[expect(clippy::cast_precision_loss, reason = "one of five modes")]
        let mut numbers =
            vec![f32::from(u8::from(before.is_some())), mode as f32, arrangement.split, arrangement.gain];
        numbers.extend(view.place(self.size));
        let (wanted, options) = (view.wanted, view.options);
        let pictures = processor_view::View { wanted, camera: view.scaled_camera(), options };
        numbers.extend(pictures.to_numbers());
        self.worker.begun = Some((view, before));
        Some(numbers)
    }

    /// Takes the figures of the worker for the view that was begun last: the time in milliseconds, the bytes of the worker's memory,
    /// and those of [`Processor.figures`](crate::Processor).
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    pub fn drawn(&mut self, figures: &[f64]) {
        let Some((view, before)) = self.worker.begun.take() else { return };
        let &[milliseconds, resident, psnr, ref slots @ ..] = figures else { return };
        self.worker.resident = resident as u64;
        let mut visible = [None; 2];
        for (slot, figures) in slots.as_chunks::<FIGURES>().0.iter().enumerate().take(visible.len()) {
            let [seen, gaussians, geometry, sh] = figures.map(|v| (!v.is_nan()).then_some(v as u64));
            let count = |v: Option<u64>| v.map(|v| u32::try_from(v).unwrap_or(u32::MAX));
            visible[slot] = count(seen);
            self.worker.gaussians[slot] = count(gaussians);
            self.worker.bytes[slot] = geometry.zip(sh).map(|(geometry, sh)| SceneBytes { geometry, sh });
        }
        self.drawn = Some(match before {
            Some(before) => before.arranged(view),
            None => Drawn {
                view,
                pictures: [None, None],
                visible,
                milliseconds,
                psnr: psnr.is_finite().then_some(psnr),
                identical: psnr == f64::INFINITY,
            },
        });
    }
}
