//! Draws pictures of scenes, and compares two scenes.

use lexisplat::ShDegree;
use lexisplat_compress::{DEFAULT_MAX_WIDTH, DrawOptions, draw_views, judging_views};
use lexisplat_eval::{Comparison, compare as compare_scenes};
use lexisplat_render::{Device, Image, Renderer};
use numpy::{PyArray1, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::cameras::{CameraTuple, cameras};
use crate::errors::raise;
use crate::files::json;
use crate::subject::Subject;
use crate::work::without_gil;

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
