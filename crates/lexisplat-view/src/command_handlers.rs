//! The effects of commands on files, jobs and pictures. `State` handles the other commands.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use lexisplat_compress::SplitFilter;
use serde_json::json;

use crate::Options;
use crate::app::App;
use crate::command::{Command, Mode, Quality, Slot};
use crate::error::{Error, Result};
use crate::given_cameras::GivenCameras;
use crate::models;
use crate::render_thread::{RenderRequest, Score, View};

/// Largest number tried in the file name of a screenshot.
const MOST_NAMES: u32 = 100_000;

impl App {
    /// Carries out `command`. The panel shows the error if it fails.
    pub(crate) fn handle(&mut self, command: Command) {
        if let Err(error) = self.try_handle(command) {
            self.show_error(error);
        }
    }

    fn try_handle(&mut self, command: Command) -> Result<()> {
        match command {
            Command::Open(path, slot) => self.open(path, slot),
            Command::Drop { paths, first } => self.take_dropped(paths, first)?,
            Command::Compress(quality) => self.compress(quality)?,
            Command::Swap => self.swap(),
            Command::Screenshot(file) => self.screenshot(file)?,
            Command::Report => self.report()?,
            Command::Quit => self.quit = true,
            Command::Camera(index) if index >= self.state.cameras().len() => {
                let expected = format!("a camera from 0 to {}", self.state.cameras().len().saturating_sub(1));
                return Err(lexisplat::Error::parameter("camera", index, expected).into());
            }
            command => self.state.apply(&command),
        }
        Ok(())
    }

    fn next_id(&mut self) -> u64 {
        self.last_id += 1;
        self.last_id
    }

    fn open(&mut self, path: PathBuf, slot: Slot) {
        let id = self.next_id();
        let job = models::open(id, slot, path, self.options.limits, self.orbit_size(), self.notifier.clone());
        self.jobs[slot.index()] = Some(job);
    }

    /// Opens dropped files. Two scenes become both models. One scene becomes the first model if `first` or if none
    /// is open, else the second. A JSON file is read as cameras.
    fn take_dropped(&mut self, paths: Vec<PathBuf>, first: bool) -> Result<()> {
        let is_json = |path: &PathBuf| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        let (cameras, scenes): (Vec<PathBuf>, Vec<PathBuf>) = paths.into_iter().partition(is_json);
        if let [one] = scenes.as_slice() {
            let opened = self.models[0].is_some() || self.jobs[0].is_some();
            let slot = if first || !opened { Slot::First } else { Slot::Second };
            self.open(one.clone(), slot);
        } else {
            for (path, slot) in scenes.into_iter().zip(Slot::BOTH) {
                self.open(path, slot);
            }
        }
        if let Some(path) = cameras.first() {
            let Options { max_width, near, .. } = self.options;
            self.given = Some(GivenCameras::read(path, SplitFilter::All, max_width, near)?);
            self.reset_cameras();
            self.show_message(format!("cameras of {}", path.display()));
        }
        Ok(())
    }

    fn compress(&mut self, quality: Quality) -> Result<()> {
        let Some(original) = self.models[0].clone().filter(|model| model.splats().is_some()) else {
            let expected = "the first model to be a PLY";
            return Err(lexisplat::Error::parameter("compress", quality, expected).into());
        };
        let id = self.next_id();
        let cameras = self.given_cameras(&original)?.filter(|cameras| cameras.len() > 1);
        let size = self.orbit_size();
        let job = models::compress_to(id, original, quality, cameras, size, self.notifier.clone());
        self.jobs[Slot::Second.index()] = Some(job);
        Ok(())
    }

    fn swap(&mut self) {
        // A running job keeps the slot for which it was started.
        if self.jobs.iter().all(Option::is_none) {
            let [first, second] = self.models.clone();
            self.set_model(Slot::First, second);
            self.set_model(Slot::Second, first);
        }
    }

