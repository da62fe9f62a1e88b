//! The viewer on the main thread: the state and commands of `lexisplat view`, drawn on a canvas by WebGPU or on the processor.

mod bounds;
mod screen;
mod view;
mod worker;

use js_sys::{Object, Reflect, Uint8Array};
use lexisplat::packed::Eye;
use lexisplat_render::gpu::{SceneForm, ScenePart};
use lexisplat_render::{Pose, read_cameras_bytes};
use lexisplat_view::{Command, DVec3, Mode, Slot, State, keys, script};
use serde_json::{Value, json};
use wasm_bindgen::prelude::*;
use web_sys::HtmlCanvasElement;

use self::bounds::Bounds;
use self::screen::Screen;
use self::view::{Drawn, View};
use self::worker::Worker;
use crate::thrown;

/// Name of the processor as a renderer.
const PROCESSOR: &str = "processor";

/// Shows one or two scenes on a canvas. No method may be called before the promise of another method settles.
#[wasm_bindgen]
pub struct Viewer {
    state: State,
    /// The GPU. Without one a worker draws on the processor.
    screen: Option<Screen>,
    worker: Worker,
    bounds: Bounds,
    /// Facts about each scene from the page. The report returns them.
    infos: [Option<Value>; 2],
    /// Whether the cameras come from a file.
    given: bool,
    size: (u32, u32),
    drawn: Option<Drawn>,
}

impl std::fmt::Debug for Viewer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Viewer").field("state", &self.state).field("size", &self.size).finish_non_exhaustive()
    }
}

#[wasm_bindgen]
impl Viewer {
    /// Opens WebGPU for `canvas`. `options` is a JSON object. Its `background` is a colour of three numbers from 0 to 1.
    ///
    /// # Errors
    /// An error that tells why this browser cannot draw.
    pub async fn create(canvas: HtmlCanvasElement, options: String) -> Result<Viewer, JsError> {
        let size = (canvas.width().max(1), canvas.height().max(1));
        let mut viewer = Self::on_processor(&options)?;
        viewer.size = size;
        viewer.screen = Some(Screen::open(canvas).await.map_err(thrown)?);
        Ok(viewer)
    }

    /// Returns a viewer whose pictures a worker draws on the processor. `options` are those of [`Self::create`]. The page has to
    /// give the worker every form and part that it gives the viewer.
    ///
    /// # Errors
    /// An error if `options` is not JSON.
    pub fn on_processor(options: &str) -> Result<Viewer, JsError> {
        let options: Value = serde_json::from_str(options).map_err(thrown)?;
        let colour = |k: usize| options["background"][k].as_f64().unwrap_or(0.0);
        #[expect(clippy::cast_possible_truncation, reason = "a colour")]
        let background = [0, 1, 2].map(|k| colour(k) as f32);
        Ok(Self {
            state: State::new(background),
            screen: None,
            worker: Worker::default(),
            bounds: Bounds::default(),
            infos: [None, None],
            given: false,
            size: (1, 1),
            drawn: None,
        })
    }

    /// Returns the `GPUDevice` that draws, if there is one.
    #[must_use]
    pub fn device(&self) -> Option<JsValue> {
        self.screen.as_ref()?.device().cloned()
    }

    /// Carries out the words of a script; see [`lexisplat_view::SCRIPT_WORDS`]. Words about files are refused.
    ///
    /// # Errors
    /// An error with the word that is wrong. No word is carried out unless all words are right.
    pub fn run(&mut self, words: &str) -> Result<(), JsError> {
        let commands = script::parse(words).map_err(thrown)?;
        let not_here = |command: &&Command| {
            matches!(
                command,
                Command::Open(..)
                    | Command::Drop { .. }
                    | Command::Compress(_)
                    | Command::Screenshot(_)
                    | Command::Report
                    | Command::Quit
                    | Command::Swap
            )
        };
        if let Some(command) = commands.iter().find(not_here) {
            return Err(thrown(format!("{command:?} cannot be asked for in a page")));
        }
        commands.iter().for_each(|command| self.state.apply(command));
        Ok(())
    }

