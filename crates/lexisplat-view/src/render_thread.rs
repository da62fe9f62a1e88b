//! The thread that draws. It keeps the window from waiting for pictures.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use lexisplat::output::{self, Output, OutputGroup};
use lexisplat::simd::Simd;
use lexisplat_eval::metrics::psnr;
use lexisplat_eval::png;
use lexisplat_render::{Camera, Image, RenderOptions};

use crate::command::{Mode, Slot};
use crate::compose::{Composer, Rgb8Image};
use crate::error::{Error, Result};
use crate::models::OpenModel;
use crate::present::Composition;
use crate::scene_renderer::{DrawnPicture, SceneRenderer};
use crate::state::Arrangement;

/// Shortest time between two comparisons of pictures while the view moves.
const COMPARE_EVERY: Duration = Duration::from_millis(300);

/// All values on which the pictures of a frame depend.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct View {
    /// The camera, at the size of the picture on screen.
    pub(crate) camera: Camera,
    pub(crate) options: RenderOptions,
    /// [`OpenModel::id`] of the models to draw.
    pub(crate) models: [Option<u64>; 2],
}

impl View {
    /// Returns whether the pictures of this view include the pictures of `other`.
    pub(crate) fn covers(&self, other: &Self) -> bool {
        let models = self.models.iter().zip(other.models);
        self.camera == other.camera
            && self.options == other.options
            && models.into_iter().all(|(has, wants)| wants.is_none() || *has == wants)
    }
}

/// A request to the render thread.
#[derive(Debug)]
pub(crate) enum RenderRequest {
    /// Replaces a model.
    Model(Slot, Option<Arc<OpenModel>>),
    /// Draws a view, with both sides of its pictures multiplied by a scale. Only the latest of such requests is carried
    /// out.
    View(View, f64),
    /// Saves the picture of a view to a file.
    Screenshot { view: View, arrangement: Arrangement, file: PathBuf },
}

/// The result of comparing two pictures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Score {
    Identical,
    Decibels(f64),
}

/// The pictures of a view.
#[derive(Debug)]
pub(crate) struct Frame {
    /// The view requested.
    pub(crate) view: View,
    /// Factor on both sides of the pictures.
    pub(crate) scale: f64,
    pub(crate) pictures: [Option<Arc<DrawnPicture>>; 2],
    /// Time to draw all pictures, in milliseconds.
    pub(crate) milliseconds: f64,
    /// Score of the second picture against the first, if both were drawn and a comparison was due.
    pub(crate) score: Option<Score>,
    /// Number of bytes on the device: models, work buffers and these pictures.
    pub(crate) resident_bytes: u64,
}

/// The result of a [`RenderRequest`].
#[derive(Debug)]
pub(crate) enum RenderEvent {
    /// The frame of a view, or the error of drawing it.
    Frame(Result<Box<Frame>>),
    /// The file of a saved screenshot, or the error of drawing or saving it.
    Saved(Result<PathBuf>),
    /// A model does not fit on the device.
    ModelFailed(Slot, Error),
}

/// A handle to the render thread. Dropping it ends the thread.
#[derive(Debug)]
pub(crate) struct RenderThread {
    /// Sender of requests; `Some` until the handle is dropped.
    requests: Option<Sender<RenderRequest>>,
    events: Receiver<RenderEvent>,
    thread: Option<JoinHandle<()>>,
    /// Name of the device that draws, for the panel.
    pub(crate) name: String,
}

