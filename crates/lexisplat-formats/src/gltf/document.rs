//! The members of a glTF's JSON that tell where splats are.

use std::borrow::Cow;
use std::collections::BTreeMap;

use lexisplat::{Error, Limits, Result};
use serde::{Deserialize, Serialize};

/// Largest text that counts as part of the header, in bytes. Longer texts are data in base64.
const LONG_TEXT: usize = 1024;

/// The members of a glTF that are read. All others are ignored.
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Document<'a> {
    pub(super) asset: Asset,
    pub(super) extensions_required: Vec<String>,
    pub(super) scene: Option<usize>,
    pub(super) scenes: Vec<Scene>,
    pub(super) nodes: Vec<Node>,
    pub(super) meshes: Vec<Mesh>,
    pub(super) accessors: Vec<AccessorEntry>,
    pub(super) buffer_views: Vec<BufferView>,
    #[serde(borrow)]
    pub(super) buffers: Vec<BufferEntry<'a>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Asset {
    pub(super) version: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Scene {
    pub(super) nodes: Vec<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    pub(super) children: Vec<usize>,
    pub(super) mesh: Option<usize>,
    /// Entries column by column.
    pub(super) matrix: Option<Box<[f64; 16]>>,
    pub(super) translation: Option<[f64; 3]>,
    /// Quaternion (x, y, z, w).
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Mesh {
    pub(super) primitives: Vec<Primitive>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Primitive {
    pub(super) attributes: BTreeMap<String, usize>,
    pub(super) mode: Option<u32>,
    pub(super) extensions: PrimitiveExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct PrimitiveExtensions {
    #[serde(rename = "KHR_gaussian_splatting")]
    pub(super) splatting: Option<Splatting>,
    /// Compression in the form of the first drafts.
    #[serde(rename = "KHR_spz_gaussian_splats_compression", alias = "KHR_spz_compression")]
    pub(super) draft: Option<Compressed>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Splatting {
    pub(super) kernel: Option<String>,
    pub(super) color_space: Option<String>,
    pub(super) projection: Option<String>,
    pub(super) sorting_method: Option<String>,
    pub(super) extensions: SplattingExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct SplattingExtensions {
    #[serde(
        rename = "KHR_gaussian_splatting_compression_spz_2",
        alias = "KHR_gaussian_splatting_compression_spz"
    )]
    pub(super) spz: Option<Compressed>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Compressed {
    pub(super) buffer_view: usize,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct AccessorEntry {
    pub(super) buffer_view: Option<usize>,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: u64,
    #[serde(rename = "type")]
    pub(super) shape: Shape,
    pub(super) sparse: Option<serde::de::IgnoredAny>,
}

/// Number of values of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
pub(super) enum Shape {
    #[serde(rename = "SCALAR")]
    Scalar,
    #[serde(rename = "VEC3")]
    Vec3,
    #[serde(rename = "VEC4")]
    Vec4,
    #[serde(other)]
    Other,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    pub(super) byte_stride: Option<u64>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferEntry<'a> {
    #[serde(borrow)]
    pub(super) uri: Option<Cow<'a, str>>,
    pub(super) byte_length: u64,
}

/// Returns the number of bytes of `json` outside of texts that are longer than [`LONG_TEXT`].
fn structure(json: &[u8]) -> u64 {
    let (mut bytes, mut start) = (0, None::<usize>);
    let mut at = 0;
    while let Some(&byte) = json.get(at) {
        match (byte, start) {
            (b'"', None) => start = Some(at),
            (b'"', Some(first)) => {
                let length = at + 1 - first;
                bytes += if length > LONG_TEXT { 0 } else { length };
                start = None;
            }
            (b'\\', Some(_)) => at += 1,
            (_, None) => bytes += 1,
            _ => {}
        }
        at += 1;
    }
    bytes as u64
}

impl<'a> Document<'a> {
    /// Reads the `json` of the file called `name`. Ignored members may be nested to any depth, because they are skipped
    /// without recursion.
    ///
    /// # Errors
    /// [`Error::Limit`] for more JSON than the limits allow, without the texts of data; [`Error::Format`] for JSON that
    /// is not a glTF.
    pub(super) fn parse(name: &str, json: &'a [u8], limits: &Limits) -> Result<Self> {
        limits.check_header(name, structure(json))?;
        let document: Self = serde_json::from_slice(json)
            .map_err(|error| Error::malformed(name, format!("the JSON of a glTF: {error}")))?;
        let version: String = document.asset.version.chars().take(LONG_TEXT).collect();
        if version.split('.').next() != Some("2") {
            let text = format!("asset.version is '{}', and 2.0 is read", version.escape_debug());
            return Err(Error::malformed(name, text));
        }
        Ok(document)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_do_not_count_as_header() {
        let long = "A".repeat(2 * LONG_TEXT);
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"x":"a\"b","buffers":[{{"byteLength":1,"uri":"{long}"}}]}}"#
        );
        assert_eq!(structure(json.as_bytes()), (json.len() - long.len() - 2) as u64);
        let limits = Limits::default().with_header_bytes(1000);
        let document = Document::parse("a", json.as_bytes(), &limits).unwrap();
        assert_eq!(document.buffers[0].uri.as_deref(), Some(&*long));
        let refused = Document::parse("a", json.as_bytes(), &limits.with_header_bytes(10)).unwrap_err();
        assert!(matches!(refused, Error::Limit { limit: 10, .. }), "{refused}");
    }

    #[test]
    fn other_versions_are_refused_and_deep_nesting_does_no_harm() {
        let limits = Limits::default();
        for json in [r#"{"asset":{"version":"1.0"}}"#, "{}", r#"{"asset":{"version":"20"}}"#] {
            let error = Document::parse("a", json.as_bytes(), &limits).unwrap_err().to_string();
            assert!(error.contains("asset.version"), "{error}");
        }
        let (open, close) = ("[".repeat(500_000), "]".repeat(500_000));
        let deep = [r#"{"asset":{"version":"2.0"},"extras":"#, &open, &close, "}"].concat();
        assert!(Document::parse("a", deep.as_bytes(), &limits).is_ok());
        let deep = deep.replace("extras", "nodes");
        assert!(Document::parse("a", deep.as_bytes(), &limits).is_err());
    }
}
