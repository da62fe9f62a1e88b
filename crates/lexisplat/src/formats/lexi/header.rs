//! The JSON header of a safetensors file: its metadata, and the positions of its tensors.

use std::ops::Range;

use safetensors::Dtype;

use super::json::Json;
use crate::support::order::order;

/// The member of the header that is not a tensor.
const METADATA: &str = "__metadata__";
/// The types of values that a file may have, by their names (docs/FORMAT.md, "Container").
const DTYPES: [(&str, Dtype); 13] = [
    ("BOOL", Dtype::BOOL),
    ("I8", Dtype::I8),
    ("U8", Dtype::U8),
    ("I16", Dtype::I16),
    ("U16", Dtype::U16),
    ("F16", Dtype::F16),
    ("BF16", Dtype::BF16),
    ("I32", Dtype::I32),
    ("U32", Dtype::U32),
    ("F32", Dtype::F32),
    ("I64", Dtype::I64),
    ("U64", Dtype::U64),
    ("F64", Dtype::F64),
];

/// A tensor of a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TensorInfo {
    pub(super) dtype: Dtype,
    pub(super) shape: Vec<usize>,
    /// The bytes of the tensor, counted from the end of the header.
    pub(super) data_offsets: Range<usize>,
}

/// Tensors that lie one after another, and metadata.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    /// The tensors, sorted by their names.
    tensors: Vec<(String, TensorInfo)>,
    /// The metadata: texts by their names.
    metadata: Json,
}

impl Header {
    /// Reads the JSON `text`. The error is the fault of the text.
    pub(super) fn read(text: &[u8]) -> Result<Self, String> {
        if text.first() != Some(&b'{') {
            return Err(invalid("byte 8 is not '{'"));
        }
        let Json::Object(members) = Json::parse(text).map_err(|e| format!("the header: {e}"))? else {
            return Err(invalid("the header is not an object"));
        };
        let mut header = Self { tensors: Vec::new(), metadata: Json::Object(Vec::new()) };
        for (name, value) in members {
            if name == METADATA {
                let texts = value.members().is_some_and(|all| all.iter().all(|(_, v)| v.text().is_some()));
                match value {
                    Json::Null => {}
                    Json::Object(_) if texts => header.metadata = value,
                    _ => return Err(invalid("metadata that are not texts by their names")),
                }
            } else {
                let tensor = tensor(&value)
                    .map_err(|rule| invalid(&format!("tensor '{}' {rule}", name.escape_debug())))?;
                header.tensors.push((name, tensor));
            }
        }
        header.check()?;
        Ok(header)
    }

    /// Refuses tensors that do not lie one after another, or do not have the length of their shape.
    fn check(&self) -> Result<(), String> {
        let mut last = 0;
        for (name, tensor) in self.by_offset() {
            let Range { start, end } = tensor.data_offsets;
            if start != last || end < start {
                return Err(invalid(&format!("invalid offset for tensor `{name}`")));
            }
            last = end;
            let values = tensor.shape.iter().copied().try_fold(1, usize::checked_mul);
            let bytes = values.and_then(|values| values.checked_mul(tensor.dtype.bitsize() / 8));
            if bytes != Some(end - start) {
                return Err(invalid("invalid shape, data type, or offset for tensor"));
            }
        }
        Ok(())
    }

    /// Returns the number of bytes of all tensors.
    pub(super) fn data_bytes(&self) -> usize {
        self.tensors.iter().map(|(_, tensor)| tensor.data_offsets.end).max().unwrap_or(0)
    }

    pub(super) fn info(&self, name: &str) -> Option<&TensorInfo> {
        let index = self.tensors.binary_search_by(|tensor| tensor.0.as_str().cmp(name)).ok()?;
        self.tensors.get(index).map(|tensor| &tensor.1)
    }

