//! The thread that draws, so that the window need not wait.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use lexisplat::output::{self, Output, OutputGroup};
use lexisplat::simd::Simd;
use lexisplat_eval::metrics::psnr;
use lexisplat_eval::png;
use lexisplat_render::{Camera, RenderOptions};

use crate::command::{Mode, Which};
use crate::compose::{Composer, Picture};
use crate::error::{Error, Result};
use crate::models::Open;
use crate::painter::{Painted, Painter};
use crate::present::Showing;
use crate::state::Arrangement;

/// Least time between two comparisons of pictures while moving.
const COMPARE_EVERY: Duration = Duration::from_millis(300);

/// What pictures depend on.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct View {
    /// At the size on screen.
    pub(crate) camera: Camera,
    pub(crate) options: RenderOptions,
    /// The models to draw, by [`Open::id`].
    pub(crate) models: [Option<u64>; 2],
}

impl View {
    /// Whether pictures of this show all that `other` asks for.
    pub(crate) fn covers(&self, other: &Self) -> bool {
        let models = self.models.iter().zip(other.models);
        self.camera == other.camera
            && self.options == other.options
            && models.into_iter().all(|(has, wants)| wants.is_none() || *has == wants)
    }
}

/// Something to draw.
#[derive(Debug)]
pub(crate) enum Ask {
    /// A model is another one from now on.
    Model(Which, Option<Arc<Open>>),
    /// Draw this, at this share of its size on each side. Only the latest one is done.
    View(View, f64),
    /// Save the picture of this to a file.
    Screenshot { view: View, arrangement: Arrangement, file: PathBuf },
}

/// How far two pictures are apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Score {
    Identical,
    Decibels(f64),
}

/// Pictures of one moment.
#[derive(Debug)]
pub(crate) struct Shot {
    /// What was asked for.
    pub(crate) view: View,
    /// The share of its size on each side that was drawn.
    pub(crate) scale: f64,
    pub(crate) pictures: [Option<Arc<Painted>>; 2],
    /// To draw all of them.
    pub(crate) milliseconds: f64,
    /// The second against the first, if both were drawn and it was time.
    pub(crate) score: Option<Score>,
    /// Bytes on the device: models, work and these pictures.
    pub(crate) resident_bytes: u64,
}

/// What became of what was asked.
#[derive(Debug)]
pub(crate) enum Told {
    Shot(Box<Shot>),
    Saved(PathBuf),
    /// The view could not be drawn.
    Failed(Error),
    /// A model does not fit the device.
    Refused(Which, Error),
    /// A screenshot could not be made.
    NotSaved(Error),
}

/// The thread's other end.
#[derive(Debug)]
pub(crate) struct Painting {
    /// There until it is dropped.
    asks: Option<Sender<Ask>>,
    told: Receiver<Told>,
    thread: Option<JoinHandle<()>>,
    /// What draws, for the panel.
    pub(crate) name: String,
}

impl Painting {
    /// Starts the thread. `wake` is called when there is something to hear.
    ///
    /// # Errors
    /// [`Error::Window`] if the system has no threads left.
    pub(crate) fn start(
        painter: Box<dyn Painter>,
        device: wgpu::Device,
        queue: wgpu::Queue,
        outputs: OutputGroup,
        wake: impl Fn() + Send + 'static,
    ) -> Result<Self> {
        let name = painter.name();
        let (asks, asked) = channel();
        let (tell, told) = channel();
        let composer = Composer::new(device.clone(), queue.clone());
        let mut studio = Studio { painter, device, queue, composer, outputs, compared: None };
        let simd = Simd::current();
        let work = move || {
            while let Ok(first) = asked.recv() {
                let mut batch: Vec<Ask> = std::iter::once(first).chain(asked.try_iter()).collect();
                only_the_latest_view(&mut batch);
                for ask in batch {
                    let Some(told) = studio.answer(ask) else { continue };
                    if tell.send(told).is_err() {
                        return;
                    }
                    wake();
                }
            }
        };
        let thread = std::thread::Builder::new()
            .name("painting".into())
            .spawn(move || simd.scope(work))
            .map_err(|e| Error::Window(format!("cannot start a thread: {e}")))?;
        Ok(Self { asks: Some(asks), told, thread: Some(thread), name })
    }

    /// Whether the thread still draws. It ends early only by a fault in the program.
    pub(crate) fn is_alive(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }

    /// Asks for something.
    ///
    /// # Errors
    /// [`Error::Device`] if the thread is gone.
    pub(crate) fn ask(&self, ask: Ask) -> Result<()> {
        let sent = self.asks.as_ref().is_some_and(|asks| asks.send(ask).is_ok());
        if sent { Ok(()) } else { Err(Error::Device("drawing has stopped".to_owned())) }
    }

    /// What was done since the last call.
    pub(crate) fn hear(&self) -> impl Iterator<Item = Told> {
        self.told.try_iter()
    }
}