    fn screenshot(&mut self, file: Option<PathBuf>) -> Result<()> {
        let arrangement = self.state.arrangement();
        let (width, height) = self.area;
        let camera = self.state.screenshot_camera(width, height, self.options.max_width);
        let (Some(camera), Some(models)) = (camera, self.open_ids(arrangement.mode.needs())) else {
            return Err(Error::Device("there is no picture to save yet".to_owned()));
        };
        let file = match file {
            Some(file) if file.exists() && !self.options.overwrite => {
                return Err(Error::Exists(file.display().to_string()));
            }
            Some(file) => file,
            None => free_name(Path::new(&self.picture_name(&camera.name)))?,
        };
        let view = View { camera, options: self.state.options(), models };
        self.render_thread.request(RenderRequest::Screenshot { view, arrangement, file })?;
        self.saving += 1;
        Ok(())
    }

    /// Returns a file name, without a folder, for the picture on screen.
    fn picture_name(&self, camera: &str) -> String {
        let mode = self.state.arrangement().mode;
        let shown = if mode == Mode::One(Slot::Second) { Slot::Second } else { Slot::First };
        let model = self.models[shown.index()].as_ref().map(|m| m.short_name()).unwrap_or_default();
        let model = Path::new(&model).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let camera = Path::new(camera).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let text = match mode {
            Mode::One(_) => format!("{model}_{camera}"),
            mode => format!("{model}_{camera}_{}", mode.name()),
        };
        let safe = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        let text: String = text.chars().map(safe).take(80).collect();
        format!("{text}.png")
    }

    /// Prints the state of the view as a JSON object.
    fn report(&self) -> Result<()> {
        let models: Vec<_> = self
            .models
            .iter()
            .flatten()
            .map(|m| {
                json!({
                    "file": m.scene.name,
                    "bytes": m.scene.bytes,
                    "gaussians": m.gaussians(),
                    "layout": m.layout,
                    "ratio": m.ratio(self.models[0].as_deref()).map(|(ratio, _)| ratio),
                })
            })
            .collect();
        let frame = self.frame.as_ref();
        let score = frame.and_then(|frame| frame.score);
        let camera = frame.map(|frame| &frame.view.camera);
        let value = json!({
            "device": self.render_thread.name,
            "mode": self.state.arrangement().mode.name(),
            "camera": camera.map(|c| &c.name),
            "width": camera.map(|c| c.width),
            "height": camera.map(|c| c.height),
            "milliseconds": frame.map(|frame| frame.milliseconds),
            "drawn": frame.map(|frame| frame.pictures.each_ref().map(|p| p.as_ref().map(|p| p.gaussians))),
            "resident_bytes": frame.map(|frame| frame.resident_bytes),
            "psnr": if let Some(Score::Decibels(db)) = score { Some(db) } else { None },
            "identical": score.map(|score| score == Score::Identical),
            "link": self.state.link(),
            "models": models,
        });
        // A reader that has closed the pipe is not an error.
        let _ = writeln!(std::io::stdout().lock(), "{value}");
        Ok(())
    }

    /// Returns the model of `slot`.
    pub(crate) fn model(&self, slot: Slot) -> Option<&Arc<models::OpenModel>> {
        self.models[slot.index()].as_ref()
    }
}

/// Returns `path`, or `path` with a number before its extension if the file exists.
fn free_name(path: &Path) -> Result<PathBuf> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let extension = path.extension().unwrap_or_default().to_string_lossy().into_owned();
    let numbered = (2..MOST_NAMES).map(|n| path.with_file_name(format!("{stem}-{n}.{extension}")));
    let mut names = std::iter::once(path.to_owned()).chain(numbered);
    names.find(|name| !name.exists()).ok_or_else(|| Error::Exists(path.display().to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_use_are_skipped() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.b.png");
        assert_eq!(free_name(&path).unwrap(), path);
        std::fs::write(&path, "").unwrap();
        assert_eq!(free_name(&path).unwrap(), folder.path().join("a.b-2.png"));
        std::fs::write(folder.path().join("a.b-2.png"), "").unwrap();
        assert_eq!(free_name(&path).unwrap(), folder.path().join("a.b-3.png"));
    }
}
