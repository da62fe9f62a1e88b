//! Cameras as tuples of plain values, of which Python makes its `Camera`.

use std::path::PathBuf;

use lexisplat_eval::compression::judging_views;
use lexisplat_render::{Camera, Device, Renderer, Split, orbit as orbit_around, read_views};
use pyo3::prelude::*;

use crate::draw::Subject;
use crate::work::without_gil;

/// Name, width, height, focal lengths, position, rotation from camera to world, and the near plane, `train`, `test` or `None`.
#[derive(FromPyObject, IntoPyObject)]
pub(crate) struct CameraTuple(String, u32, u32, f32, f32, [f32; 3], [[f32; 3]; 3], f32, Option<String>);

impl From<Camera> for CameraTuple {
    fn from(camera: Camera) -> Self {
        let split = camera.split.map(|split| match split {
            Split::Train => "train".to_owned(),
            Split::Test => "test".to_owned(),
        });
        Self(
            camera.name,
            camera.width,
            camera.height,
            camera.fx,
            camera.fy,
            camera.position,
            camera.rotation,
            camera.near,
            split,
        )
    }
}

impl From<CameraTuple> for Camera {
    fn from(CameraTuple(name, width, height, fx, fy, position, rotation, near, split): CameraTuple) -> Self {
        let split = match split.as_deref() {
            Some("train") => Some(Split::Train),
            Some("test") => Some(Split::Test),
            _ => None,
        };
        Self { name, width, height, fx, fy, position, rotation, near, split }
    }
}

/// What the library draws with.
pub(crate) fn cameras(given: Vec<CameraTuple>) -> Vec<Camera> {
    given.into_iter().map(Camera::from).collect()
}

fn tuples(cameras: Vec<Camera>) -> Vec<CameraTuple> {
    cameras.into_iter().map(CameraTuple::from).collect()
}

/// Reads cameras of any kind. Returns them and warnings.
#[pyfunction]
pub(crate) fn read_cameras(py: Python<'_>, path: PathBuf) -> PyResult<(Vec<CameraTuple>, Vec<String>)> {
    let set = without_gil(py, None, move |_| Ok(read_views(path, &mut |_| None)?))?;
    Ok((tuples(set.cameras), set.warnings))
}

/// Cameras on a circle around the scene.
#[pyfunction]
pub(crate) fn orbit(
    scene: &Bound<'_, PyAny>,
    count: usize,
    width: u32,
    height: u32,
) -> PyResult<Vec<CameraTuple>> {
    let subject = Subject::of(scene)?;
    let views = without_gil(scene.py(), None, move |_| {
        let subject = subject.resolved()?;
        Ok(orbit_around(subject.scene().geometry(), count, width, height))
    })?;
    Ok(tuples(views))
}

/// Views of the scene that are like photographs, as those that judge what is compressed without cameras.
#[pyfunction]
#[pyo3(signature = (scene, count, *, progress))]
pub(crate) fn photographs(
    scene: &Bound<'_, PyAny>,
    count: usize,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<CameraTuple>> {
    let subject = Subject::of(scene)?;
    let views = without_gil(scene.py(), progress, move |watch| {
        let mut renderer = Renderer::open(Device::Cpu)?;
        judging_views(&mut renderer, &subject.resolved()?.dense(), count, watch)
    })?;
    Ok(tuples(views))
}
