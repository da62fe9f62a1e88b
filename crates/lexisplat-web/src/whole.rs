//! Files that are decoded whole: .lexi files of exact layouts.

use lexisplat::{Model, lexi};
use wasm_bindgen::prelude::*;

use crate::chunk::Chunk;
use crate::{header, limits, thrown};

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
    /// An error that tells what is wrong with the bytes.
    #[wasm_bindgen(constructor)]
    pub fn new(name: &str, bytes: &[u8]) -> Result<Self, JsError> {
        let reader = lexi::LexiReader::open(name, bytes, &limits()).map_err(thrown)?;
        let model = reader.model().map_err(thrown)?;
        let fields = [
            ("gaussians", model.len() as u64),
            ("sourceGaussians", model.len() as u64),
            ("degree", model.degree().get() as u64),
            ("bytes", bytes.len() as u64),
            ("atoms", model.dictionary().len() as u64),
            ("chunks", 1),
            ("layers", 1),
        ];
        let header = header::json(reader.layout(), model.meta().antialiased, &fields);
        Ok(Self { header, model: Some(model) })
    }

    /// Returns the facts in the file's header as JSON.
    #[must_use]
    pub fn header(&self) -> String {
        self.header.clone()
    }

    /// Returns the chunk, at the first call only.
    pub fn chunk(&mut self) -> Option<Chunk> {
        self.model.take().map(|model| Chunk::new(model, 0))
    }
}
