//! Training and test views.

use lexisplat_render::{Camera, Split};
use serde::Deserialize;

use crate::error::{Error, Result};

/// Period of test views in sources without a split: every 8th camera in the order of names is a test view, beginning with
/// the first. This is the convention of the field (INRIA `scene/dataset_readers.py`, `llffhold`).
pub const DEFAULT_HOLD: usize = 8;

/// The views of a source that are to be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SplitFilter {
    /// All views.
    #[default]
    All,
    /// Views marked `train`. If no view is marked with a split: views that are not held out as test views.
    Train,
    /// Views marked `test`. If no view is marked with a split: views that are held out as test views.
    Test,
}

impl SplitFilter {
    fn wanted(self) -> Option<Split> {
        match self {
            Self::All => None,
            Self::Train => Some(Split::Train),
            Self::Test => Some(Split::Test),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Train => "train",
            Self::Test => "test",
        }
    }

    fn none_left(self, of: usize) -> Error {
        let expected = match self {
            Self::All => "cameras, of which there are none".to_owned(),
            _ => format!("a split that some of the {of} cameras belong to"),
        };
        Error::parameter("split", self.name(), expected)
    }
}

/// Returns the cameras that `filter` lets through, at least one, in their order. If no camera is marked, every `hold`-th
/// camera in the order of names counts as a test camera, and the others as training cameras.
pub(super) fn filter(mut cameras: Vec<Camera>, filter: SplitFilter, hold: usize) -> Result<Vec<Camera>> {
    if hold == 0 {
        return Err(Error::parameter("hold", hold, "1 or more"));
    }
    let count = cameras.len();
    if let Some(wanted) = filter.wanted() {
        if cameras.iter().all(|camera| camera.split.is_none()) {
            mark(&mut cameras, hold);
        }
        cameras.retain(|camera| camera.split == Some(wanted));
    }
    if cameras.is_empty() { Err(filter.none_left(count)) } else { Ok(cameras) }
}

/// Returns generated cameras if `filter` lets all cameras through. Generated cameras have no split.
pub(super) fn unmarked(cameras: Vec<Camera>, filter: SplitFilter) -> Result<Vec<Camera>> {
    if cameras.is_empty() || filter != SplitFilter::All {
        return Err(filter.none_left(cameras.len()));
    }
    Ok(cameras)
}

/// Returns the cameras that are marked as cameras of `split`, or all cameras if none is.
#[must_use]
pub fn marked(cameras: &[Camera], split: Split) -> Vec<&Camera> {
    let wanted = |camera: &&Camera| camera.split == Some(split);
    let any = cameras.iter().any(|camera| wanted(&camera));
    cameras.iter().filter(|camera| !any || wanted(camera)).collect()
}

fn mark(cameras: &mut [Camera], hold: usize) {
    let mut sorted: Vec<&mut Camera> = cameras.iter_mut().collect();
    sorted.sort_by(|a, b| a.name.cmp(&b.name));
    for (index, camera) in sorted.into_iter().enumerate() {
        camera.split = Some(if index % hold == 0 { Split::Test } else { Split::Train });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cameras(names: &[&str]) -> Vec<Camera> {
        let camera = |name: &&str| Camera {
            name: (*name).into(),
            width: 8,
            height: 8,
            fx: 8.0,
            fy: 8.0,
            position: [0.0; 3],
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            near: 0.2,
            split: None,
            tiles: None,
            background: None,
        };
        names.iter().map(camera).collect()
    }

    fn names(cameras: Vec<Camera>) -> Vec<String> {
        cameras.into_iter().map(|camera| camera.name).collect()
    }

    #[test]
    fn unmarked_cameras_are_held_out_by_name() {
        let all = cameras(&["d", "c", "b", "a", "e"]);
        assert_eq!(names(filter(all.clone(), SplitFilter::Test, 3).unwrap()), ["d", "a"]);
        assert_eq!(names(filter(all.clone(), SplitFilter::Train, 3).unwrap()), ["c", "b", "e"]);
        assert_eq!(filter(all.clone(), SplitFilter::All, 3).unwrap(), all);
        assert_eq!(names(filter(all.clone(), SplitFilter::Test, DEFAULT_HOLD).unwrap()), ["a"]);
        assert!(filter(all.clone(), SplitFilter::Train, 1).is_err());
        assert!(filter(all, SplitFilter::All, 0).is_err());
    }

    #[test]
    fn marks_win() {
        let mut all = cameras(&["a", "b", "c"]);
        assert_eq!(marked(&all, Split::Test).len(), 3);
        all[1].split = Some(Split::Test);
        assert_eq!(marked(&all, Split::Test), [&all[1]]);
        assert_eq!(marked(&all, Split::Train).len(), 3);
        assert_eq!(names(filter(all.clone(), SplitFilter::Test, 8).unwrap()), ["b"]);
        let message = filter(all.clone(), SplitFilter::Train, 8).unwrap_err().to_string();
        assert_eq!(message, "split = train: a split that some of the 3 cameras belong to");
        assert_eq!(filter(all, SplitFilter::All, 8).unwrap().len(), 3);
        assert!(filter(Vec::new(), SplitFilter::All, 8).is_err());
        assert!(unmarked(cameras(&["a"]), SplitFilter::Test).is_err());
        assert!(unmarked(cameras(&["a"]), SplitFilter::All).is_ok());
    }
}
