//! Files of every kind, and what a scene made of each takes in memory.

use lexisplat::lexi::LexiWriter;
use lexisplat::packed::{PackOptions, Packer};
use lexisplat::{
    CompressOptions, Escapes, Extra, ExtraValues, Geometry, Indices, Layout, Model, Sensitivity, ShDegree,
    Silent, Splats, Values, compress, ply,
};
use lexisplat_sample::{SampleOptions, scene};

/// Most Gaussians of a chunk as scenes are packed.
const CHUNK: usize = 32_768;
/// No code of a packed file reaches it.
pub(crate) const LARGE: f32 = 1e6;
/// No code of an exact one does.
pub(crate) const HUGE: f32 = 1e20;

/// A scene with normals, an extra property, and two rows of `large`, which become escapes.
pub(crate) fn rich(gaussians: usize, large: f32) -> Splats {
    let mut splats = scene(&SampleOptions::new(gaussians, 1)).with_degree_cut(ShDegree::ONE);
    splats.geometry.normals = vec![[0.0, 1.0, 0.0]; gaussians];
    let numbers = (0..gaussians).map(|i| u16::try_from(i % 1000).unwrap());
    splats.geometry.extras =
        vec![Extra { name: "number".to_owned(), values: ExtraValues::U16(numbers.collect()) }];
    splats.sh_rest[..18].fill(large);
    splats
}

pub(crate) fn as_ply(splats: &Splats) -> Vec<u8> {
    let mut bytes = Vec::new();
    ply::write(&mut bytes, splats).unwrap();
    bytes
}

/// The same scene with its numbers as text.
pub(crate) fn as_ascii(splats: &Splats) -> Vec<u8> {
    let binary = as_ply(splats);
    let end = binary.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8(binary[..end].to_vec()).unwrap();
    let mut text = header.replace("binary_little_endian", "ascii");
    let g = &splats.geometry;
    for i in 0..splats.len() {
        let ExtraValues::U16(numbers) = &g.extras[0].values else { panic!("another type") };
        let floats = g.positions[i].iter().chain(&g.normals[i]).chain(&g.dc[i]).chain(splats.rest(i));
        let floats = floats.chain([&g.opacities[i]]).chain(&g.scales[i]).chain(&g.rotations[i]);
        let words: Vec<String> = floats.map(|v| format!("{v:?}")).chain([numbers[i].to_string()]).collect();
        text.push_str(&words.join(" "));
        text.push('\n');
    }
    text.into_bytes()
}

pub(crate) fn exact(splats: &Splats, layout: Layout) -> Vec<u8> {
    let mut options = CompressOptions::default();
    (options.values, options.atoms, options.sample) = (layout.values(), Some(12), 500);
    let mut bytes = Vec::new();
    let (model, _) = compress(splats.clone(), &options, &Silent).unwrap();
    LexiWriter::exact(&model, layout.codes()).unwrap().write(&mut bytes, &Silent).unwrap();
    bytes
}

pub(crate) fn packed(splats: &Splats, step: f64, keep_order: bool) -> Vec<u8> {
    let mut options = PackOptions::default();
    (options.keep_order, options.atoms) = (keep_order, Some(8));
    let sensitivity = Sensitivity::guess(&splats.geometry);
    let packer = Packer::new(splats, &sensitivity, &options).unwrap();
    let mut bytes = Vec::new();
    LexiWriter::packed(&packer.pack(step, &Silent).unwrap().0).write(&mut bytes, &Silent).unwrap();
    bytes
}

/// Two chunks of a packed scene, with codes in both.
pub(crate) fn two_chunks() -> Vec<u8> {
    packed(&rich(CHUNK + 300, LARGE), 1e-6, true)
}

/// Bytes of geometry with normals and extras.
fn geometry_bytes(g: &Geometry) -> usize {
    let arrays = [&g.positions, &g.normals, &g.dc, &g.scales];
    let extras = g.extras.iter().map(|e| match &e.values {
        ExtraValues::U16(values) => size_of_val(values.as_slice()),
        other => panic!("{other:?}"),
    });
    arrays.iter().map(|a| size_of_val(a.as_slice())).sum::<usize>()
        + size_of_val(g.opacities.as_slice())
        + size_of_val(g.rotations.as_slice())
        + extras.sum::<usize>()
}

pub(crate) fn splats_bytes(splats: &Splats) -> u64 {
    (geometry_bytes(&splats.geometry) + size_of_val(splats.sh_rest.as_slice())) as u64
}

pub(crate) fn model_bytes(model: &Model) -> u64 {
    let codes = model.codes();
    let indices = match codes.indices() {
        Indices::U8(v) => v.len(),
        Indices::U16(v) => 2 * v.len(),
    };
    let values = match codes.values() {
        Values::F32(v) => 4 * v.len(),
        Values::F16(v) => 2 * v.len(),
    };
    let Escapes { gaussians, rows } = codes.escapes();
    let escapes = size_of_val(gaussians.as_slice()) + size_of_val(rows.as_slice());
    (geometry_bytes(model.geometry()) + codes.counts().len() + indices + values + escapes) as u64
}

/// Bytes of the checksum that the tensor of the head starts with. It is not kept.
const SEAL: u64 = 4;

/// Bytes that an opened packed file takes: head without its checksum and data as they lie, order and extras as numbers.
pub(crate) fn packed_bytes(packed: &lexisplat::packed::Packed) -> u64 {
    let writer = LexiWriter::packed(packed);
    let attributes = writer.tensor_bytes();
    let lie = attributes.iter().filter(|t| ["packed.head", "packed.data"].contains(&t.0.as_str()));
    let extras = packed.extras().iter().map(|e| match &e.values {
        ExtraValues::U16(values) => size_of_val(values.as_slice()),
        other => panic!("{other:?}"),
    });
    let numbers = extras.sum::<usize>() + packed.order().map_or(0, size_of_val);
    lie.map(|t| t.1).sum::<u64>() - SEAL + numbers as u64
}
