//! The bytes of a .lexi file. They are decoded when a decoded form is needed, which is kept.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use lexisplat::lexi::LexiReader;
use lexisplat::{Limits, Model};

use crate::bytes::Bytes;
use crate::errors::Result;

/// The bytes of a .lexi file, and its reader and its model once they were needed.
#[derive(Debug)]
pub(crate) struct Held {
    pub(crate) name: String,
    pub(crate) bytes: Bytes,
    limits: Limits,
    reader: OnceLock<LexiReader<'static>>,
    model: Mutex<Option<Arc<Model>>>,
}

impl Held {
    pub(crate) fn new(name: String, bytes: Bytes, limits: Limits) -> Self {
        let (reader, model) = (OnceLock::new(), Mutex::default());
        Self { name, bytes, limits, reader, model }
    }

    /// Returns the reader. It is kept, because opening it decodes the dictionary and the tables.
    pub(crate) fn reader(&self) -> Result<&LexiReader<'static>> {
        if let Some(reader) = self.reader.get() {
            return Ok(reader);
        }
        let reader = LexiReader::open(self.name.as_str(), self.bytes.clone(), &self.limits)?;
        Ok(self.reader.get_or_init(|| reader))
    }

    /// Returns the decoded file, which is kept.
    pub(crate) fn model(&self) -> Result<Arc<Model>> {
        let mut kept = self.model.lock().unwrap_or_else(PoisonError::into_inner);
        match &*kept {
            Some(model) => Ok(Arc::clone(model)),
            None => {
                let model = Arc::new(self.reader()?.model()?);
                Ok(Arc::clone(kept.insert(model)))
            }
        }
    }
}
