//! Files that are decoded whole: .lexi files of exact layouts, and packed ones of version 2.

use lexisplat::{Model, lexi};
use serde_json::json;
use wasm_bindgen::prelude::*;

use crate::chunk::Chunk;
use crate::{limits, thrown};

/// A decoded file of one chunk.
#[wasm_bindgen]
#[derive(Debug)]
pub struct Whole {
    header: String,
    model: Option<Model>,
}

#[wasm_bindgen]
impl Whole {
    /// Decodes the .lexi file in `bytes`. Errors call it `name`.
    ///
    /// # Errors
    /// What is wrong with the bytes.
    #[wasm_bindgen(constructor)]
    pub fn new(name: &str, bytes: &[u8]) -> Result<Self, JsError> {
        let reader = lexi::LexiReader::open(name, bytes, &limits()).map_err(thrown)?;
        let (layout, packed) = (reader.layout().to_string(), reader.packed_head());
        let removed = packed.map_or(0, |head| head.removed);
        let model = reader.model().map_err(thrown)?;
        let header = json!({
            "layout": layout,
            "gaussians": model.len(),
            "sourceGaussians": model.len() as u64 + removed,
            "degree": model.degree().get(),
            "bytes": bytes.len(),
            "atoms": model.dictionary().len(),
            "antialiased": model.meta().antialiased,
            "chunks": 1,
            "layers": 1,
        });
        Ok(Self { header: header.to_string(), model: Some(model) })
    }

    /// What the file says of itself, as JSON.
    #[must_use]
    pub fn header(&self) -> String {
        self.header.clone()
    }

    /// The chunk, once.
    pub fn chunk(&mut self) -> Option<Chunk> {
        self.model.take().map(|model| Chunk::new(model, 0))
    }
}
