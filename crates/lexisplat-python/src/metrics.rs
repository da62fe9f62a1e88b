//! Scores of pictures.

use std::collections::BTreeMap;

use lexisplat::Limits;
use lexisplat_eval::Scorer;
use lexisplat_eval::metrics::{Lpips, Metric, outside};
use lexisplat_render::Image;
use numpy::{PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::bytes::Given;
use crate::errors::parameter;
use crate::work::without_gil;

/// Scores by name, and for each picture its smallest and largest value if one of them is outside of 0..1.
type Scores = (BTreeMap<&'static str, f64>, [Option<[f32; 2]>; 2]);

/// Scores picture `b` against `a`, both arrays of (height, width, 3). PSNR is missing if the pictures are identical.
#[pyfunction]
#[pyo3(signature = (a, b, *, flip, lpips))]
pub(crate) fn score(
    py: Python<'_>,
    a: PyReadonlyArray3<'_, f32>,
    b: PyReadonlyArray3<'_, f32>,
    flip: bool,
    lpips: Option<Given>,
) -> PyResult<Scores> {
    let (a, b) = (image(py, &a)?, image(py, &b)?);
    without_gil(py, None, move |_| {
        let mut scorer = Scorer::new();
        if flip {
            scorer = scorer.with_flip();
        }
        if let Some(weights) = lpips {
            let name = weights.name();
            let bytes = weights.bytes(&Limits::default())?;
            scorer = scorer.with_lpips(Lpips::from_bytes(&name, bytes.as_ref())?);
        }
        let score = scorer.score("pictures", &a, &b)?;
        let scores = Metric::ALL.iter().filter_map(|&metric| Some((metric.name(), score.get(metric)?)));
        Ok((scores.collect(), [outside(&a), outside(&b)]))
    })
}

fn image(py: Python<'_>, pixels: &PyReadonlyArray3<'_, f32>) -> PyResult<Image> {
    let [height, width, 3] = *pixels.shape() else {
        return Err(parameter(
            py,
            "picture",
            format!("{:?}", pixels.shape()),
            "an array of (height, width, 3)",
        ));
    };
    let (Ok(width), Ok(height)) = (u32::try_from(width), u32::try_from(height)) else {
        return Err(parameter(py, "picture", format!("{width} x {height}"), "sides below 2^32"));
    };
    let values: Vec<f32> = pixels.as_array().iter().copied().collect();
    Ok(Image { width, height, pixels: values.as_chunks().0.to_vec() })
}
