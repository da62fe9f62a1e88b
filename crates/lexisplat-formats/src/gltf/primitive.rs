//! Primitives that are splats, and their statements about themselves.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use lexisplat::sh::MAX_DEGREE;
use lexisplat::{Error, Result, ShDegree};

use super::buffers::missing;
use super::document::{Document, Primitive, Splatting};
use super::nodes::Shown;
use super::placement::{GLTF, Placement};
use super::{MOST_SHOWN, attribute, of_degree, rest_attributes, warn};

/// Value of `mode` for points.
const POINTS: u32 = 0;
/// Value of `mode` of a primitive without `mode`: triangles.
const DEFAULT_MODE: u32 = 4;
/// Largest number of characters of a word of the file in a message.
const SHOWN: usize = 64;
/// Attributes of the drafts of 2024 and 2025. The drafts had no SH, and their colours were those of points.
const DRAFT_ATTRIBUTES: [&str; 3] = ["_SCALE", "_ROTATION", "_OPACITY"];
/// Highest SH degree of the extension.
const EXTENSION_DEGREE: u8 = 3;
/// The axes in the bytes of an SPZ relative to those of a trainer's PLY. Half a turn about x leads to them.
const SPZ: [bool; 3] = [false, true, true];

/// The source of the values of splats.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Source {
    /// Indices of the accessors of position, rotation, scale, opacity and SH coefficient 0, and those of SH-rest in the
    /// order of one channel.
    Plain { geometry: [usize; 5], rest: Vec<usize>, degree: ShDegree },
    /// An SPZ in a bufferView, and its number of Gaussians according to the accessor of positions.
    Spz { buffer_view: usize, count: Option<u64> },
}

/// A splat primitive that a node shows.
#[derive(Debug)]
pub(super) struct Found {
    /// Name of the primitive in messages.
    pub(super) label: String,
    pub(super) source: Source,
    pub(super) placement: Placement,
}

impl Found {
    /// Returns the bufferViews that the primitive needs.
    pub(super) fn buffer_views(&self, document: &Document<'_>) -> Vec<usize> {
        let buffer_view = |accessor: &usize| document.accessors.get(*accessor)?.buffer_view;
        match &self.source {
            Source::Plain { geometry, rest, .. } => {
                geometry.iter().chain(rest).filter_map(buffer_view).collect()
            }
            Source::Spz { buffer_view, .. } => vec![*buffer_view],
        }
    }
}

/// Returns `word` shortened and without control characters.
fn shown(word: &str) -> String {
    word.chars().take(SHOWN).collect::<String>().escape_debug().to_string()
}

/// Returns all splat primitives that `nodes` show.
///
/// # Errors
/// [`Error::Format`] for a file without splat primitives, and for primitives that cannot be read; [`Error::Limit`] for
/// too many primitives.
pub(super) fn find(
    name: &str,
    document: &Document<'_>,
    nodes: &[Shown],
    warnings: &mut Vec<String>,
) -> Result<Vec<Found>> {
    let (mut found, mut others, mut mirrored) = (Vec::new(), 0, 0_usize);
    // Many nodes may show the same mesh.
    let mut meshes = BTreeMap::new();
    for node in nodes {
        let sources = match meshes.entry(node.mesh) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => entry.insert(sources(name, document, node.mesh, warnings)?),
        };
        others += sources.others;
        for (label, source, changes) in &sources.splats {
            let placement = Placement::of(name, node.node, &node.matrix, *changes)?;
            mirrored += usize::from(placement.is_mirrored);
            found.push(Found { label: label.clone(), source: source.clone(), placement });
            if found.len() > MOST_SHOWN {
                let (what, limit) = (format!("splat primitives in {name}"), MOST_SHOWN as u64);
                return Err(Error::Limit { what, found: limit + 1, limit, name: None });
            }
        }
    }
    if found.is_empty() {
        let text = format!(
            "no splats: none of the primitives that it shows, {others} in all, has the extension KHR_gaussian_splatting"
        );
        return Err(Error::malformed(name, text));
    }
    if others > 0 {
        warnings.push(format!("primitives that are not splats are left out: {others}"));
    }
    if mirrored > 0 {
        warnings.push(format!(
            "splat primitives that their nodes mirror, which glTF does not define: {mirrored}"
        ));
    }
    Ok(found)
}

/// The primitives of a mesh.
struct Sources {
    /// For each splat primitive: its name in messages, the source of its values, and the axes whose signs differ from
    /// those of the glTF.
    splats: Vec<(String, Source, [bool; 3])>,
    /// Number of primitives that are not splats.
    others: u64,
}

/// Returns the primitives of mesh `index`.
fn sources(name: &str, document: &Document<'_>, index: usize, warnings: &mut Vec<String>) -> Result<Sources> {
    let mesh = document.meshes.get(index).ok_or_else(|| missing(name, "mesh", index))?;
    let mut sources = Sources { splats: Vec::new(), others: 0 };
    for (k, primitive) in mesh.primitives.iter().enumerate() {
        let label = format!("primitive {k} of mesh {index}");
        match source(name, document, &label, primitive, warnings)? {
            None => sources.others += 1,
            Some((source, changes)) => sources.splats.push((label, source, changes)),
        }
    }
    Ok(sources)
}