impl Drop for Painting {
    /// Waits for what is being drawn: a driver that is unloaded under it, when the program ends, crashes.
    fn drop(&mut self) {
        self.asks = None;
        if let Some(thread) = self.thread.take() {
            // A panic in there was already reported.
            let _ = thread.join();
        }
    }
}

/// Leaves out views that a later one replaces.
fn only_the_latest_view(batch: &mut Vec<Ask>) {
    let views = batch.iter().filter(|ask| matches!(ask, Ask::View(..))).count();
    let mut seen = 0;
    batch.retain(|ask| {
        seen += usize::from(matches!(ask, Ask::View(..)));
        !matches!(ask, Ask::View(..)) || seen == views
    });
}

/// All that drawing needs.
struct Studio {
    painter: Box<dyn Painter>,
    device: wgpu::Device,
    queue: wgpu::Queue,
    composer: Composer,
    /// The group of saved pictures.
    outputs: OutputGroup,
    /// When pictures were compared last.
    compared: Option<Instant>,
}

impl Studio {
    fn answer(&mut self, ask: Ask) -> Option<Told> {
        match ask {
            Ask::Model(which, model) => {
                let refused = self.painter.set(which, model).err();
                refused.map(|error| Told::Refused(which, error))
            }
            Ask::View(view, scale) => Some(match self.shot(view, scale) {
                Ok(shot) => Told::Shot(Box::new(shot)),
                Err(error) => Told::Failed(error),
            }),
            Ask::Screenshot { view, arrangement, file } => {
                let saved =
                    self.picture(&view, arrangement).and_then(|picture| save(&self.outputs, &file, &picture));
                Some(match saved {
                    Ok(()) => Told::Saved(file),
                    Err(error) => Told::NotSaved(error),
                })
            }
        }
    }

    fn paint(&mut self, view: &View, camera: &Camera) -> Result<[Option<Arc<Painted>>; 2]> {
        let mut pictures = [None, None];
        for which in Which::BOTH {
            if view.models[which.index()].is_some() {
                let picture = self.painter.paint(which, camera, &view.options)?;
                pictures[which.index()] = Some(Arc::new(picture));
            }
        }
        Ok(pictures)
    }

    fn shot(&mut self, view: View, scale: f64) -> Result<Shot> {
        let clock = Instant::now();
        let camera = scaled(&view.camera, scale);
        let pictures = self.paint(&view, &camera)?;
        let milliseconds = clock.elapsed().as_secs_f64() * 1e3;
        let due = scale >= 1.0 || self.compared.is_none_or(|last| last.elapsed() >= COMPARE_EVERY);
        let mut score = None;
        if let ([Some(first), Some(second)], true) = (&pictures, due) {
            let image = |painted: &Painted| painted.to_image(&self.device, &self.queue);
            let decibels = psnr(&image(first)?, &image(second)?)?;
            score = Some(decibels.map_or(Score::Identical, Score::Decibels));
            self.compared = Some(Instant::now());
        }
        let buffers: u64 = pictures.iter().flatten().map(|p| p.pixels.size()).sum();
        Ok(Shot {
            view,
            scale,
            pictures,
            milliseconds,
            score,
            resident_bytes: buffers + self.painter.resident_bytes(),
        })
    }

    /// The picture of a screenshot: the painter's own where one model is shown, else what the screen shows.
    fn picture(&mut self, view: &View, arrangement: Arrangement) -> Result<Picture> {
        let pictures = self.paint(view, &view.camera)?;
        if let (Mode::One(_), Some(picture)) = (arrangement.mode, pictures.iter().flatten().next()) {
            let image = picture.to_image(&self.device, &self.queue)?;
            return Ok((image.width, image.height, image.to_8bit()));
        }
        self.composer.compose(&Showing { arrangement, pictures })
    }
}

/// `camera` with both sides of the picture multiplied with `scale`, at most 1.
fn scaled(camera: &Camera, scale: f64) -> Camera {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the width")]
    let width = (f64::from(camera.width) * scale.clamp(0.0, 1.0)).round() as u32;
    camera.with_max_width(width)
}

fn save(outputs: &OutputGroup, file: &std::path::Path, (width, height, pixels): &Picture) -> Result<()> {
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
            split: None,
        };
        View { camera, options: RenderOptions::default(), models: [Some(1), None] }
    }

    #[test]
    fn only_the_latest_view_is_drawn_and_nothing_else_is_lost() {
        let model = || Ask::Model(Which::First, None);
        let mut batch = vec![Ask::View(view(1), 1.0), model(), Ask::View(view(2), 1.0), model()];
        only_the_latest_view(&mut batch);
        let widths: Vec<Option<u32>> = batch
            .iter()
            .map(|ask| if let Ask::View(view, _) = ask { Some(view.camera.width) } else { None })
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
