//! Primitives that are splats, and what they say of themselves.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use lexisplat::sh::MAX_DEGREE;
use lexisplat::{Error, Result, ShDegree};

use super::buffers::missing;
use super::document::{Document, Primitive, Splatting};
use super::nodes::Shown;
use super::place::{GLTF, Place};
use super::{MOST_SHOWN, attribute, of_degree, rest_attributes, warn};

/// `mode` of points.
const POINTS: u32 = 0;
/// `mode` of a primitive that says none: triangles.
const DEFAULT_MODE: u32 = 4;
/// Most characters of a word of the file in a message.
const SHOWN: usize = 64;
/// Attributes of the drafts of 2024 and 2025. They held no SH, and their colours were those of points.
const DRAFT_ATTRIBUTES: [&str; 3] = ["_SCALE", "_ROTATION", "_OPACITY"];
/// The highest SH degree of the extension.
const EXTENSION_DEGREE: u8 = 3;
/// The axes of an SPZ's bytes beside a trainer's. Half a turn about x leads to them.
const SPZ: [bool; 3] = [false, true, true];

/// Where the numbers of splats are.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Source {
    /// Numbers of accessors: position, rotation, scale, opacity, SH coefficient 0, and SH-rest in the order of one channel.
    Plain { geometry: [usize; 5], rest: Vec<usize>, degree: ShDegree },
    /// The SPZ in a bufferView, and the number of its Gaussians by the accessor of positions.
    Spz { view: usize, count: Option<u64> },
}

/// A splat primitive that a node shows.
#[derive(Debug)]
pub(super) struct Found {
    /// What messages call it.
    pub(super) label: String,
    pub(super) source: Source,
    pub(super) place: Place,
}

impl Found {
    /// The bufferViews that it needs.
    pub(super) fn views(&self, document: &Document<'_>) -> Vec<usize> {
        let view = |accessor: &usize| document.accessors.get(*accessor)?.buffer_view;
        match &self.source {
            Source::Plain { geometry, rest, .. } => geometry.iter().chain(rest).filter_map(view).collect(),
            Source::Spz { view, .. } => vec![*view],
        }
    }
}

/// Short, and without control characters.
fn shown(word: &str) -> String {
    word.chars().take(SHOWN).collect::<String>().escape_debug().to_string()
}

/// All splat primitives that `nodes` show.
///
/// # Errors
/// [`Error::Format`] for a file without them, and for those that cannot be read; [`Error::Limit`] for too many.
pub(super) fn find(
    name: &str,
    document: &Document<'_>,
    nodes: &[Shown],
    warnings: &mut Vec<String>,
) -> Result<Vec<Found>> {
    let (mut found, mut others, mut mirrored) = (Vec::new(), 0, 0_usize);
    // Many nodes may show one mesh.
    let mut meshes = BTreeMap::new();
    for node in nodes {
        let sources = match meshes.entry(node.mesh) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => entry.insert(sources(name, document, node.mesh, warnings)?),
        };
        others += sources.others;
        for (label, source, changes) in &sources.splats {
            let place = Place::of(name, node.node, &node.matrix, *changes)?;
            mirrored += usize::from(place.is_mirrored);
            found.push(Found { label: label.clone(), source: source.clone(), place });
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
    /// What messages call them, where their splats are, and the axes whose signs they have beside those of the glTF.
    splats: Vec<(String, Source, [bool; 3])>,
    /// Number of those that are not splats.
    others: u64,
}

/// The primitives of mesh `index`.
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

/// Where the splats of `primitive` are, and the axes whose signs they have beside those of the glTF; none if it is not of
/// splats.
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
    let source = Source::Spz { view: spz.buffer_view, count: position.map(|accessor| accessor.count) };
    // Reading an SPZ turns it to a trainer's axes. The drafts' files hold glTF's own axes where SPZ has its own.
    let is_draft = nested.is_none() || splatting.is_none_or(is_draft);
    Ok(Some((source, if is_draft { SPZ } else { GLTF })))
}

/// Whether the words are missing that the extension asks for and that its drafts did not have.
fn is_draft(splatting: &Splatting) -> bool {
    splatting.kernel.is_none() && splatting.color_space.is_none()
}

/// Refuses unknown kernels, and warns of what is drawn otherwise than a trainer's PLY.
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

/// The accessors of a primitive that is not compressed.
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
