//! The view from which a viewer shows a scene first.

use anyhow::{Context as _, Result};
use lexisplat_compress::ORBIT_SIZE;
use lexisplat_render::{Camera, Image, RenderOptions, Renderer, Scene, bulk, near_plane, orbit};
use lexisplat_view::{Command, SceneBounds, State, script};

/// Number of views of the orbit of a viewer. A scene whose file states no view is shown from the first one.
const ORBIT: usize = 24;

/// The view from which a viewer shows a scene first. A viewer of a scene without a stated view would choose it from the parts
/// of the scene that arrive first, so a page states it.
pub(super) struct FirstView {
    /// The given words, and a word for exactly this view.
    pub(super) words: String,
    /// The text of the view.
    pub(super) pose: String,
    state: State,
}

impl FirstView {
    /// Returns the view of `scene` that a viewer has after `words`, which are words of a script.
    pub(super) fn new(scene: &Scene<'_>, words: &str) -> Result<Self> {
        let cameras = orbit(scene.geometry(), ORBIT, ORBIT_SIZE.0, ORBIT_SIZE.1);
        let mut state = State::new([0.0; 3]);
        state.set_open([true, false]);
        let bounds = SceneBounds::new(bulk(scene.geometry()), near_plane(scene.geometry()), &[]);
        state.set_first_view(scene.first_view());
        state.set_cameras(cameras, false, bounds);
        for command in script::parse(words)? {
            state.apply(&command);
        }
        // A chosen camera becomes a free camera, whose picture fills the window.
        let pose = state.free_camera().map(|camera| camera.pose());
        let pose = pose.context("there is no view of the scene")?;
        state.apply(&Command::View(pose));
        let pose = pose.to_string();
        let words =
            if words.trim().is_empty() { format!("view={pose}") } else { format!("{words},view={pose}") };
        Ok(Self { words, pose, state })
    }

    /// Returns the options of drawing after the words.
    pub(super) fn options(&self) -> RenderOptions {
        self.state.options()
    }

    /// Returns the camera for a picture of this width and height.
    pub(super) fn camera(&self, (width, height): (u32, u32)) -> Result<Camera> {
        self.state.camera(width, height).context("there is no view of the scene")
    }

    /// Returns a picture of `scene` of this width and height.
    pub(super) fn picture(
        &self,
        renderer: &mut Renderer,
        scene: &Scene<'_>,
        size: (u32, u32),
    ) -> Result<Image> {
        let prepared = renderer.prepare(*scene)?;
        Ok(renderer.render(&prepared, &self.camera(size)?, &self.options())?)
    }
}