    /// Carries out the command of a key, named as in `KeyboardEvent.key`. Returns whether the key has a command.
    pub fn key(&mut self, key: &str) -> bool {
        let Some(command) = keys::command_of_key(key) else { return false };
        self.state.apply(&command);
        true
    }

    /// Turns the scene around the pivot to the right and down, in radians.
    pub fn orbit(&mut self, right: f64, down: f64) {
        self.moved([right, down], |camera| camera.orbit(right, down));
    }

    /// Turns the view around the camera to the right and down, in radians.
    pub fn look(&mut self, right: f64, down: f64) {
        self.moved([right, down], |camera| camera.look(right, down));
    }

    /// Moves the scene to the right and down, in shares of the picture's shorter side.
    pub fn pan(&mut self, right: f64, down: f64) {
        self.moved([right, down], |camera| camera.pan(right, down));
    }

    /// Multiplies the distance of the pivot by `factor`.
    pub fn dolly(&mut self, factor: f64) {
        if factor > 0.0 {
            self.moved([factor, 0.0], |camera| camera.dolly(factor));
        }
    }

    /// Flies to the right, up and forward, in radii of the scene.
    pub fn fly(&mut self, right: f64, up: f64, forward: f64) {
        self.moved([right + up, forward], |camera| camera.fly(DVec3::new(right, up, forward)));
    }

    /// Makes the point that is seen at a place the pivot. The place is in shares of the canvas from its left and upper
    /// edge.
    pub fn focus(&mut self, x: f64, y: f64) {
        let Some(camera) = self.state.camera(self.size.0, self.size.1) else { return };
        // If two pictures lie side by side, a place belongs to one of them.
        let columns = f64::from(self.state.arrangement().columns());
        if let Some(point) = self.bounds.seen(&camera, (x * columns).fract(), y) {
            self.state.focus(point);
        }
    }

    fn moved(&mut self, by: [f64; 2], change: impl FnOnce(&mut lexisplat_view::CameraController)) {
        if let Some(camera) = self.state.free_camera().filter(|_| by.iter().all(|v| v.is_finite())) {
            change(camera);
        }
    }

    /// Sets the size of the canvas, in device pixels.
    pub fn resize(&mut self, width: u32, height: u32) {
        self.size = (width.max(1), height.max(1));
        if let Some(screen) = &mut self.screen {
            screen.resize(self.size);
        }
        self.drawn = None;
    }

    /// Takes the cameras of INRIA's `cameras.json`. `[` and `]` step through them.
    ///
    /// # Errors
    /// An error that tells what is wrong with the bytes.
    pub fn cameras(&mut self, bytes: &[u8]) -> Result<(), JsError> {
        let cameras = read_cameras_bytes("cameras.json", bytes).map_err(thrown)?;
        self.given = true;
        let bounds = self.bounds.of_scene(&cameras);
        self.state.set_cameras(cameras, true, bounds);
        Ok(())
    }

    /// Begins a scene in a slot, 0 or 1, and replaces the scene in this slot. `info` is a JSON object that the report
    /// returns. Its `shown` is the number of Gaussians that will come, its `view` the text of the first view if there is one.
    ///
    /// # Errors
    /// An error if the bytes are not from [`Chunk.form`](crate::Chunk::form), or if the GPU refuses.
    pub async fn form(&mut self, slot: usize, bytes: Vec<u8>, info: String) -> Result<(), JsError> {
        let slot = slot_of(slot)?;
        let form = SceneForm::from_bytes(&bytes).map_err(thrown)?;
        let info: Value = serde_json::from_str(&info).map_err(thrown)?;
        if let Some(screen) = &mut self.screen {
            screen.begin(slot, &form).await.map_err(thrown)?;
        }
        let wanted = info["shown"].as_u64().unwrap_or(0);
        let first_view = info["view"].as_str().and_then(Pose::parse);
        self.infos[slot.index()] = Some(info);
        let was_open = self.infos.iter().flatten().count() > 1 || slot == Slot::Second;
        self.state.set_open([0, 1].map(|k| self.infos[k].is_some()));
        // The view is set for a scene that is alone or is a new first scene.
        if !was_open || slot == Slot::First {
            self.bounds.begin(slot, wanted, first_view);
        }
        self.drawn = None;
        Ok(())
    }

