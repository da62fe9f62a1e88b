//! The JSON of a glTF in the form in which it is written.

use std::collections::BTreeMap;

use lexisplat::Offset;
use serde::Serialize;

use super::document::Shape;
use super::placement::GLTF;

/// `componentType` of floats of 32 bits.
const FLOAT: u32 = 5126;
/// `componentType` of bytes.
const UNSIGNED_BYTE: u32 = 5121;
/// `target` of a bufferView of attributes.
const ARRAY_BUFFER: u32 = 34962;
/// `mode` of a primitive of points.
const POINTS: u32 = 0;

/// A glTF of one primitive of splats.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Root {
    asset: Asset,
    extensions_used: Vec<&'static str>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    extensions_required: Vec<&'static str>,
    scene: usize,
    scenes: [SceneNodes; 1],
    nodes: [Node; 1],
    meshes: [Mesh; 1],
    accessors: Vec<AccessorOut>,
    buffer_views: Vec<BufferViewOut>,
    buffers: [BufferOut; 1],
}

#[derive(Debug, Serialize)]
struct Asset {
    version: &'static str,
    generator: &'static str,
}

#[derive(Debug, Serialize)]
struct SceneNodes {
    nodes: [usize; 1],
}

#[derive(Debug, Serialize)]
struct Node {
    mesh: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    translation: Option<[f64; 3]>,
}

#[derive(Debug, Serialize)]
struct Mesh {
    primitives: [PrimitiveOut; 1],
}

#[derive(Debug, Serialize)]
struct PrimitiveOut {
    attributes: BTreeMap<String, usize>,
    mode: u32,
    extensions: PrimitiveExtensionsOut,
}

#[derive(Debug, Serialize)]
struct PrimitiveExtensionsOut {
    #[serde(rename = "KHR_gaussian_splatting")]
    splatting: SplattingOut,
}

#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct SplattingOut {
    kernel: &'static str,
    color_space: &'static str,
    projection: &'static str,
    sorting_method: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    extensions: Option<SpzOut>,
}

#[derive(Debug, Serialize)]
struct SpzOut {
    #[serde(rename = "KHR_gaussian_splatting_compression_spz_2")]
    spz: SpzBufferView,
}

#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct SpzBufferView {
    buffer_view: usize,
}

#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct AccessorOut {
    #[serde(skip_serializing_if = "Option::is_none")]
    buffer_view: Option<usize>,
    component_type: u32,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    normalized: bool,
    count: usize,
    #[serde(rename = "type")]
    shape: Shape,
    #[serde(skip_serializing_if = "Option::is_none")]
    min: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    max: Option<[f32; 3]>,
}

#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct BufferViewOut {
    buffer: usize,
    byte_offset: usize,
    byte_length: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    target: Option<u32>,
}

#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct BufferOut {
    byte_length: usize,
}

/// An attribute: its name and the type of its numbers.
#[derive(Debug)]
pub(super) struct Attribute {
    pub(super) name: String,
    pub(super) shape: Shape,
    /// Whether numbers are normalised bytes instead of floats.
    pub(super) is_byte: bool,
}

impl Attribute {
    /// Returns the number of bytes of an element.
    pub(super) fn width(&self) -> usize {
        self.shape.numbers() * if self.is_byte { 1 } else { size_of::<f32>() }
    }
}

impl Root {
    /// Moves the splats by `offset`, which is along the axes of a trainer's PLY.
    pub(super) fn set_translation(&mut self, offset: Option<Offset>) {
        let signs = GLTF.map(|change| if change { -1.0 } else { 1.0 });
        let along = |offset: Offset| {
            let numbers = offset.get();
            [0, 1, 2].map(|k| signs[k] * numbers[k])
        };
        for node in &mut self.nodes {
            node.translation = offset.map(along);
        }
    }

    /// Returns the glTF of `count` splats with `attributes`, the first of which are positions within `bounds`. The
    /// attributes lie one after another in the buffer. If there is an SPZ of `spz` bytes, the buffer holds only the SPZ.
    pub(super) fn new(
        count: usize,
        attributes: &[Attribute],
        bounds: [[f32; 3]; 2],
        spz: Option<usize>,
    ) -> Self {
        let mut buffer_views = Vec::new();
        let mut accessors = Vec::with_capacity(attributes.len());
        let mut end = 0;
        if let Some(byte_length) = spz {
            buffer_views.push(BufferViewOut { buffer: 0, byte_offset: 0, byte_length, target: None });
            end = byte_length;
        }
        for (k, attribute) in attributes.iter().enumerate() {
            let buffer_view = spz.is_none().then_some(buffer_views.len());
            if buffer_view.is_some() {
                let byte_length = count * attribute.width();
                buffer_views.push(BufferViewOut {
                    buffer: 0,
                    byte_offset: end,
                    byte_length,
                    target: Some(ARRAY_BUFFER),
                });
                end += byte_length;
            }
            let [min, max] = bounds.map(|bound| (k == 0).then_some(bound));
            accessors.push(AccessorOut {
                buffer_view,
                component_type: if attribute.is_byte { UNSIGNED_BYTE } else { FLOAT },
                normalized: attribute.is_byte,
                count,
                shape: attribute.shape,
                min,
                max,
            });
        }
        let attributes = attributes.iter().enumerate().map(|(k, attribute)| (attribute.name.clone(), k));
        let mut extensions_used = vec![super::EXTENSION];
        extensions_used.extend(spz.map(|_| super::SPZ_EXTENSION));
        let splatting = SplattingOut {
            kernel: "ellipse",
            color_space: "srgb_rec709_display",
            projection: "perspective",
            sorting_method: "cameraDistance",
            extensions: spz.map(|_| SpzOut { spz: SpzBufferView { buffer_view: 0 } }),
        };
        let extensions = PrimitiveExtensionsOut { splatting };
        let primitive = PrimitiveOut { attributes: attributes.collect(), mode: POINTS, extensions };
        Self {
            asset: Asset { version: "2.0", generator: "lexisplat" },
            // Without the extension the accessors of compressed splats are all zeros.
            extensions_required: if spz.is_some() { extensions_used.clone() } else { Vec::new() },
            extensions_used,
            scene: 0,
            scenes: [SceneNodes { nodes: [0] }],
            nodes: [Node { mesh: 0, translation: None }],
            meshes: [Mesh { primitives: [primitive] }],
            accessors,
            buffer_views,
            buffers: [BufferOut { byte_length: end }],
        }
    }
}
