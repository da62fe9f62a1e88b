//! The state of the window. It takes keys and the events of its threads, and asks for pictures.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use eframe::egui;
use eframe::egui_wgpu::RenderState;
use glam::DVec3;
use lexisplat_render::gpu::Gpu;
use lexisplat_render::{Camera, Device};

use crate::Options;
use crate::camera_controller::SceneBounds;
use crate::command::{Command, Slot};
use crate::error::{Error, Result};
use crate::given_cameras::GivenCameras;
use crate::keys;
use crate::models::{FinishedJob, Job, Notifier, OpenModel, OrbitSize};
use crate::present::Presenter;
use crate::render_thread::{Frame, RenderEvent, RenderRequest, RenderThread, Score, View};
use crate::scene_renderer::{CpuSceneRenderer, GpuSceneRenderer, SceneRenderer};
use crate::script::Script;
use crate::state::State;

/// Time without motion after which the picture is drawn in full resolution.
const REST: Duration = Duration::from_millis(200);
/// Time that a picture may take while the view moves, in milliseconds.
const MOVING_BUDGET: f64 = 80.0;
/// Smallest scale of pictures while the view moves: a factor on each side.
const LEAST_SCALE: f64 = 0.2;
/// Number of messages that the panel keeps.
const MESSAGES: usize = 5;

/// A line for the panel.
#[derive(Debug, Clone)]
pub(crate) struct Message {
    pub(crate) text: String,
    pub(crate) is_error: bool,
}

/// The window.
pub(crate) struct App {
    pub(crate) options: Options,
    pub(crate) state: State,
    /// The cameras of a file, if one was read.
    pub(crate) given: Option<GivenCameras>,
    pub(crate) models: [Option<Arc<OpenModel>>; 2],
    pub(crate) jobs: [Option<Job>; 2],
    /// Largest id of a job that opens a file named on the command line. If such a job fails, the program fails.
    pub(crate) required: u64,
    /// Last id given to a job and to its model.
    pub(crate) last_id: u64,
    pub(crate) notifier: Notifier,
    finished: Receiver<FinishedJob>,
    /// Errors that the graphics driver reports, at any time and on any thread.
    driver_errors: Receiver<String>,
    pub(crate) render_thread: RenderThread,
    pub(crate) presenter: Arc<Presenter>,
    pub(crate) frame: Option<Frame>,
    /// The result of the last comparison of the models' pictures.
    pub(crate) score: Option<Score>,
    /// Whether the render thread is drawing a view.
    drawing: bool,
    /// Last view that could not be drawn. It is not requested again.
    failed: Option<View>,
    /// Number of screenshots that were requested and are not saved yet.
    pub(crate) saving: usize,
    /// Scale of pictures while the view moves: a factor on each side.
    scale: f64,
    last_move: Option<Instant>,
    /// Width and height of the area for the picture, in pixels.
    pub(crate) area: (u32, u32),
    /// Whether the wipe's line is being dragged.
    pub(crate) dragging_split: bool,
    pub(crate) messages: VecDeque<Message>,
    pub(crate) script: Script,
    /// Whether the script is still running.
    pub(crate) scripted: bool,
    /// Whether the window closes after this frame.
    pub(crate) quit: bool,
    /// Sender of the errors with which the program ends. The first error counts.
    failures: Sender<Error>,
}

