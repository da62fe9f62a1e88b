//! Which cameras a comparison looks through.

use std::path::Path;

use lexisplat::Geometry;
use lexisplat_render::{Camera, Split, orbit, read_cameras};

use crate::error::{Error, Result};

/// Views of an automatic orbit where the caller does not say.
pub const DEFAULT_ORBIT: usize = 12;
/// Largest picture width where the caller does not say, as INRIA's trainer and web-splat have it.
pub const DEFAULT_MAX_WIDTH: u32 = 1600;
/// Width of an orbit's pictures in pixels; less if the cap is lower.
const ORBIT_WIDTH: u32 = 1200;
/// Height of an orbit's pictures at [`ORBIT_WIDTH`].
const ORBIT_HEIGHT: u32 = 900;
/// Of the photos sorted by name, every eighth is held out (INRIA `dataset_readers.py`, `llffhold`).
const HOLD_OUT: usize = 8;

/// Which part of a data set's cameras to use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum SplitFilter {
    /// Every camera.
    #[default]
    All,
    /// Only those the model was trained on.
    Train,
    /// Only those held out.
    Test,
}

impl SplitFilter {
    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Train => "train",
            Self::Test => "test",
        }
    }
}

impl std::fmt::Display for SplitFilter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

impl std::str::FromStr for SplitFilter {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        [Self::All, Self::Train, Self::Test].into_iter().find(|split| split.name() == text).ok_or_else(|| {
            Error::Parameter {
                name: "split",
                value: text.to_owned(),
                expected: "one of all train test".to_owned(),
            }
        })
    }
}

/// The cameras of `path` in the file's order, only those of `split`, pictures at most `max_width` wide.
///
/// Where no camera of the file says which split it is in, INRIA's rule decides: every eighth of the
/// cameras sorted by name, from the first on, is held out.
///
/// # Errors
/// [`Error::Cameras`] if the file cannot be read, [`Error::NoViews`] if no camera is left.
pub fn from_file(path: impl AsRef<Path>, split: SplitFilter, max_width: u32) -> Result<Vec<Camera>> {
    let path = path.as_ref();
    let cameras = read_cameras(path)?;
    let chosen = select(&cameras, split);
    if chosen.is_empty() {
        let advice = if cameras.is_empty() { "" } else { "; try --split all" };
        let file = path.display().to_string();
        return Err(Error::NoViews { file, cameras: cameras.len(), split, advice });
    }
    Ok(chosen.iter().map(|camera| camera.with_max_width(max_width)).collect())
}

/// `count` cameras on a ring fitted to the scene, for scenes without cameras; pictures are 4 : 3, 1200
/// pixels wide or `max_width` if that is less.
#[must_use]
pub fn around(geometry: &Geometry, count: usize, max_width: u32) -> Vec<Camera> {
    let cameras = orbit(geometry, count, ORBIT_WIDTH, ORBIT_HEIGHT);
    cameras.iter().map(|camera| camera.with_max_width(max_width)).collect()
}

/// The cameras of `split`, in order; see [`from_file`].
#[must_use]
pub fn select(cameras: &[Camera], split: SplitFilter) -> Vec<&Camera> {
    let wanted = match split {
        SplitFilter::All => return cameras.iter().collect(),
        SplitFilter::Train => Split::Train,
        SplitFilter::Test => Split::Test,
    };
    if cameras.iter().any(|camera| camera.split.is_some()) {
        return cameras.iter().filter(|camera| camera.split == Some(wanted)).collect();
    }
    let mut order: Vec<usize> = (0..cameras.len()).collect();
    order.sort_by(|&a, &b| cameras[a].name.cmp(&cameras[b].name));
    let mut held_out = vec![false; cameras.len()];
    for &camera in order.iter().step_by(HOLD_OUT) {
        held_out[camera] = true;
    }
    let kept = cameras.iter().zip(held_out).filter(|(_, out)| *out == (wanted == Split::Test));
    kept.map(|(camera, _)| camera).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cameras(count: usize) -> Vec<Camera> {
        let geometry = Geometry {
            positions: vec![[0.0; 3]],
            dc: vec![[0.0; 3]],
            opacities: vec![0.0],
            scales: vec![[0.0; 3]],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]],
            ..Geometry::default()
        };
        around(&geometry, count, 640)
    }

    #[test]
    fn width_is_capped() {
        assert!(cameras(3).iter().all(|c| (c.width, c.height) == (640, 480)));
    }

    #[test]
    fn marks_decide() {
        let mut cameras = cameras(5);
        cameras[1].split = Some(Split::Test);
        cameras[2].split = Some(Split::Train);
        let names = |split| select(&cameras, split).iter().map(|c| c.name.clone()).collect::<Vec<_>>();
        assert_eq!(names(SplitFilter::Test), ["orbit_001"]);
        assert_eq!(names(SplitFilter::Train), ["orbit_002"]);
        assert_eq!(names(SplitFilter::All).len(), 5);
    }

    #[test]
    fn without_marks_every_eighth_name_is_held_out() {
        let mut cameras = cameras(17);
        cameras.reverse();
        let names = |split| select(&cameras, split).iter().map(|c| c.name.clone()).collect::<Vec<_>>();
        assert_eq!(names(SplitFilter::Test), ["orbit_016", "orbit_008", "orbit_000"]);
        assert_eq!(names(SplitFilter::Train).len(), 14);
    }

    #[test]
    fn files_without_the_split_are_refused() {
        let file = std::env::temp_dir().join(format!("lexisplat-views-{}.json", std::process::id()));
        std::fs::write(&file, "[]").unwrap();
        let found = from_file(&file, SplitFilter::Test, 100);
        std::fs::remove_file(&file).unwrap();
        assert!(matches!(found, Err(Error::NoViews { cameras: 0, .. })), "{found:?}");
        assert!("tset".parse::<SplitFilter>().is_err());
        assert_eq!("test".parse::<SplitFilter>().unwrap(), SplitFilter::Test);
    }
}
