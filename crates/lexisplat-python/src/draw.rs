//! Draws pictures of scenes, and compares two scenes.

use std::borrow::Cow;
use std::sync::Arc;

use lexisplat::{Model, Offset, ShDegree, Splats};
use lexisplat_compress::{DEFAULT_MAX_WIDTH, DrawOptions, draw_views, judging_views};
use lexisplat_eval::{Comparison, compare as compare_scenes};
use lexisplat_render::{Device, Image, Renderer, Scene as Drawable};
use numpy::{PyArray1, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::arrays::finite_from_python;
use crate::cameras::{CameraTuple, cameras};
use crate::errors::{Result, raise};
use crate::files::json;
use crate::scene::{Held, Scene};
use crate::work::without_gil;

/// A scene from Python, which may not be decoded yet.
pub(crate) enum Subject {
    Dense(Box<Splats>),
    Held(Arc<Held>),
}

/// A scene that can be drawn.
pub(crate) enum Resolved {
    Dense(Box<Splats>),
    Sparse(Arc<Model>),
}

impl Subject {
    /// Returns the scene in `given`: a compressed scene, or an object with the attributes of `Splats`, all of them
    /// finite.
    pub(crate) fn of(given: &Bound<'_, PyAny>) -> PyResult<Self> {
        Self::dropping(given, false, &mut Vec::new())
    }

    /// Returns the scene in `given`, like [`Self::of`]. If `drop_invalid` is set, Gaussians with other values are left
    /// out, and a message with their number is added to `told`.
    fn dropping(given: &Bound<'_, PyAny>, drop_invalid: bool, told: &mut Vec<String>) -> PyResult<Self> {
        match given.cast::<Scene>() {
            Ok(scene) => Ok(Self::Held(Arc::clone(&scene.get().held))),
            Err(_) => Ok(Self::Dense(Box::new(finite_from_python(given, drop_invalid, told)?))),
        }
    }

    pub(crate) fn resolved(self) -> Result<Resolved> {
        Ok(match self {
            Self::Dense(splats) => Resolved::Dense(splats),
            Self::Held(held) => Resolved::Sparse(held.model()?),
        })
    }
}

impl Resolved {
    pub(crate) fn scene(&self) -> Drawable<'_> {
        match self {
            Self::Dense(splats) => Drawable::from(&**splats),
            Self::Sparse(model) => Drawable::from(&**model),
        }
    }

    /// Returns the offset to which positions are relative.
    pub(crate) fn offset(&self) -> Option<Offset> {
        self.scene().meta().offset
    }

    /// Makes positions relative to `offset`. The scene stays in place.
    fn rebase(&mut self, offset: Option<Offset>) {
        if self.offset() == offset {
            return;
        }
        match self {
            Self::Dense(splats) => drop(splats.rebase(offset)),
            Self::Sparse(model) => Arc::make_mut(model).rebase(offset),
        }
    }

    /// Returns the scene with dense SH.
    pub(crate) fn dense(&self) -> Cow<'_, Splats> {
        match self {
            Self::Dense(splats) => Cow::Borrowed(splats),
            Self::Sparse(model) => Cow::Owned(Model::clone(model).into_splats()),
        }
    }
}

/// Returns the device named by `text`.
pub(crate) fn device(py: Python<'_>, text: &str) -> PyResult<Device> {
    text.parse().map_err(|error: lexisplat_render::Error| raise(py, &error.into()))
}

/// Pictures as arrays of (height, width, 3).
type Pictures<'py> = Vec<Bound<'py, PyArray3<f32>>>;

/// Draws the scene from each camera. Returns arrays of (height, width, 3), and warnings.
#[pyfunction]
#[pyo3(signature = (scene, views, *, background, max_degree, device_name, drop_invalid, progress))]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(crate) fn render<'py>(
    py: Python<'py>,
    scene: &Bound<'py, PyAny>,
    views: Vec<CameraTuple>,
    background: [f32; 3],
    max_degree: Option<u8>,
    device_name: &str,
    drop_invalid: bool,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Pictures<'py>, Vec<String>)> {
    let mut told = Vec::new();
    let device = device(py, device_name)?;
    let subject = Subject::dropping(scene, drop_invalid, &mut told)?;
    let degree = max_degree.map(ShDegree::new).transpose().map_err(|error| raise(py, &error.into()))?;
    let images = without_gil(py, progress, move |watch| {
        let resolved = subject.resolved()?;
        let views = cameras(views, resolved.offset());
        let options = DrawOptions::new(background, false).with_max_degree(degree);
        draw_views(&mut Renderer::open(device)?, &resolved.scene(), &views, &options, watch)
    })?;
    Ok((images.into_iter().map(|image| picture(py, image)).collect::<PyResult<_>>()?, told))
}

fn picture(py: Python<'_>, image: Image) -> PyResult<Bound<'_, PyArray3<f32>>> {
    let shape = [image.height as usize, image.width as usize, 3];
    PyArray1::from_vec(py, image.pixels.into_flattened()).reshape(shape)
}

/// Scores scene `b` against `a` view by view. Returns the scores as JSON, and warnings. Without views a search finds
/// views like photographs.
#[pyfunction]
#[pyo3(signature = (a, b, views, *, count, background, eight_bit, device_name, drop_invalid, progress))]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(crate) fn compare<'py>(
    py: Python<'py>,
    a: &Bound<'py, PyAny>,
    b: &Bound<'py, PyAny>,
    views: Option<Vec<CameraTuple>>,
    count: usize,
    background: [f32; 3],
    eight_bit: bool,
    device_name: &str,
    drop_invalid: bool,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<(String, Vec<String>)> {
    let (device, mut told) = (device(py, device_name)?, Vec::new());
    let a = Subject::dropping(a, drop_invalid, &mut told)?;
    let b = Subject::dropping(b, drop_invalid, &mut told)?;
    let found: Comparison = without_gil(py, progress, move |watch| {
        let (a, mut b) = (a.resolved()?, b.resolved()?);
        b.rebase(a.offset());
        let mut renderer = Renderer::open(device)?;
        let views = match views {
            Some(views) => cameras(views, a.offset()),
            None => {
                let found = judging_views(&mut renderer, &a.dense(), count, watch)?;
                found.iter().map(|camera| camera.with_max_width(DEFAULT_MAX_WIDTH)).collect()
            }
        };
        let options = DrawOptions::new(background, eight_bit);
        let (a, b) = (a.scene(), b.scene());
        compare_scenes(&mut renderer, &a, &b, &views, &options, watch, |_, _, _| {
            Ok::<(), lexisplat_compress::Error>(())
        })
    })?;
    Ok((json(py, &found)?, told))
}
