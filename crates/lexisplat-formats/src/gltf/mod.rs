//! glTF 2.0 with `KHR_gaussian_splatting`, as a glb or as JSON (KhronosGroup/glTF, `extensions/2.0/Khronos`), and with
//! `KHR_gaussian_splatting_compression_spz_2`, a draft in which the splats are an SPZ.
//!
//! Splats are primitives of meshes, and nodes show meshes. Positions, rotations, scales, opacities and every SH
//! coefficient have accessors of their own. Scales are linear, and opacities are shares. The axes are x left, y up, z
//! forward.

mod accessor;
mod buffers;
mod columns;
mod document;
mod glb;
mod json;
mod nodes;
mod placement;
mod primitive;
mod scene;
#[cfg(test)]
mod tests;
mod write;

use lexisplat::ply::ReadOptions;
use lexisplat::{Error, Result, SceneMeta, ShDegree};
use serde_json::json;

use self::buffers::Buffers;
use self::document::Document;
use self::glb::Chunks;
use self::primitive::Source;
use self::scene::Scene;
use crate::rows::Described;

pub(crate) use self::glb::MAGIC;
pub(crate) use self::write::write;

/// Extension of splats. The names of their attributes begin with it.
const EXTENSION: &str = "KHR_gaussian_splatting";
/// Extension of splats in the form of an SPZ.
const SPZ_EXTENSION: &str = "KHR_gaussian_splatting_compression_spz_2";
/// Extensions that a file may require.
const REQUIRED: [&str; 6] = [
    EXTENSION,
    SPZ_EXTENSION,
    "KHR_gaussian_splatting_compression_spz",
    "KHR_spz_gaussian_splats_compression",
    "KHR_spz_compression",
    "KHR_mesh_quantization",
];
/// Largest number of splat primitives of a scene. A primitive counts each time that it is shown.
const MOST_SHOWN: usize = 1 << 16;
/// Largest number of warnings about a file.
const MOST_WARNINGS: usize = 32;

/// Reads the glb or glTF in `bytes`, which messages call `name`.
///
/// # Errors
/// [`Error::Format`] for damage, for files that need other files, and for files without splats; [`Error::Limit`] for a
/// file that asks for too much.
pub(crate) fn read<'a>(name: &str, bytes: &'a [u8], options: &ReadOptions) -> Result<Described<'a>> {
    let chunks = if bytes.starts_with(MAGIC) {
        Chunks::read(name, bytes)?
    } else {
        Chunks { json: bytes, ..Chunks::default() }
    };
    let mut warnings = chunks.warnings;
    let document = Document::parse(name, chunks.json, &options.limits)?;
    if let Some(other) = document.extensions_required.iter().find(|name| !REQUIRED.contains(&name.as_str())) {
        let text = format!("it requires the extension '{}', which is not read", other.escape_debug());
        return Err(Error::malformed(name, text));
    }
    let shown = nodes::shown(name, &document)?;
    let found = primitive::find(name, &document, &shown, &mut warnings)?;
    let buffer_views = found.iter().flat_map(|found| found.buffer_views(&document));
    let buffers = Buffers::load(name, &document, chunks.bin, buffer_views)?;
    let mut scene = Scene::new(buffers);
    let file_bytes = bytes.len() as u64;
    scene.add_all(name, &document, &found, file_bytes, options, &mut warnings)?;
    let is_spz = found.iter().any(|found| matches!(found.source, Source::Spz { .. }));
    let facts = vec![
        ("version", json!(document.asset.version.chars().take(16).collect::<String>())),
        ("primitives", json!(found.len())),
        ("compression", json!(if is_spz { "spz" } else { "none" })),
    ];
    let (len, degree, antialiased) = (scene.len(), scene.degree(), scene.is_antialiased());
    options.limits.check_gaussians(name, len as u64)?;
    // Many nodes may show the same mesh. The limit of bytes applies to parts of a scene, and the reader of parts checks
    // it.
    let each = size_of::<f32>() * (3 + 3 + 1 + 3 + 4 + degree.rest());
    options.limits.with_bytes(u64::MAX).check_arrays(name, file_bytes, len, each)?;
    let meta = SceneMeta { antialiased, offset: scene.settle_offset(), ..SceneMeta::default() };
    Ok(Described { rows: Box::new(scene), len, degree, meta, warnings, facts })
}

/// Returns the full name of an attribute of splats.
fn attribute(name: &str) -> String {
    format!("{EXTENSION}:{name}")
}

/// Returns the names of the attributes of SH-rest of `degree`, in the order of one channel.
fn rest_attributes(degree: ShDegree) -> impl Iterator<Item = String> {
    (1..=degree.get()).flat_map(of_degree)
}

/// Returns the names of the attributes of SH of degree `l` alone.
fn of_degree(l: u8) -> impl Iterator<Item = String> {
    (0..=2 * l).map(move |n| attribute(&format!("SH_DEGREE_{l}_COEF_{n}")))
}

/// Adds a warning if it is new, up to [`MOST_WARNINGS`] warnings.
fn warn(warnings: &mut Vec<String>, text: String) {
    if warnings.len() < MOST_WARNINGS && !warnings.contains(&text) {
        warnings.push(text);
    }
}
