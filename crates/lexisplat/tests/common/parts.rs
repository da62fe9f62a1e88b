//! .lexi files taken apart and put together again.
#![allow(dead_code, reason = "each test binary uses a part")]

use serde_json::{Map, Value, json};

use crate::common::reseal;

/// A file as its parts, which can be changed and put together again.
#[derive(Clone)]
pub(crate) struct Parts {
    pub(crate) metadata: Map<String, Value>,
    /// Name, type, shape and bytes of each tensor.
    pub(crate) tensors: Vec<(String, Value, Value, Vec<u8>)>,
}

impl Parts {
    pub(crate) fn of(bytes: &[u8]) -> Self {
        let length = usize::try_from(u64::from_le_bytes(*bytes.first_chunk().unwrap())).unwrap();
        let header: Value = serde_json::from_slice(&bytes[8..8 + length]).unwrap();
        let data = &bytes[8 + length..];
        let mut entries = header.as_object().unwrap().clone();
        let metadata = entries.remove("__metadata__").unwrap().as_object().unwrap().clone();
        let tensor = |(name, entry): (String, Value)| {
            let at = |i: usize| usize::try_from(entry["data_offsets"][i].as_u64().unwrap()).unwrap();
            (name, entry["dtype"].clone(), entry["shape"].clone(), data[at(0)..at(1)].to_vec())
        };
        Self { metadata, tensors: entries.into_iter().map(tensor).collect() }
    }

    /// The file, with offsets and checksums that fit.
    pub(crate) fn sealed(&self) -> Vec<u8> {
        let mut header = Map::new();
        let mut data = Vec::new();
        for (name, dtype, shape, bytes) in &self.tensors {
            let start = data.len();
            data.extend_from_slice(bytes);
            let entry = json!({"dtype": dtype, "shape": shape, "data_offsets": [start, data.len()]});
            header.insert(name.clone(), entry);
        }
        header.insert("__metadata__".to_owned(), Value::Object(self.metadata.clone()));
        reseal(&mut Value::Object(header), &mut data)
    }

    /// With an entry of the metadata replaced or added.
    pub(crate) fn with(&self, key: &str, value: &str) -> Self {
        let mut new = self.clone();
        new.metadata.insert(key.to_owned(), Value::from(value));
        new
    }

    /// With another tensor.
    pub(crate) fn and(&self, name: &str, dtype: &str, shape: &[usize], bytes: &[u8]) -> Self {
        let mut new = self.clone();
        new.tensors.push((name.to_owned(), Value::from(dtype), json!(shape), bytes.to_vec()));
        new
    }

    pub(crate) fn tensor(&mut self, name: &str) -> Option<&mut Vec<u8>> {
        self.tensors.iter_mut().find(|t| t.0 == name).map(|t| &mut t.3)
    }

    /// Shapes of lists of bytes that were cut or extended.
    pub(crate) fn fit_shapes(&mut self) {
        for (_, _, shape, bytes) in &mut self.tensors {
            *shape = json!([bytes.len()]);
        }
    }
}
