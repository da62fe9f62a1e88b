//! A decoded chunk, given to JavaScript array by array.

use lexisplat::{Indices, Model, Values};
use wasm_bindgen::prelude::*;

/// Gaussians that were decoded together. Each array is a copy; JavaScript hands it from a worker without another one.
#[wasm_bindgen]
#[derive(Debug)]
pub struct Chunk {
    model: Model,
    first: usize,
}

impl Chunk {
    pub(crate) fn new(model: Model, first: usize) -> Self {
        Self { model, first }
    }

    /// The decoded Gaussians.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }
}

#[wasm_bindgen]
impl Chunk {
    /// Number of Gaussians.
    #[wasm_bindgen(getter)]
    #[must_use]
    pub fn count(&self) -> usize {
        self.model.len()
    }

    /// The place of the first Gaussian in the scene.
    #[wasm_bindgen(getter)]
    #[must_use]
    pub fn first(&self) -> usize {
        self.first
    }

    /// Centres, three numbers a Gaussian.
    #[must_use]
    pub fn positions(&self) -> Vec<f32> {
        self.model.geometry().positions.as_flattened().to_vec()
    }

    /// Logarithms of standard deviations, three numbers a Gaussian.
    #[must_use]
    pub fn scales(&self) -> Vec<f32> {
        self.model.geometry().scales.as_flattened().to_vec()
    }

    /// Quaternions w, x, y, z, not always of norm 1.
    #[must_use]
    pub fn rotations(&self) -> Vec<f32> {
        self.model.geometry().rotations.as_flattened().to_vec()
    }

    /// Opacities before the sigmoid.
    #[must_use]
    pub fn opacities(&self) -> Vec<f32> {
        self.model.geometry().opacities.clone()
    }

    /// SH coefficients of degree 0, three numbers a Gaussian.
    #[must_use]
    pub fn dc(&self) -> Vec<f32> {
        self.model.geometry().dc.as_flattened().to_vec()
    }

    /// SH-rest, channel-major for each Gaussian: 45 numbers at degree 3.
    #[must_use]
    pub fn dense(&self) -> Vec<f32> {
        self.model.dense_rest()
    }

    /// Nonzeros of each Gaussian. Those of an escaped Gaussian are 0.
    #[must_use]
    pub fn counts(&self) -> Vec<u8> {
        self.model.codes().counts().to_vec()
    }

    /// The atoms of all nonzeros if the dictionary has at most 256 atoms.
    #[must_use]
    pub fn narrow_indices(&self) -> Option<Vec<u8>> {
        match self.model.codes().indices() {
            Indices::U8(v) => Some(v.clone()),
            Indices::U16(_) => None,
        }
    }

    /// The atoms of all nonzeros if the dictionary has more than 256 atoms.
    #[must_use]
    pub fn wide_indices(&self) -> Option<Vec<u16>> {
        match self.model.codes().indices() {
            Indices::U8(_) => None,
            Indices::U16(v) => Some(v.clone()),
        }
    }

    /// The values of all nonzeros as the bits of half floats, if they are of half precision.
    #[must_use]
    pub fn half_values(&self) -> Option<Vec<u16>> {
        match self.model.codes().values() {
            Values::F16(v) => Some(v.iter().map(|v| v.to_bits()).collect()),
            Values::F32(_) => None,
        }
    }

    /// The values of all nonzeros, if they are of single precision.
    #[must_use]
    pub fn full_values(&self) -> Option<Vec<f32>> {
        match self.model.codes().values() {
            Values::F16(_) => None,
            Values::F32(v) => Some(v.clone()),
        }
    }

    /// The Gaussians that have a row instead of a code, counted from the first of the chunk.
    #[must_use]
    pub fn escapes(&self) -> Vec<u32> {
        self.model.codes().escapes().gaussians.clone()
    }

    /// The rows of those Gaussians.
    #[must_use]
    pub fn escape_rows(&self) -> Vec<f32> {
        self.model.codes().escapes().rows.clone()
    }

    /// The atoms of the dictionary, row by row, channel-major.
    #[must_use]
    pub fn dictionary(&self) -> Vec<f32> {
        self.model.dictionary().as_slice().to_vec()
    }
}
