//! A decoded chunk, which JavaScript reads array by array.

use lexisplat::{Indices, Model, Values};
use wasm_bindgen::prelude::*;

/// Gaussians that were decoded together. Each method copies an array. JavaScript passes the array from a worker without
/// another copy.
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

    /// Returns the decoded Gaussians.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }
}

#[wasm_bindgen]
impl Chunk {
    /// Returns the number of Gaussians.
    #[wasm_bindgen(getter)]
    #[must_use]
    pub fn count(&self) -> usize {
        self.model.len()
    }

    /// Returns the index of the first Gaussian in the scene.
    #[wasm_bindgen(getter)]
    #[must_use]
    pub fn first(&self) -> usize {
        self.first
    }

    /// Returns the centres, three numbers for each Gaussian.
    #[must_use]
    pub fn positions(&self) -> Vec<f32> {
        self.model.geometry().positions.as_flattened().to_vec()
    }

    /// Returns the logarithms of standard deviations, three numbers for each Gaussian.
    #[must_use]
    pub fn scales(&self) -> Vec<f32> {
        self.model.geometry().scales.as_flattened().to_vec()
    }

    /// Returns the quaternions w, x, y, z, which need not have norm 1.
    #[must_use]
    pub fn rotations(&self) -> Vec<f32> {
        self.model.geometry().rotations.as_flattened().to_vec()
    }

    /// Returns the opacities before the sigmoid.
    #[must_use]
    pub fn opacities(&self) -> Vec<f32> {
        self.model.geometry().opacities.clone()
    }

    /// Returns the SH coefficients of degree 0, three numbers for each Gaussian.
    #[must_use]
    pub fn dc(&self) -> Vec<f32> {
        self.model.geometry().dc.as_flattened().to_vec()
    }

    /// Returns SH-rest, channel-major for each Gaussian: 45 numbers at degree 3.
    #[must_use]
    pub fn dense(&self) -> Vec<f32> {
        self.model.dense_rest()
    }

    /// Returns the number of nonzeros of each Gaussian. It is 0 for an escaped Gaussian.
    #[must_use]
    pub fn counts(&self) -> Vec<u8> {
        self.model.codes().counts().to_vec()
    }

    /// Returns the atoms of all nonzeros if the dictionary has at most 256 atoms.
    #[must_use]
    pub fn narrow_indices(&self) -> Option<Vec<u8>> {
        match self.model.codes().indices() {
            Indices::U8(v) => Some(v.clone()),
            Indices::U16(_) => None,
        }
    }

    /// Returns the atoms of all nonzeros if the dictionary has more than 256 atoms.
    #[must_use]
    pub fn wide_indices(&self) -> Option<Vec<u16>> {
        match self.model.codes().indices() {
            Indices::U8(_) => None,
            Indices::U16(v) => Some(v.clone()),
        }
    }

    /// Returns the values of all nonzeros as the bits of half floats, if they have half precision.
    #[must_use]
    pub fn half_values(&self) -> Option<Vec<u16>> {
        match self.model.codes().values() {
            Values::F16(v) => Some(v.iter().map(|v| v.to_bits()).collect()),
            Values::F32(_) => None,
        }
    }

    /// Returns the values of all nonzeros, if they have single precision.
    #[must_use]
    pub fn full_values(&self) -> Option<Vec<f32>> {
        match self.model.codes().values() {
            Values::F16(_) => None,
            Values::F32(v) => Some(v.clone()),
        }
    }

    /// Returns the Gaussians that have a row instead of a code, counted from the first Gaussian of the chunk.
    #[must_use]
    pub fn escapes(&self) -> Vec<u32> {
        self.model.codes().escapes().gaussians.clone()
    }

    /// Returns the rows of these Gaussians.
    #[must_use]
    pub fn escape_rows(&self) -> Vec<f32> {
        self.model.codes().escapes().rows.clone()
    }

    /// Returns the atoms of the dictionary, row by row, channel-major.
    #[must_use]
    pub fn dictionary(&self) -> Vec<f32> {
        self.model.dictionary().as_slice().to_vec()
    }
}