/// Returns the source of the values of `primitive`, and the axes whose signs differ from those of the glTF. Returns `None`
/// if the primitive is not of splats.
fn source(
    name: &str,
    document: &Document<'_>,
    label: &str,
    primitive: &Primitive,
    warnings: &mut Vec<String>,
) -> Result<Option<(Source, [bool; 3])>> {
    let extensions = &primitive.extensions;
    let (splatting, draft) = (extensions.splatting.as_ref(), extensions.draft);
    if splatting.is_none() && draft.is_none() {
        return Ok(None);
    }
    let mode = primitive.mode.unwrap_or(DEFAULT_MODE);
    if mode != POINTS {
        let text = format!("{label}: its mode is {mode}, and splats are points, mode {POINTS}");
        return Err(Error::malformed(name, text));
    }
    if let Some(splatting) = splatting {
        check_words(name, label, splatting, warnings)?;
    }
    let nested = splatting.and_then(|splatting| splatting.extensions.spz);
    let Some(spz) = nested.or(draft) else {
        return Ok(Some((plain(name, label, primitive, warnings)?, [false; 3])));
    };
    let position = primitive.attributes.get("POSITION").and_then(|&k| document.accessors.get(k));
    let source = Source::Spz { buffer_view: spz.buffer_view, count: position.map(|accessor| accessor.count) };
    // Reading an SPZ turns it to the axes of a trainer's PLY. Files of the drafts have glTF's axes where SPZ has its own
    // axes.
    let is_draft = nested.is_none() || splatting.is_none_or(is_draft);
    Ok(Some((source, if is_draft { SPZ } else { GLTF })))
}

/// Returns whether the words are missing that the extension requires and that its drafts did not have.
fn is_draft(splatting: &Splatting) -> bool {
    splatting.kernel.is_none() && splatting.color_space.is_none()
}

/// Returns an error for unknown kernels. Adds warnings about properties that are drawn differently from a trainer's PLY.
fn check_words(name: &str, label: &str, splatting: &Splatting, warnings: &mut Vec<String>) -> Result<()> {
    if let Some(kernel) = splatting.kernel.as_deref().filter(|kernel| *kernel != "ellipse") {
        let text = format!("{label}: the kernel '{}' is not read, only 'ellipse'", shown(kernel));
        return Err(Error::malformed(name, text));
    }
    if is_draft(splatting) {
        warn(warnings, "kernel and colorSpace are missing, as in drafts of the extension".to_owned());
    } else if let Some(missing) = match (&splatting.kernel, &splatting.color_space) {
        (None, _) => Some("kernel"),
        (_, None) => Some("colorSpace"),
        _ => None,
    } {
        warn(warnings, format!("{missing} is missing"));
    }
    for (what, found, expected) in [
        ("colorSpace", &splatting.color_space, "srgb_rec709_display"),
        ("projection", &splatting.projection, "perspective"),
        ("sortingMethod", &splatting.sorting_method, "cameraDistance"),
    ] {
        if let Some(found) = found.as_deref().filter(|found| *found != expected) {
            warn(warnings, format!("{what} is '{}' and is taken as '{expected}'", shown(found)));
        }
    }
    Ok(())
}

/// Returns the accessors of a primitive that is not compressed.
fn plain(name: &str, label: &str, primitive: &Primitive, warnings: &mut Vec<String>) -> Result<Source> {
    let attributes = &primitive.attributes;
    let accessor = |attribute: &str| {
        let text = || format!("{label}: the attribute {attribute} is missing");
        attributes.get(attribute).copied().ok_or_else(|| Error::malformed(name, text()))
    };
    if let Some(old) = DRAFT_ATTRIBUTES.into_iter().find(|old| attributes.contains_key(*old)) {
        let text = format!(
            "{label}: the attribute {old} is of a draft of KHR_gaussian_splatting, which has {} in its place; write the file \
             anew with a program of today",
            attribute(&old[1..])
        );
        return Err(Error::malformed(name, text));
    }
    let of = |word: &str| accessor(&attribute(word));
    let geometry =
        [accessor("POSITION")?, of("ROTATION")?, of("SCALE")?, of("OPACITY")?, of("SH_DEGREE_0_COEF_0")?];
    let has = |l: u8| of_degree(l).any(|attribute| attributes.contains_key(&attribute));
    let most = (1..=MAX_DEGREE).rev().find(|&l| has(l)).unwrap_or(0);
    if most > EXTENSION_DEGREE {
        warn(warnings, format!("SH of degree {most} are read, and the extension ends at {EXTENSION_DEGREE}"));
    }
    let degree = ShDegree::new(most)?;
    let rest = rest_attributes(degree).map(|attribute| accessor(&attribute)).collect::<Result<_>>()?;
    Ok(Source::Plain { geometry, rest, degree })
}
