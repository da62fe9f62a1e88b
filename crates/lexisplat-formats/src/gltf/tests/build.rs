//! Makes glTFs for tests.

use base64::Engine;
use serde_json::{Value, json};

use super::super::glb::{BIN, CHUNK_HEADER, HEADER, JSON, MAGIC, VERSION};

/// A glTF under construction: its JSON and its buffer.
#[derive(Clone)]
pub(super) struct Builder {
    pub(super) json: Value,
    pub(super) bin: Vec<u8>,
}

impl Builder {
    /// A scene of one node that shows mesh 0, without primitives.
    pub(super) fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": []}], "accessors": [], "bufferViews": [], "buffers": [{}],
        });
        Self { json, bin: Vec::new() }
    }

    /// Adds a bufferView of `bytes` and returns its number.
    pub(super) fn view(&mut self, bytes: &[u8]) -> usize {
        let view = json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        self.bin.extend(bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        push(&mut self.json["bufferViews"], view)
    }

    /// Adds an accessor of `count` elements of `shape` in `bytes`, and returns its number.
    pub(super) fn accessor(&mut self, shape: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        let accessor = json!({"bufferView": view, "componentType": component, "count": count, "type": shape});
        push(&mut self.json["accessors"], accessor)
    }

    /// Adds an accessor of floats.
    pub(super) fn floats(&mut self, shape: &str, values: &[f32]) -> usize {
        let width = match shape {
            "VEC4" => 4,
            "VEC3" => 3,
            _ => 1,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(shape, 5126, values.len() / width, &bytes)
    }

    /// Adds a primitive of `count` splats of SH degree `degree` to mesh 0. Splat i is at (i, 2, 3), with sizes 1, 2, 4, a
    /// share of a half, and coefficient k of channel c being 10 k + c.
    pub(super) fn splats(&mut self, count: usize, degree: u8) {
        let many = |values: &[f32]| values.repeat(count);
        let positions: Vec<f32> = (0..count).flat_map(|i| [i as f32, 2.0, 3.0]).collect();
        let mut attributes = json!({
            "POSITION": self.floats("VEC3", &positions),
            "KHR_gaussian_splatting:ROTATION": self.floats("VEC4", &many(&[0.0, 0.0, 0.0, 1.0])),
            "KHR_gaussian_splatting:SCALE": self.floats("VEC3", &many(&[1.0, 2.0, 4.0])),
            "KHR_gaussian_splatting:OPACITY": self.floats("SCALAR", &many(&[0.5])),
        });
        let mut k = 0.0;
        for l in 0..=degree {
            for n in 0..=2 * l {
                let values = self.floats("VEC3", &many(&[k, k + 1.0, k + 2.0]));
                attributes[format!("KHR_gaussian_splatting:SH_DEGREE_{l}_COEF_{n}")] = json!(values);
                k += 10.0;
            }
        }
        let words = json!({"kernel": "ellipse", "colorSpace": "srgb_rec709_display"});
        self.primitive(json!({
            "attributes": attributes, "mode": 0, "extensions": {"KHR_gaussian_splatting": words},
        }));
    }

    /// Adds a primitive to mesh 0.
    pub(super) fn primitive(&mut self, primitive: Value) {
        push(&mut self.json["meshes"][0]["primitives"], primitive);
    }

    /// The first primitive.
    pub(super) fn first(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    /// The accessor of `attribute` of the first primitive.
    pub(super) fn accessor_of(&mut self, attribute: &str) -> &mut Value {
        let index = self.first()["attributes"][attribute].as_u64().unwrap();
        &mut self.json["accessors"][usize::try_from(index).unwrap()]
    }

    /// Replaces the numbers of `attribute` of the first primitive.
    pub(super) fn replace(&mut self, attribute: &str, component: u32, normalized: bool, bytes: &[u8]) {
        let view = self.view(bytes);
        let accessor = self.accessor_of(attribute);
        accessor["bufferView"] = json!(view);
        accessor["componentType"] = json!(component);
        accessor["normalized"] = json!(normalized);
    }

    /// The glb.
    pub(super) fn glb(mut self) -> Vec<u8> {
        self.json["buffers"][0]["byteLength"] = json!(self.bin.len());
        let mut json = self.json.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let length = HEADER + 2 * CHUNK_HEADER + json.len() + self.bin.len();
        let size = |length: usize| u32::try_from(length).unwrap().to_le_bytes();
        let (json_size, bin_size) = (size(json.len()), size(self.bin.len()));
        let header = [MAGIC, &VERSION.to_le_bytes(), &size(length)].concat();
        [&header, &json_size[..], &JSON, &json, &bin_size, &BIN, &self.bin].concat()
    }

    /// The same as JSON with its data inside.
    pub(super) fn gltf(mut self) -> Vec<u8> {
        let data = base64::engine::general_purpose::STANDARD.encode(&self.bin);
        let uri = format!("data:application/octet-stream;base64,{data}");
        self.json["buffers"][0] = json!({"byteLength": self.bin.len(), "uri": uri});
        self.json.to_string().into_bytes()
    }
}

/// Appends to a list, and returns the number of the new entry.
fn push(list: &mut Value, value: Value) -> usize {
    let list = list.as_array_mut().unwrap();
    list.push(value);
    list.len() - 1
}