impl RenderThread {
    /// Starts the thread. `wake` is called after each event.
    ///
    /// # Errors
    /// [`Error::Window`] if the system has no threads left.
    pub(crate) fn start(
        renderer: Box<dyn SceneRenderer>,
        device: wgpu::Device,
        queue: wgpu::Queue,
        outputs: OutputGroup,
        wake: impl Fn() + Send + 'static,
    ) -> Result<Self> {
        let name = renderer.name();
        let (requests, requested) = channel();
        let (sender, events) = channel();
        let composer = Composer::new(device, queue);
        let mut worker = RenderWorker { renderer, composer, outputs, last_comparison: None };
        let simd = Simd::current();
        let work = move || {
            while let Ok(first) = requested.recv() {
                let mut batch: Vec<RenderRequest> =
                    std::iter::once(first).chain(requested.try_iter()).collect();
                only_the_latest_view(&mut batch);
                for request in batch {
                    let Some(event) = worker.handle(request) else { continue };
                    if sender.send(event).is_err() {
                        return;
                    }
                    wake();
                }
            }
        };
        let thread = std::thread::Builder::new()
            .name("render".into())
            .spawn(move || simd.scope(work))
            .map_err(|e| Error::Window(format!("cannot start a thread: {e}")))?;
        Ok(Self { requests: Some(requests), events, thread: Some(thread), name })
    }

    /// Returns whether the thread is running. It ends early only after a panic.
    pub(crate) fn is_alive(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }

    /// Sends a request.
    ///
    /// # Errors
    /// [`Error::Device`] if the thread has ended.
    pub(crate) fn request(&self, request: RenderRequest) -> Result<()> {
        let sent = self.requests.as_ref().is_some_and(|requests| requests.send(request).is_ok());
        if sent { Ok(()) } else { Err(Error::Device("the render thread has stopped".to_owned())) }
    }

    /// Returns the events since the last call.
    pub(crate) fn events(&self) -> impl Iterator<Item = RenderEvent> {
        self.events.try_iter()
    }
}

impl Drop for RenderThread {
    /// Waits for the thread. Some drivers crash if the program ends while they draw.
    fn drop(&mut self) {
        self.requests = None;
        if let Some(thread) = self.thread.take() {
            // The thread itself has already reported a panic.
            let _ = thread.join();
        }
    }
}

/// Removes all requests for views but the last.
fn only_the_latest_view(batch: &mut Vec<RenderRequest>) {
    let views = batch.iter().filter(|request| matches!(request, RenderRequest::View(..))).count();
    let mut seen = 0;
    batch.retain(|request| {
        seen += usize::from(matches!(request, RenderRequest::View(..)));
        !matches!(request, RenderRequest::View(..)) || seen == views
    });
}

/// The state of the render thread.
struct RenderWorker {
    /// The group of saved pictures.
    outputs: OutputGroup,
    renderer: Box<dyn SceneRenderer>,
    composer: Composer,
    /// Time of the last comparison of pictures.
    last_comparison: Option<Instant>,
}

impl RenderWorker {
    fn handle(&mut self, request: RenderRequest) -> Option<RenderEvent> {
        match request {
            RenderRequest::Model(slot, model) => {
                let error = self.renderer.set(slot, model).err();
                error.map(|error| RenderEvent::ModelFailed(slot, error))
            }
            RenderRequest::View(view, scale) => {
                Some(RenderEvent::Frame(self.draw_frame(view, scale).map(Box::new)))
            }
            RenderRequest::Screenshot { view, arrangement, file } => {
                let saved =
                    self.picture(&view, arrangement).and_then(|picture| save(&self.outputs, &file, &picture));
                Some(RenderEvent::Saved(saved.map(|()| file)))
            }
        }
    }

    fn draw_models(&mut self, view: &View, camera: &Camera) -> Result<[Option<Arc<DrawnPicture>>; 2]> {
        let mut pictures = [None, None];
        for slot in Slot::BOTH {
            if view.models[slot.index()].is_some() {
                let picture = self.renderer.draw(slot, camera, &view.options)?;
                pictures[slot.index()] = Some(Arc::new(picture));
            }
        }
        Ok(pictures)
    }

