//! The window's life: hears from its threads, takes keys, shows its parts, and goes on with the script.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use eframe::egui;
use eframe::egui_wgpu::RenderState;
use glam::DVec3;
use lexisplat_render::gpu::Gpu;
use lexisplat_render::{Camera, Device};

use crate::Options;
use crate::command::{Command, Which};
use crate::error::{Error, Result};
use crate::eye::Surroundings;
use crate::keys;
use crate::models::{Bell, Finished, Open, OrbitSize, Work};
use crate::painter::{Cpu, OnGpu, Painter};
use crate::painting::{Ask, Painting, Score, Shot, Told, View};
use crate::panel;
use crate::present::Presenter;
use crate::script::Script;
use crate::state::State;

/// After this long without a move, the picture is drawn in full.
const REST: Duration = Duration::from_millis(200);
/// Time that a picture may take while moving, in milliseconds.
const MOVING_BUDGET: f64 = 80.0;
/// Least share of its size on each side that a picture is drawn at while moving.
const LEAST_SCALE: f64 = 0.2;
/// Longest step of a flight, in seconds, however long the last frame took.
const LONGEST_STEP: f32 = 0.1;
/// Scene radii a second, and times that with shift.
const SPEED: f64 = 0.6;
const FAST: f64 = 4.0;
/// Messages kept.
const MESSAGES: usize = 5;

/// Something the user should know.
#[derive(Debug, Clone)]
pub(crate) struct Message {
    pub(crate) text: String,
    pub(crate) is_error: bool,
}

/// Errors that graphics drivers report at any time, on any thread.
pub(crate) type DriverErrors = Arc<Mutex<VecDeque<String>>>;

/// The window.
pub(crate) struct App {
    pub(crate) options: Options,
    pub(crate) state: State,
    /// Cameras from a file.
    pub(crate) given: Option<Vec<Camera>>,
    pub(crate) models: [Option<Arc<Open>>; 2],
    pub(crate) works: [Option<Work>; 2],
    /// Jobs numbered up to this one open what the command line names: the program fails if they do.
    pub(crate) required: u64,
    /// Numbers jobs and models.
    pub(crate) last_id: u64,
    pub(crate) bell: Bell,
    finished: Receiver<Finished>,
    driver: DriverErrors,
    pub(crate) painting: Painting,
    pub(crate) presenter: Arc<Presenter>,
    pub(crate) shot: Option<Shot>,
    /// How far the models' pictures were apart when they were last compared.
    pub(crate) score: Option<Score>,
    /// Whether a view is being drawn.
    drawing: bool,
    /// The last view that could not be drawn: not to be tried again.
    failed: Option<View>,
    /// Screenshots not saved yet.
    pub(crate) saving: usize,
    /// Share of its size on each side that a picture is drawn at while moving.
    scale: f64,
    last_move: Option<Instant>,
    /// Pixels of the screen that the picture may take.
    pub(crate) area: (u32, u32),
    /// Whether the wipe's line is being dragged.
    pub(crate) dragging_split: bool,
    pub(crate) messages: VecDeque<Message>,
    script: Script,
    /// Whether the script still runs.
    scripted: bool,
    /// Whether the window is to close.
    pub(crate) quit: bool,
    outcome: Arc<Mutex<Option<Error>>>,
}