    /// Puts part `index` of the scene of a slot, and replaces the part with this index.
    ///
    /// # Errors
    /// An error if the bytes are not from [`Chunk.part`](crate::Chunk::part), or if the GPU refuses.
    pub async fn part(&mut self, slot: usize, index: usize, bytes: Vec<u8>) -> Result<(), JsError> {
        let slot = slot_of(slot)?;
        let part = ScenePart::from_bytes(&bytes).map_err(thrown)?;
        if let Some(screen) = &mut self.screen {
            screen.put(slot, index, &part).await.map_err(thrown)?;
        }
        if self.bounds.add(slot, index, &part) {
            self.look_at_scene();
        }
        self.drawn = None;
        Ok(())
    }

    /// Removes part `index` of the scene of a slot.
    ///
    /// # Errors
    /// An error if there is no such slot.
    pub fn remove_part(&mut self, slot: usize, index: usize) -> Result<(), JsError> {
        let slot = slot_of(slot)?;
        if let Some(screen) = &mut self.screen {
            screen.remove_part(slot, index);
        }
        self.drawn = None;
        Ok(())
    }

    /// Frames the part of the scene that has come, unless the user has changed the view.
    fn look_at_scene(&mut self) {
        if self.given {
            return;
        }
        let before = self.state.link();
        let is_untouched = self.bounds.link.as_ref().is_none_or(|link| link == &before);
        let (cameras, bounds) = self.bounds.around();
        self.state.set_first_view(self.bounds.first_view);
        self.state.set_cameras(cameras, false, bounds);
        if is_untouched {
            self.bounds.link = Some(self.state.link());
        } else {
            // The text was made by `link`, so it is a valid link.
            let _ = self.state.apply_link(&before);
        }
    }

    /// Removes the scene of a slot.
    ///
    /// # Errors
    /// An error if there is no such slot.
    pub fn remove(&mut self, slot: usize) -> Result<(), JsError> {
        let slot = slot_of(slot)?;
        if let Some(screen) = &mut self.screen {
            screen.remove(slot);
        }
        self.infos[slot.index()] = None;
        self.state.set_open([0, 1].map(|k| self.infos[k].is_some()));
        self.drawn = None;
        Ok(())
    }

    /// Draws on the GPU and shows changes since the last call, with both sides of pictures multiplied by `scale`, at most 1. Returns
    /// whether there was anything to do.
    ///
    /// # Errors
    /// Errors of the GPU.
    pub async fn draw(&mut self, scale: f64) -> Result<bool, JsError> {
        let Some(view) = self.wanted_view(scale) else { return Ok(false) };
        let Some(screen) = &mut self.screen else { return Ok(false) };
        let before = self.drawn.take();
        self.drawn = Some(screen.draw(view, before).await.map_err(thrown)?);
        Ok(true)
    }

    /// Returns the view to draw; `None` if it is shown already.
    fn wanted_view(&self, scale: f64) -> Option<View> {
        let view = View {
            // Coarse pictures are of a moving view. Only visible models are drawn then.
            wanted: if scale < 1.0 { self.state.arrangement().mode.needs() } else { [true; 2] },
            camera: self.state.camera(self.size.0, self.size.1)?,
            options: self.state.options(),
            arrangement: self.state.arrangement(),
            scale: scale.clamp(0.0, 1.0),
        };
        let is_shown = self.drawn.as_ref().is_some_and(|drawn| drawn.shows(&view));
        (!is_shown).then_some(view)
    }