    /// Returns the names of all tensors, sorted.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.tensors.iter().map(|(name, _)| name.as_str())
    }

    /// Returns all tensors in the order in which they lie.
    pub(super) fn by_offset(&self) -> Vec<&(String, TensorInfo)> {
        let start = |k: usize| {
            self.tensors.get(k).map(|(_, tensor)| (tensor.data_offsets.start, tensor.data_offsets.end))
        };
        let sorted = order(self.tensors.len(), &mut |a, b| start(a).cmp(&start(b)));
        sorted.into_iter().filter_map(|k| self.tensors.get(k)).collect()
    }

    /// Returns the metadata entry `key`.
    pub(super) fn text(&self, key: &str) -> Option<&str> {
        self.metadata.get(key)?.text()
    }
}

fn invalid(what: &str) -> String {
    format!("not a valid safetensors file: {what}")
}

/// Reads the entry of a tensor. The error is the broken rule, in words that follow the name of the tensor.
fn tensor(value: &Json) -> Result<TensorInfo, &'static str> {
    let dtype = value.get("dtype").and_then(Json::text).ok_or("is not described")?;
    let (_, dtype) = *DTYPES.iter().find(|(name, _)| *name == dtype).ok_or("has an unknown dtype")?;
    let tensor = || {
        let shape = value.get("shape")?.items()?.iter().map(Json::number).collect::<Option<_>>()?;
        let [start, end] = value.get("data_offsets")?.items()? else { return None };
        Some(TensorInfo { dtype, shape, data_offsets: start.number()?..end.number()? })
    };
    tensor().ok_or("is not described")
}

#[cfg(test)]
mod tests {
    use safetensors::tensor::Metadata;

    use super::*;
    use crate::support::rng::SplitMix64;

    #[test]
    fn types_are_known_by_the_names_of_safetensors() {
        for (name, dtype) in DTYPES {
            assert_eq!(serde_json::to_string(&dtype).unwrap(), format!("\"{name}\""));
        }
    }

    /// Bytes that replace bytes of a header.
    const BYTES: &[u8] = b"0123456789\"{}[],:-.xyzabU8F3216";

    /// [`Header::read`] takes the same headers as the safetensors crate. Only that crate takes headers with a member twice
    /// or with a type that no .lexi file has.
    #[test]
    fn headers_are_read_as_by_safetensors() {
        let text = br#"{"__metadata__":{"a":"b","c":""},"y":{"dtype":"F32","shape":[2,1],"data_offsets":[3,11]},
            "x":{"dtype":"U8","shape":[3],"data_offsets":[0,3]},"z":{"dtype":"U8","shape":[0],"data_offsets":[11,11]}}"#;
        let mut rng = SplitMix64::new(12);
        let (mut taken, mut refused) = (0, 0);
        for round in 0..20_000 {
            let mut text = text.to_vec();
            for _ in 0..rng.below(3).min(round) {
                let at = rng.below(text.len());
                text[at] = BYTES[rng.below(BYTES.len())];
            }
            let shown = String::from_utf8_lossy(&text);
            let other: Result<Metadata, _> = serde_json::from_slice(&text);
            match (Header::read(&text), other) {
                (Ok(own), Ok(other)) => {
                    let mut names: Vec<String> = own.names().map(str::to_owned).collect();
                    let metadata = other.metadata().iter().flatten();
                    assert!(metadata.clone().all(|(key, text)| own.text(key) == Some(text)), "{shown}");
                    for name in &names {
                        let (own, other) = (own.info(name).unwrap(), other.info(name).unwrap());
                        let other = (other.dtype, &other.shape, other.data_offsets.0..other.data_offsets.1);
                        assert_eq!((own.dtype, &own.shape, own.data_offsets.clone()), other, "{shown}");
                    }
                    let mut others = other.offset_keys();
                    names.sort_unstable();
                    others.sort_unstable();
                    assert_eq!(names, others);
                    assert_eq!(own.data_bytes(), other.data_len());
                    taken += 1;
                }
                (Err(_), Err(_)) => refused += 1,
                (Err(error), Ok(_)) => {
                    let is_known =
                        ["is there twice", "has an unknown dtype"].iter().any(|rule| error.contains(rule));
                    assert!(is_known, "{shown}: {error}");
                }
                (Ok(_), Err(error)) => panic!("{shown}: {error}"),
            }
        }
        assert!(taken > 1000 && refused > 1000, "{taken} {refused}");
    }
}