impl App {
    /// Starts the threads, and opens what the command line names.
    pub(crate) fn new(
        creation: &eframe::CreationContext<'_>,
        options: Options,
        given: Option<Vec<Camera>>,
        script: Script,
        outcome: Arc<Mutex<Option<Error>>>,
    ) -> Result<Self> {
        let Some(graphics) = &creation.wgpu_render_state else { return Err(Error::NoAdapter) };
        let context = creation.egui_ctx.clone();
        let wake: Arc<dyn Fn() + Send + Sync> = Arc::new(move || context.request_repaint());
        let driver = DriverErrors::default();
        let (errors, ring) = (Arc::clone(&driver), Arc::clone(&wake));
        graphics.device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            errors.lock().unwrap_or_else(PoisonError::into_inner).push_back(error.to_string());
            ring();
        }));
        let (painter, refused) = painter(options.device, graphics)?;
        let ring = Arc::clone(&wake);
        let painting = Painting::start(
            painter,
            graphics.device.clone(),
            graphics.queue.clone(),
            options.outputs.clone(),
            move || ring(),
        )?;
        let (sender, finished) = channel();
        let mut app = Self {
            state: State::new(options.background),
            given,
            models: [None, None],
            works: [None, None],
            required: 0,
            last_id: 0,
            bell: Bell { sender, wake },
            finished,
            driver,
            painting,
            presenter: Arc::new(Presenter::new(&graphics.device, graphics.target_format)),
            shot: None,
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
            outcome,
            options,
        };
        if let Some(error) = refused {
            app.say(format!("drawing on the processor: {error}"));
        }
        for (path, which) in app.options.files.clone().into_iter().zip(Which::BOTH) {
            app.perform(Command::Open(path, which));
        }
        app.required = app.last_id;
        Ok(app)
    }

    pub(crate) fn orbit_size(&self) -> OrbitSize {
        OrbitSize { views: self.options.orbit.max(1), max_width: self.options.max_width.max(1) }
    }

    /// Says something in the panel.
    pub(crate) fn say(&mut self, text: impl Into<String>) {
        self.message(text.into(), false);
    }

    /// Says what went wrong; ends the program if a script is running.
    pub(crate) fn complain(&mut self, error: Error) {
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
        let mut outcome = self.outcome.lock().unwrap_or_else(PoisonError::into_inner);
        outcome.get_or_insert(error);
        self.quit = true;
    }

    /// Puts a model in place.
    pub(crate) fn put(&mut self, which: Which, model: Option<Arc<Open>>) {
        self.models[which.index()].clone_from(&model);
        self.score = None;
        if let Err(error) = self.painting.ask(Ask::Model(which, model)) {
            self.complain(error);
        }
        self.state.set_open([0, 1].map(|i| self.models[i].is_some()));
    }

    /// Stands where the cameras of a file are, or around the first model.
    pub(crate) fn surround(&mut self) {
        let Some(model) = self.models.iter().flatten().next() else { return };
        let (centre, radius) = model.bulk;
        let (cameras, given) = match &self.given {
            Some(cameras) => (cameras.clone(), true),
            None => (model.orbit.clone(), false),
        };
        let up = if given { Surroundings::up_of(&cameras) } else { DVec3::NEG_Y };
        let around = Surroundings { centre: DVec3::from_array(centre), radius, up };
        self.state.set_cameras(cameras, given, around);
    }

    /// Takes in what the threads have done.
    fn hear(&mut self) {
        while let Ok(Finished { id, which, result }) = self.finished.try_recv() {
            let place = &mut self.works[which.index()];
            if place.as_ref().is_none_or(|work| work.id != id) {
                continue; // Another one was started since.
            }
            *place = None;
            match result {
                Ok(model) => {
                    for warning in model.scene.warnings() {
                        self.message(format!("{}: {warning}", model.short_name()), false);
                    }
                    let anew = self.models.iter().all(Option::is_none)
                        || (which == Which::First && self.given.is_none());
                    self.put(which, Some(Arc::new(model)));
                    if anew {
                        self.surround();
                    }
                }
                Err(error) if id <= self.required => self.fail(error),
                Err(error) => self.complain(error),
            }
        }
        let told: Vec<Told> = self.painting.hear().collect();
        for told in told {
            match told {
                Told::Shot(shot) => {
                    self.drawing = false;
                    self.keep_pace(&shot);
                    self.score = shot.score.or(self.score);
                    self.shot = Some(*shot);
                }
                Told::Saved(file) => {
                    self.saving = self.saving.saturating_sub(1);
                    let file = file.canonicalize().unwrap_or(file);
                    self.say(format!("saved {}", file.display()));
                }
                Told::NotSaved(error) => {
                    self.saving = self.saving.saturating_sub(1);
                    self.complain(error);
                }
                Told::Refused(which, error) => {
                    self.put(which, None);
                    self.complain(error);
                }
                Told::Failed(error) => {
                    self.drawing = false;
                    self.failed = self.wanted();
                    self.complain(error);
                }
            }
        }
        if !self.painting.is_alive() && !self.quit {
            self.fail(Error::Device("drawing has stopped".to_owned()));
        }
        loop {
            let error = self.driver.lock().unwrap_or_else(PoisonError::into_inner).pop_front();
            let Some(error) = error else { break };
            self.complain(Error::Device(error));
        }
    }

    /// Draws smaller pictures while moving if they take long, and larger ones if they do not.
    fn keep_pace(&mut self, shot: &Shot) {
        let by = (MOVING_BUDGET / shot.milliseconds.max(1.0)).sqrt();
        self.scale = (shot.scale * by).clamp(LEAST_SCALE, 1.0);
    }

    /// Remembers that the view moves under the user's hand.
    pub(crate) fn moved(&mut self) {
        self.last_move = Some(Instant::now());
    }

    fn is_moving(&self) -> bool {
        self.last_move.is_some_and(|last| last.elapsed() < REST)
    }

    /// The view that should be on screen.
    pub(crate) fn wanted(&self) -> Option<View> {
        let camera = self.state.camera(self.area.0, self.area.1)?;
        // At rest both are drawn, so that they can be compared, and exchanged at once.
        let needs = if self.is_moving() { self.state.arrangement.mode.needs() } else { [true; 2] };
        let models = [0, 1].map(|i| self.models[i].as_ref().filter(|_| needs[i]).map(|m| m.id));
        models.iter().any(Option::is_some).then_some(View { camera, options: self.state.options, models })
    }

    /// Whether the picture on screen is `view`, complete.
    fn shows(&self, view: &View) -> bool {
        self.shot.as_ref().is_some_and(|shot| shot.scale >= 1.0 && shot.view.covers(view))
    }

    /// Asks for the wanted view if it is not there.
    fn draw(&mut self, context: &egui::Context) {
        let moving = self.is_moving();
        if moving {
            // To see that it stopped.
            context.request_repaint_after(REST);
        }
        let Some(view) = self.wanted() else { return };
        let there = self.shot.as_ref().is_some_and(|shot| shot.view.covers(&view));
        if self.drawing || self.failed.as_ref() == Some(&view) || (there && moving) || self.shows(&view) {
            return;
        }
        let scale = if moving { self.scale } else { 1.0 };
        match self.painting.ask(Ask::View(view, scale)) {
            Ok(()) => self.drawing = true,
            Err(error) => self.complain(error),
        }
    }

    /// Whether nothing is under way.
    fn is_settled(&self) -> bool {
        let drawn = self.wanted().is_none_or(|view| self.shows(&view));
        drawn && !self.drawing && self.saving == 0 && self.works.iter().all(Option::is_none)
    }

    fn keys(&mut self, context: &egui::Context) {
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
            let flight = keys::flight(|key| input.key_down(key), input.modifiers);
            (pressed, flight, input.stable_dt.min(LONGEST_STEP), input.modifiers.shift)
        });
        for command in pressed.into_iter().filter_map(keys::command) {
            self.perform(command);
        }
        if flight != DVec3::ZERO {
            let speed = SPEED * if fast { FAST } else { 1.0 };
            if let Some(eye) = self.state.eye() {
                eye.fly(flight * speed * f64::from(seconds));
            }
            self.moved();
            context.request_repaint();
        }
    }

    fn dropped(&mut self, context: &egui::Context) {
        let (paths, first) = context.input(|input| {
            let paths: Vec<_> = input.raw.dropped_files.iter().map(|file| file.path().to_owned()).collect();
            (paths, input.modifiers.shift)
        });
        if !paths.is_empty() {
            self.perform(Command::Drop { paths, first });
        }
    }
}

