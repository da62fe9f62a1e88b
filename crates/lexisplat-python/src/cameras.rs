//! Cameras as tuples of plain values, which Python converts to its `Camera`.

use std::path::PathBuf;

use lexisplat::Offset;
use lexisplat_compress::judging_views;
use lexisplat_render::{Camera, Device, Renderer, Split, orbit as orbit_around, read_views};
use pyo3::prelude::*;

use crate::subject::Subject;
use crate::work::without_gil;

/// Name, width, height, focal lengths along x and y, position in the world, rotation from camera to world, distance of
/// the near plane, and `train`, `test` or `None`.
#[derive(Clone, FromPyObject, IntoPyObject)]
pub(crate) struct CameraTuple(String, u32, u32, f32, f32, [f64; 3], [[f32; 3]; 3], f32, Option<String>);

impl CameraTuple {
    /// Returns `camera` as a tuple. Its position in the world is `position`.
    fn at(position: [f64; 3], camera: Camera) -> Self {
        let split = camera.split.map(|split| match split {
            Split::Train => "train".to_owned(),
            Split::Test => "test".to_owned(),
        });
        let Camera { name, width, height, fx, fy, rotation, near, .. } = camera;
        Self(name, width, height, fx, fy, position, rotation, near, split)
    }

    /// Returns the camera for a scene whose positions are relative to `offset`.
    fn camera(self, offset: Option<Offset>) -> Camera {
        let Self(name, width, height, fx, fy, position, rotation, near, split) = self;
        let numbers = Offset::numbers(offset);
        #[expect(clippy::cast_possible_truncation, reason = "what is drawn is in single precision")]
        let position = [0, 1, 2].map(|k| (position[k] - numbers[k]) as f32);
        let split = match split.as_deref() {
            Some("train") => Some(Split::Train),
            Some("test") => Some(Split::Test),
            _ => None,
        };
        Camera { name, width, height, fx, fy, position, rotation, near, split, tiles: None, background: None }
    }
}

/// Returns the cameras for a scene whose positions are relative to `offset`.
pub(crate) fn cameras(given: Vec<CameraTuple>, offset: Option<Offset>) -> Vec<Camera> {
    given.into_iter().map(|camera| camera.camera(offset)).collect()
}

/// Returns cameras of a scene whose positions are relative to `offset` as tuples, with positions in the world.
fn tuples(cameras: Vec<Camera>, offset: Option<Offset>) -> Vec<CameraTuple> {
    let numbers = Offset::numbers(offset);
    let of = |camera: Camera| {
        CameraTuple::at([0, 1, 2].map(|k| f64::from(camera.position[k]) + numbers[k]), camera)
    };
    cameras.into_iter().map(of).collect()
}

/// Reads cameras of any format. Returns the cameras and warnings.
#[pyfunction]
pub(crate) fn read_cameras(py: Python<'_>, path: PathBuf) -> PyResult<(Vec<CameraTuple>, Vec<String>)> {
    let set = without_gil(py, None, move |_| Ok(read_views(path, &mut |_| None)?))?;
    let placed = set.positions.into_iter().zip(set.cameras);
    Ok((placed.map(|(position, camera)| CameraTuple::at(position, camera)).collect(), set.warnings))
}

/// Returns cameras on a circle around the scene.
#[pyfunction]
pub(crate) fn orbit(
    scene: &Bound<'_, PyAny>,
    count: usize,
    width: u32,
    height: u32,
) -> PyResult<Vec<CameraTuple>> {
    let subject = Subject::of(scene)?;
    without_gil(scene.py(), None, move |_| {
        let subject = subject.resolved()?;
        let scene = subject.scene();
        Ok(tuples(orbit_around(scene.geometry(), count, width, height), scene.meta().offset))
    })
}

/// Returns views of the scene that are like photographs. Views of this kind judge scenes that are compressed without
/// cameras.
#[pyfunction]
#[pyo3(signature = (scene, count, *, progress))]
pub(crate) fn photographs(
    scene: &Bound<'_, PyAny>,
    count: usize,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<CameraTuple>> {
    let subject = Subject::of(scene)?;
    without_gil(scene.py(), progress, move |watch| {
        let mut renderer = Renderer::open(Device::Cpu)?;
        let subject = subject.resolved()?;
        let views = judging_views(&mut renderer, &subject.dense(), count, watch)?;
        Ok(tuples(views, subject.scene().meta().offset))
    })
}