    fn draw_frame(&mut self, view: View, scale: f64) -> Result<Frame> {
        let clock = Instant::now();
        let camera = scaled(&view.camera, scale);
        let pictures = self.draw_models(&view, &camera)?;
        let milliseconds = clock.elapsed().as_secs_f64() * 1e3;
        let due = scale >= 1.0 || self.last_comparison.is_none_or(|last| last.elapsed() >= COMPARE_EVERY);
        let mut score = None;
        if let ([Some(first), Some(second)], true) = (&pictures, due) {
            let images = [self.image(first)?, self.image(second)?];
            // Colours may overflow to NaN. Such pictures have no score.
            let decibels = psnr(&images[0], &images[1]).ok();
            score = decibels.map(|found| found.map_or(Score::Identical, Score::Decibels));
            self.last_comparison = Some(Instant::now());
        }
        let buffers: u64 = pictures.iter().flatten().map(|p| p.picture.pixels.size()).sum();
        Ok(Frame {
            view,
            scale,
            pictures,
            milliseconds,
            score,
            resident_bytes: buffers + self.renderer.resident_bytes(),
        })
    }

    fn image(&self, picture: &DrawnPicture) -> Result<Image> {
        picture.to_image(&self.composer.presenter.device, &self.composer.queue)
    }

    /// Returns the picture of a screenshot: the renderer's own picture if one model is shown, otherwise the arrangement
    /// on screen.
    fn picture(&mut self, view: &View, arrangement: Arrangement) -> Result<Rgb8Image> {
        let pictures = self.draw_models(view, &view.camera)?;
        if let (Mode::One(_), Some(picture)) = (arrangement.mode, pictures.iter().flatten().next()) {
            let image = self.image(picture)?;
            return Ok((image.width, image.height, image.to_8bit()));
        }
        let pictures = pictures.map(|drawn| drawn.map(|drawn| drawn.picture.clone()));
        self.composer.compose(&Composition { arrangement, pictures })
    }
}

/// Returns `camera` with both sides of its picture multiplied by `scale`, which is clamped to 0 to 1.
fn scaled(camera: &Camera, scale: f64) -> Camera {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the width")]
    let width = (f64::from(camera.width) * scale.clamp(0.0, 1.0)).round() as u32;
    camera.with_max_width(width)
}

fn save(outputs: &OutputGroup, file: &std::path::Path, (width, height, pixels): &Rgb8Image) -> Result<()> {
    let bytes = png(*width, *height, pixels)?;
    Ok(output::write_whole(Output::from(file).within(outputs), |writer| {
        std::io::Write::write_all(writer, &bytes).map_err(|e| lexisplat::Error::io(file, e))
    })?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(width: u32) -> View {
        let camera = Camera {
            name: String::new(),
            width,
            height: 10,
            fx: 10.0,
            fy: 10.0,
            position: [0.0; 3],
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            near: 0.2,
            split: None,
            tiles: None,
            background: None,
        };
        View { camera, options: RenderOptions::default(), models: [Some(1), None] }
    }

    #[test]
    fn only_the_latest_view_is_drawn_and_nothing_else_is_lost() {
        let model = || RenderRequest::Model(Slot::First, None);
        let mut batch =
            vec![RenderRequest::View(view(1), 1.0), model(), RenderRequest::View(view(2), 1.0), model()];
        only_the_latest_view(&mut batch);
        let widths: Vec<Option<u32>> = batch
            .iter()
            .map(
                |request| {
                    if let RenderRequest::View(view, _) = request { Some(view.camera.width) } else { None }
                },
            )
            .collect();
        assert_eq!(widths, [None, Some(2), None]);
    }

    #[test]
    fn pictures_of_both_cover_either() {
        let both = View { models: [Some(1), Some(2)], ..view(5) };
        assert!(both.covers(&view(5)) && !view(5).covers(&both));
        assert!(!both.covers(&view(6)) && !both.covers(&View { models: [Some(3), None], ..view(5) }));
    }

    #[test]
    fn a_share_of_a_picture_sees_the_same() {
        let half = scaled(&view(100).camera, 0.5);
        assert_eq!((half.width, half.height, half.fx), (50, 5, 5.0));
        assert_eq!(scaled(&view(100).camera, 0.0).width, 1);
        assert_eq!(scaled(&view(100).camera, 1.0), view(100).camera);
    }
}