/// What draws, and why not the GPU if that was tried in vain.
fn painter(device: Device, graphics: &RenderState) -> Result<(Box<dyn Painter>, Option<Error>)> {
    let on_gpu = || {
        let (device, queue) = (graphics.device.clone(), graphics.queue.clone());
        OnGpu::new(Gpu::from_device(&graphics.adapter, device, queue))
    };
    let software = graphics.adapter.get_info().device_type == wgpu::DeviceType::Cpu;
    let refused = match device {
        Device::Gpu | Device::Index(_) => return Ok((Box::new(on_gpu()?), None)),
        Device::Auto if !software => match on_gpu() {
            Ok(painter) => return Ok((Box::new(painter), None)),
            Err(error) => Some(error),
        },
        Device::Auto | Device::Cpu => None,
    };
    Ok((Box::new(Cpu::new(graphics.device.clone())), refused))
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        let context = ui.ctx().clone();
        self.hear();
        self.keys(&context);
        self.dropped(&context);
        if self.state.panel {
            for command in panel::show(self, ui) {
                self.perform(command);
            }
        }
        self.stage(ui);
        self.draw(&context);
        if self.scripted && !self.quit && self.is_settled() {
            match self.script.pop_front() {
                Some(command) => self.perform(command),
                // From here on the user is in charge.
                None => self.scripted = false,
            }
            context.request_repaint();
        }
        if self.quit {
            context.send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }
}