impl App {
    /// Starts the threads and opens the files that the command line names.
    pub(crate) fn new(
        creation: &eframe::CreationContext<'_>,
        options: Options,
        given: Option<GivenCameras>,
        script: Script,
        failures: Sender<Error>,
    ) -> Result<Self> {
        let Some(graphics) = &creation.wgpu_render_state else { return Err(Error::NoAdapter) };
        let context = creation.egui_ctx.clone();
        let wake: Arc<dyn Fn() + Send + Sync> = Arc::new(move || context.request_repaint());
        let (errors, driver_errors) = channel();
        let wake_window = Arc::clone(&wake);
        graphics.device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            // After the window has closed there is no receiver.
            let _ = errors.send(error.to_string());
            wake_window();
        }));
        let (renderer, gpu_error) = renderer(options.device, graphics)?;
        let wake_window = Arc::clone(&wake);
        let render_thread = RenderThread::start(
            renderer,
            graphics.device.clone(),
            graphics.queue.clone(),
            options.outputs.clone(),
            move || wake_window(),
        )?;
        let (sender, finished) = channel();
        let mut app = Self {
            state: State::new(options.background),
            given,
            models: [None, None],
            jobs: [None, None],
            required: 0,
            last_id: 0,
            notifier: Notifier { sender, wake },
            finished,
            driver_errors,
            render_thread,
            presenter: Arc::new(Presenter::new(graphics.device.clone(), graphics.target_format)),
            frame: None,
            score: None,
            drawing: false,
            failed: None,
            saving: 0,
            scale: 0.5,
            last_move: None,
            area: (0, 0),
            dragging_split: false,
            messages: VecDeque::new(),
            scripted: !script.is_empty(),
            script,
            quit: false,
            failures,
            options,
        };
        if let Some(error) = gpu_error {
            app.show_message(format!("drawing on the CPU, because the GPU failed: {error}"));
        }
        for (path, slot) in app.options.files.clone().into_iter().zip(Slot::BOTH) {
            app.handle(Command::Open(path, slot));
        }
        app.required = app.last_id;
        Ok(app)
    }

    pub(crate) fn orbit_size(&self) -> OrbitSize {
        let Options { orbit, max_width, near, .. } = &self.options;
        OrbitSize { views: (*orbit).max(1), max_width: (*max_width).max(1), near: *near }
    }

    /// Shows a message in the panel.
    pub(crate) fn show_message(&mut self, text: impl Into<String>) {
        self.message(text.into(), false);
    }

    /// Shows an error in the panel, or ends the program with it if a script is running.
    pub(crate) fn show_error(&mut self, error: Error) {
        if self.scripted {
            self.fail(error);
        } else {
            self.message(error.to_string(), true);
        }
    }

    fn message(&mut self, text: String, is_error: bool) {
        self.messages.push_back(Message { text, is_error });
        while self.messages.len() > MESSAGES {
            self.messages.pop_front();
        }
    }

    /// Ends the program with `error`.
    fn fail(&mut self, error: Error) {
        // There is always a receiver: the function that opened the window.
        let _ = self.failures.send(error);
        self.quit = true;
    }

    /// Replaces the model of `slot`.
    pub(crate) fn set_model(&mut self, slot: Slot, model: Option<Arc<OpenModel>>) {
        self.models[slot.index()].clone_from(&model);
        self.score = None;
        if let Err(error) = self.render_thread.request(RenderRequest::Model(slot, model)) {
            self.show_error(error);
        }
        self.state.set_open([0, 1].map(|i| self.models[i].is_some()));
    }

    /// Chooses the first camera of the camera file, or of an orbit around the first model.
    pub(crate) fn reset_cameras(&mut self) {
        let Some(model) = self.models.iter().flatten().next().cloned() else { return };
        let (cameras, given) = match self.given_cameras(&model) {
            Ok(Some(cameras)) => (cameras, true),
            Ok(None) => (model.orbit.clone(), false),
            Err(error) => return self.show_error(error),
        };
        let bounds = SceneBounds::new(model.bulk, model.near, if given { &cameras } else { &[] });
        self.state.set_first_view(model.scene.scene().first_view());
        self.state.set_cameras(cameras, given, bounds);
    }

    /// Returns the cameras of the camera file, if there is one, for `model`.
    pub(crate) fn given_cameras(&mut self, model: &OpenModel) -> Result<Option<Vec<Camera>>> {
        let offset = model.scene.scene().meta().offset;
        self.given.as_mut().map(|given| Ok(given.relative_to(offset)?.to_vec())).transpose()
    }

    /// Handles finished jobs, events of the render thread and errors of the driver.
    pub(crate) fn process_events(&mut self) {
        while let Ok(FinishedJob { id, slot, result }) = self.finished.try_recv() {
            let running = &mut self.jobs[slot.index()];
            if running.as_ref().is_none_or(|job| job.id != id) {
                continue; // A later job has replaced this one.
            }
            *running = None;
            match result {
                Ok(model) => {
                    for warning in model.scene.warnings() {
                        self.message(format!("{}: {warning}", model.short_name()), false);
                    }
                    let is_first = self.models.iter().all(Option::is_none)
                        || (slot == Slot::First && self.given.is_none());
                    self.set_model(slot, Some(Arc::new(model)));
                    if is_first {
                        self.reset_cameras();
                    }
                }
                Err(error) if id <= self.required => self.fail(error),
                Err(error) => self.show_error(error),
            }
        }
        let events: Vec<RenderEvent> = self.render_thread.events().collect();
        for event in events {
            match event {
                RenderEvent::Frame(Ok(frame)) => {
                    self.drawing = false;
                    self.adapt_scale(&frame);
                    self.score = frame.score.or(self.score);
                    self.frame = Some(*frame);
                }
                RenderEvent::Saved(saved) => {
                    self.saving = self.saving.saturating_sub(1);
                    match saved.map(|file| file.canonicalize().unwrap_or(file)) {
                        Ok(file) => self.show_message(format!("saved {}", file.display())),
                        Err(error) => self.show_error(error),
                    }
                }
                RenderEvent::ModelFailed(slot, error) => {
                    self.set_model(slot, None);
                    self.show_error(error);
                }
                RenderEvent::Frame(Err(error)) => {
                    self.drawing = false;
                    self.failed = self.wanted_view();
                    self.show_error(error);
                }
            }
        }
        if !self.render_thread.is_alive() && !self.quit {
            self.fail(Error::Device("the render thread has stopped".to_owned()));
        }
        while let Ok(error) = self.driver_errors.try_recv() {
            self.show_error(Error::Device(error));
        }
    }

    /// Adapts the scale of pictures during motion to the time of `frame`.
    fn adapt_scale(&mut self, frame: &Frame) {
        let by = (MOVING_BUDGET / frame.milliseconds.max(1.0)).sqrt();
        self.scale = (frame.scale * by).clamp(LEAST_SCALE, 1.0);
    }

    /// Records that the user moves the view now.
    pub(crate) fn note_motion(&mut self) {
        self.last_move = Some(Instant::now());
    }

    fn is_moving(&self) -> bool {
        self.last_move.is_some_and(|last| last.elapsed() < REST)
    }

    /// Returns the view that should be on screen.
    pub(crate) fn wanted_view(&self) -> Option<View> {
        let camera = self.state.camera(self.area.0, self.area.1)?;
        // Without motion both models are drawn, so that they can be compared and switched at once.
        let needs = if self.is_moving() { self.state.arrangement().mode.needs() } else { [true; 2] };
        Some(View { camera, options: self.state.options(), models: self.open_ids(needs)? })
    }

    /// Returns the ids of the open models among those that are needed; `None` if none of these is open.
    pub(crate) fn open_ids(&self, needs: [bool; 2]) -> Option<[Option<u64>; 2]> {
        let ids = [0, 1].map(|i| self.models[i].as_ref().filter(|_| needs[i]).map(|m| m.id));
        ids.iter().any(Option::is_some).then_some(ids)
    }

    /// Returns whether the frame on screen is `view` in full resolution.
    fn shows(&self, view: &View) -> bool {
        self.frame.as_ref().is_some_and(|frame| frame.scale >= 1.0 && frame.view.covers(view))
    }

    /// Requests the wanted view if the frame on screen is of another view.
    pub(crate) fn request_frame(&mut self, context: &egui::Context) {
        let moving = self.is_moving();
        if moving {
            // A frame after the end of the motion draws in full resolution.
            context.request_repaint_after(REST);
        }
        let Some(view) = self.wanted_view() else { return };
        let there = self.frame.as_ref().is_some_and(|frame| frame.view.covers(&view));
        if self.drawing || self.failed.as_ref() == Some(&view) || (there && moving) || self.shows(&view) {
            return;
        }
        let scale = if moving { self.scale } else { 1.0 };
        match self.render_thread.request(RenderRequest::View(view, scale)) {
            Ok(()) => self.drawing = true,
            Err(error) => self.show_error(error),
        }
    }

    /// Returns whether everything that was requested is done.
    pub(crate) fn is_settled(&self) -> bool {
        let drawn = self.wanted_view().is_none_or(|view| self.shows(&view));
        drawn && !self.drawing && self.saving == 0 && self.jobs.iter().all(Option::is_none)
    }

    pub(crate) fn keys(&mut self, context: &egui::Context) {
        if context.egui_wants_keyboard_input() {
            return;
        }
        let (pressed, flight, seconds, fast) = context.input(|input| {
            let pressed: Vec<egui::Key> = input
                .events
                .iter()
                .filter_map(|event| match event {
                    egui::Event::Key { key, pressed: true, modifiers, .. } if !modifiers.command => {
                        Some(*key)
                    }
                    _ => None,
                })
                .collect();
            let flight = keys::window::flight(|key| input.key_down(key), input.modifiers);
            (pressed, flight, input.stable_dt, input.modifiers.shift)
        });
        for command in pressed.into_iter().filter_map(keys::window::command) {
            self.handle(command);
        }
        if flight != DVec3::ZERO {
            self.state.fly(flight, f64::from(seconds), fast);
            self.note_motion();
            context.request_repaint();
        }
    }

    pub(crate) fn dropped(&mut self, context: &egui::Context) {
        let (paths, first) = context.input(|input| {
            let paths: Vec<_> = input.raw.dropped_files.iter().map(|file| file.path().to_owned()).collect();
            (paths, input.modifiers.shift)
        });
        if !paths.is_empty() {
            self.handle(Command::Drop { paths, first });
        }
    }
}

/// Returns the renderer of the scenes, and the error of the GPU if the CPU draws because the GPU failed.
fn renderer(device: Device, graphics: &RenderState) -> Result<(Box<dyn SceneRenderer>, Option<Error>)> {
    let on_gpu = || {
        let (device, queue) = (graphics.device.clone(), graphics.queue.clone());
        GpuSceneRenderer::new(Gpu::from_device(&graphics.adapter, device, queue))
    };
    let software = graphics.adapter.get_info().device_type == wgpu::DeviceType::Cpu;
    let gpu_error = match device {
        Device::Gpu | Device::Index(_) => return Ok((Box::new(on_gpu()?), None)),
        Device::Auto if !software => match on_gpu() {
            Ok(renderer) => return Ok((Box::new(renderer), None)),
            Err(error) => Some(error),
        },
        Device::Auto | Device::Cpu => None,
    };
    Ok((Box::new(CpuSceneRenderer::new(graphics.device.clone())), gpu_error))
}