    /// Returns the state of the view and statistics as JSON.
    #[must_use]
    pub fn report(&self) -> String {
        let (arrangement, options) = (self.state.arrangement(), self.state.options());
        let drawn = self.drawn.as_ref();
        let camera = self.state.camera(self.size.0, self.size.1);
        let (screen, worker) = (self.screen.as_ref(), &self.worker);
        let scene_bytes = screen.map_or(worker.bytes, Screen::scene_bytes);
        let scenes = scene_bytes.map(|bytes| bytes.map(|b| json!({"geometry": b.geometry, "sh": b.sh})));
        let value = json!({
            "device": screen.map_or(PROCESSOR, Screen::device_name),
            "renderer": if screen.is_some() { "webgpu" } else { PROCESSOR },
            "mode": arrangement.mode.name(),
            "modes": Mode::ALL.map(Mode::name),
            "view": camera.as_ref().map(|camera| json!({
                "width": camera.width,
                "height": camera.height,
                "focal": [camera.fx, camera.fy],
                "position": camera.position,
                "rotation": camera.rotation,
            })),
            "eye": camera.as_ref().map(|camera| eye(&camera.eye())),
            "camera": camera.map(|camera| camera.name),
            "cameras": self.state.cameras().len(),
            "index": self.state.index(),
            "free": self.state.is_free(),
            "width": self.size.0,
            "height": self.size.1,
            "milliseconds": drawn.map(|drawn| drawn.milliseconds),
            "drawn": drawn.map_or([None; 2], |drawn| drawn.visible),
            "gaussians": screen.map_or(worker.gaussians, Screen::gaussians),
            "resident_bytes": screen.map_or(worker.resident, Screen::resident_bytes),
            "most_bytes": screen.map_or(worker.resident, Screen::most_bytes),
            "scene_bytes": scenes,
            "psnr": drawn.and_then(|drawn| drawn.psnr),
            "identical": drawn.is_some_and(|drawn| drawn.identical),
            "split": arrangement.split,
            "gain": arrangement.gain,
            "degree": options.max_degree.map(|degree| degree.get()),
            "background": options.background,
            "panel": self.state.panel(),
            "models": self.infos,
        });
        value.to_string()
    }

    /// Returns a link to exactly the view shown, for the fragment of an address.
    #[must_use]
    pub fn link(&self) -> String {
        self.state.link()
    }

    /// Applies a text of [`Self::link`].
    ///
    /// # Errors
    /// An error with the word that is wrong. Nothing changes in this case.
    pub fn set_link(&mut self, text: &str) -> Result<(), JsError> {
        self.state.apply_link(text).map_err(thrown)
    }

    /// Returns the picture shown as `{width, height, data}`, with red, green, blue and opacity of each pixel, 8 bits
    /// each. The page has the pictures of a worker itself.
    ///
    /// # Errors
    /// An error if nothing was drawn yet on a GPU, and errors of the GPU.
    pub async fn picture(&mut self) -> Result<Object, JsError> {
        let shown = self.screen.as_mut().zip(self.drawn.as_ref());
        let (screen, drawn) = shown.ok_or_else(|| thrown("nothing is shown yet"))?;
        let (width, height, pixels) = screen.picture(drawn).await.map_err(thrown)?;
        let data: Vec<u8> = pixels.iter().flat_map(|&[r, g, b]| [r, g, b, u8::MAX]).collect();
        let out = Object::new();
        let set = |name: &str, value: JsValue| {
            // A new object accepts every property.
            let _ = Reflect::set(&out, &JsValue::from(name), &value);
        };
        set("width", width.into());
        set("height", height.into());
        set("data", Uint8Array::from(data.as_slice()).into());
        Ok(out)
    }
}

/// Returns the numbers of `eye` for `Stream.look`; `None` for an eye that looks in all directions.
fn eye(eye: &Eye) -> Option<[f32; 8]> {
    let ([x, y, z], [right, down, forward]) = (eye.position, eye.forward?);
    Some([x, y, z, right, down, forward, eye.half_angle, eye.pixel])
}

fn slot_of(slot: usize) -> Result<Slot, JsError> {
    Slot::BOTH.get(slot).copied().ok_or_else(|| thrown(format!("slot is {slot}, expected 0 or 1")))
}
