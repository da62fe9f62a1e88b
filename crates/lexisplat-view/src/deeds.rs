//! What commands do beyond the state: files, jobs, pictures.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use lexisplat_render::read_cameras;
use serde_json::json;

use crate::app::App;
use crate::command::{Command, Mode, Quality, Which};
use crate::error::{Error, Result};
use crate::models;
use crate::painting::{Ask, Score, View};

/// Most pictures that may have the same name but for a number.
const MOST_NAMES: u32 = 100_000;

impl App {
    /// Does what `command` asks; failures appear in the panel.
    pub(crate) fn perform(&mut self, command: Command) {
        if let Err(error) = self.attempt(command) {
            self.complain(error);
        }
    }

    fn attempt(&mut self, command: Command) -> Result<()> {
        match command {
            Command::Open(path, which) => self.open(path, which),
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

    fn open(&mut self, path: PathBuf, which: Which) {
        let id = self.next_id();
        let work = models::open(id, which, path, self.options.limits, self.orbit_size(), self.bell.clone());
        self.works[which.index()] = Some(work);
    }

    /// Takes dropped files: two scenes become both models; one the second, or the first if none is open or
    /// that is wanted. A JSON file is cameras.
    fn take_dropped(&mut self, paths: Vec<PathBuf>, first: bool) -> Result<()> {
        let is_json = |path: &PathBuf| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        let (cameras, scenes): (Vec<PathBuf>, Vec<PathBuf>) = paths.into_iter().partition(is_json);
        if let [one] = scenes.as_slice() {
            let opened = self.models[0].is_some() || self.works[0].is_some();
            let which = if first || !opened { Which::First } else { Which::Second };
            self.open(one.clone(), which);
        } else {
            for (path, which) in scenes.into_iter().zip(Which::BOTH) {
                self.open(path, which);
            }
        }
        if let Some(path) = cameras.first() {
            let width = self.options.max_width.max(1);
            let cameras = read_cameras(path)?.iter().map(|c| c.with_max_width(width)).collect();
            self.given = Some(cameras);
            self.surround();
            self.say(format!("cameras of {}", path.display()));
        }
        Ok(())
    }

    fn compress(&mut self, quality: Quality) -> Result<()> {
        let Some(original) = self.models[0].clone().filter(|model| model.splats().is_some()) else {
            let expected = "the first model to be a PLY";
            return Err(lexisplat::Error::parameter("compress", quality, expected).into());
        };
        let id = self.next_id();
        let cameras = self.given.clone().filter(|cameras| cameras.len() > 1);
        let size = self.orbit_size();
        let work = models::compress_to(id, original, quality, cameras, size, self.bell.clone());
        self.works[Which::Second.index()] = Some(work);
        Ok(())
    }

    fn swap(&mut self) {
        // Jobs name the place they fill.
        if self.works.iter().all(Option::is_none) {
            let [first, second] = self.models.clone();
            self.put(Which::First, second);
            self.put(Which::Second, first);
        }
    }

    fn screenshot(&mut self, file: Option<PathBuf>) -> Result<()> {
        let arrangement = self.state.arrangement;
        let (width, height) = self.area;
        let camera = self.state.screenshot_camera(width, height, self.options.max_width);
        let needs = arrangement.mode.needs();
        let models: [Option<u64>; 2] =
            [0, 1].map(|i| self.models[i].as_ref().filter(|_| needs[i]).map(|m| m.id));
        let (Some(camera), true) = (camera, models.iter().any(Option::is_some)) else {
            return Err(Error::Device("there is no picture to save yet".to_owned()));
        };
        let file = match file {
            Some(file) if file.exists() && !self.options.overwrite => {
                return Err(Error::Exists(file.display().to_string()));
            }
            Some(file) => file,
            None => free_name(Path::new(&self.picture_name(&camera.name)))?,
        };
        let view = View { camera, options: self.state.options, models };
        self.painting.ask(Ask::Screenshot { view, arrangement, file })?;
        self.saving += 1;
        Ok(())
    }

    /// A file name without folder for the picture on screen.
    fn picture_name(&self, camera: &str) -> String {
        let mode = self.state.arrangement.mode;
        let shown = if mode == Mode::One(Which::Second) { Which::Second } else { Which::First };
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

    /// Prints what is shown.
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
        let shot = self.shot.as_ref();
        let score = shot.and_then(|shot| shot.score);
        let camera = shot.map(|shot| &shot.view.camera);
        let value = json!({
            "device": self.painting.name,
            "mode": self.state.arrangement.mode.name(),
            "camera": camera.map(|c| &c.name),
            "width": camera.map(|c| c.width),
            "height": camera.map(|c| c.height),
            "milliseconds": shot.map(|shot| shot.milliseconds),
            "drawn": shot.map(|shot| shot.pictures.each_ref().map(|p| p.as_ref().map(|p| p.gaussians))),
            "resident_bytes": shot.map(|shot| shot.resident_bytes),
            "psnr": if let Some(Score::Decibels(db)) = score { Some(db) } else { None },
            "identical": score.map(|score| score == Score::Identical),
            "models": models,
        });
        // A reader that has seen enough is no failure.
        let _ = writeln!(std::io::stdout().lock(), "{value}");
        Ok(())
    }

    /// The model shown as `which`.
    pub(crate) fn model(&self, which: Which) -> Option<&Arc<models::Open>> {
        self.models[which.index()].as_ref()
    }
}

/// `path`, or with a number before its extension if there is such a file.
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
    fn names_in_use_are_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.b.png");
        assert_eq!(free_name(&path).unwrap(), path);
        std::fs::write(&path, "").unwrap();
        assert_eq!(free_name(&path).unwrap(), folder.path().join("a.b-2.png"));
        std::fs::write(folder.path().join("a.b-2.png"), "").unwrap();
        assert_eq!(free_name(&path).unwrap(), folder.path().join("a.b-3.png"));
    }
}
