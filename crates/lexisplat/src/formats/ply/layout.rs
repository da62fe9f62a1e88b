//! The offset of each property in a row, and the refusal of PLY files that are no 3DGS scenes.

use std::collections::HashMap;

use super::columns::{Field, Group};
use super::header::{Element, Header};
use super::names::{DC, NORMAL, OPACITY, POSITION, REST_PREFIX, ROTATION, SCALE, VERTEX, listed, shown};
use crate::formats::kind::Unsupported;
use crate::scene::extra::ScalarType;
use crate::scene::sh::ShDegree;
use crate::support::error::{FormatError, Result};

/// Number of arrays of floats: positions, normals, base colours, SH-rest, opacities, scales, rotations.
pub(super) const GROUPS: usize = 7;
/// Indices of the positions, normals, SH-rest, opacities and scales among these arrays.
pub(super) const POSITIONS: usize = 0;
pub(super) const NORMALS: usize = 1;
pub(super) const REST: usize = 3;
pub(super) const OPACITIES: usize = 4;
pub(super) const SCALES: usize = 5;

/// A fact of a header, or the reason of a refusal.
type Accepted<T> = Result<T, FormatError>;

/// The offset of each property in a vertex row.
#[derive(Debug)]
pub(super) struct Layout {
    /// The index of the vertex element in the header.
    pub(super) vertex: usize,
    pub(super) row_bytes: usize,
    pub(super) degree: ShDegree,
    /// The properties of each array of floats, in INRIA's order. The list of the normals is empty unless all three exist.
    pub(super) groups: [Group; GROUPS],
    /// Properties that 3DGS does not define, in file order.
    pub(super) extras: Vec<(String, Field)>,
    /// Whether the Gaussians are 2D ones. A file of these has no third scale, and the reader fills its column.
    pub(super) is_flat: bool,
    /// Warnings about the properties, one sentence each.
    pub(super) warnings: Vec<String>,
}

impl Layout {
    /// Finds the layout of the vertices of `header`, with extras or without.
    pub(super) fn new(header: &Header, drop_extras: bool) -> Accepted<Self> {
        let vertex = vertex_index(header)?;
        let mut columns = Columns::new(&header.elements[vertex])?;
        refuse_other_kinds(&columns)?;
        let position = columns.group(&POSITION, "")?;
        let dc = columns.group(&DC, "; colours as red, green and blue alone are no spherical harmonics")?;
        let opacity = columns.group(&OPACITY, "")?;
        let has = |name: &str| columns.fields.contains_key(name);
        let is_flat = has(SCALE[0]) && has(SCALE[1]) && !has(SCALE[2]);
        let sizes = if is_flat { 2 } else { SCALE.len() };
        let mut scale = columns.group(&SCALE[..sizes], "")?;
        scale.width = SCALE.len();
        let rotation = columns.group(&ROTATION, "")?;
        let (degree, rest_names) = rest_names(&columns)?;
        let rest = columns.group(&rest_names, "")?;

        let mut warnings = Vec::new();
        if is_flat {
            warnings.push(
                "a 2D Gaussian Splatting model (no scale_2): its Gaussians are taken as flat".to_owned(),
            );
        }
        let mut normals: Vec<&str> = NORMAL.into_iter().filter(|n| columns.fields.contains_key(n)).collect();
        if !normals.is_empty() && normals.len() < NORMAL.len() {
            warnings.push(format!("only part of a normal is there, dropped: {}", listed(&normals)));
            for name in normals.drain(..) {
                columns.fields.remove(name);
            }
        }
        let normal = columns.group(&normals, "")?;
        if !columns.converted.is_empty() {
            warnings.push(format!("converted to 32-bit float: {}", listed(&columns.converted)));
        }
        let row_bytes = columns.row_bytes;
        // The remaining properties, in file order.
        let mut extras: Vec<_> = columns.fields.into_iter().map(|(n, f)| (n.to_owned(), f)).collect();
        extras.sort_by_key(|(_, field)| field.offset);
        if !extras.is_empty() {
            let names: Vec<&str> = extras.iter().map(|(name, _)| name.as_str()).collect();
            let what = if drop_extras { "dropped" } else { "kept" };
            warnings.push(format!("extra properties {what}: {}", listed(&names)));
        }
        if drop_extras {
            extras.clear();
        }
        let groups = [position, normal, dc, rest, opacity, scale, rotation];
        Ok(Self { vertex, row_bytes, degree, groups, extras, is_flat, warnings })
    }
}

/// Returns the index of the vertex element in `header.elements`.
fn vertex_index(header: &Header) -> Accepted<usize> {
    let compressed =
        |e: &Element| e.name == "chunk" || e.properties.iter().any(|p| p.name == "packed_position");
    if header.elements.iter().any(compressed) {
        return Err(FormatError::Unsupported { kind: Unsupported::CompressedPly });
    }
    let names: Vec<&str> = header.elements.iter().map(|e| e.name.as_str()).collect();
    let mut found = (0..names.len()).filter(|&i| names[i] == VERTEX);
    match (found.next(), found.next()) {
        (Some(index), None) => Ok(index),
        (Some(_), Some(_)) => {
            Err(FormatError::Malformed("element 'vertex' is declared more than once".to_owned()))
        }
        (None, _) => {
            let found = if names.is_empty() { "none".to_owned() } else { listed(&names) };
            Err(FormatError::Malformed(format!("no element 'vertex'; elements found: {found}")))
        }
    }
}

/// Refuses files of related methods, recognised by the properties that they have or lack.
fn refuse_other_kinds(columns: &Columns<'_>) -> Accepted<()> {
    let has = |name: &str| columns.fields.contains_key(name);
    let shaped = has(SCALE[0]) && has(ROTATION[0]);
    let kind = if has("f_anchor_feat_0") {
        Unsupported::Anchors
    } else if !has(OPACITY[0]) && !shaped {
        Unsupported::PointCloud
    } else {
        return Ok(());
    };
    Err(FormatError::Unsupported { kind })
}

/// Returns the SH degree and the names from `f_rest_0` to the highest.
fn rest_names(columns: &Columns<'_>) -> Accepted<(ShDegree, Vec<String>)> {
    let number = |name: &str| -> Option<usize> {
        let digits = name.strip_prefix(REST_PREFIX).filter(|digits| !digits.is_empty())?;
        let are_digits = digits.bytes().all(|digit| digit.is_ascii_digit());
        // A number with too many digits is above all numbers that a file can have.
        are_digits.then(|| digits.parse().unwrap_or(usize::MAX))
    };
    let mut numbers: Vec<usize> = columns.fields.keys().filter_map(|name| number(name)).collect();
    numbers.sort_unstable();
    let count = numbers.len();
    let expected = "expected f_rest_0 onwards, 0, 9, 24, 45 or 72 of them (SH degree 0 to 4)";
    let gap = (0..count).find(|&i| numbers[i] != i);
    if let (Some(missing), Some(last)) = (gap, numbers.last()) {
        return Err(FormatError::Malformed(format!(
            "property 'f_rest_{missing}' is missing: {count} f_rest properties found, the highest is \
             f_rest_{last}; {expected}"
        )));
    }
    let degree = ShDegree::from_rest(count)
        .ok_or_else(|| FormatError::Malformed(format!("{count} f_rest properties found; {expected}")))?;
    Ok((degree, (0..count).map(rest_name).collect()))
}

/// Returns the name of SH-rest coefficient `number`.
pub(super) fn rest_name(number: usize) -> String {
    format!("{REST_PREFIX}{number}")
}

/// The properties of the vertex element that no group has claimed yet.
struct Columns<'a> {
    fields: HashMap<&'a str, Field>,
    row_bytes: usize,
    /// Claimed properties that are not f32, as `name (type)`.
    converted: Vec<String>,
}

impl<'a> Columns<'a> {
    fn new(vertex: &'a Element) -> Accepted<Self> {
        let (mut fields, mut row_bytes) = (HashMap::with_capacity(vertex.properties.len()), 0);
        for property in &vertex.properties {
            let name = property.name.as_str();
            let refuse = |what| FormatError::Malformed(format!("vertex property '{}' {what}", shown(name)));
            let ty = property.kind.scalar();
            let ty = ty.ok_or_else(|| refuse("is a list; a Gaussian's properties are single values"))?;
            if fields.insert(name, Field { offset: row_bytes, ty }).is_some() {
                return Err(refuse("is declared twice"));
            }
            row_bytes += ty.bytes();
        }
        Ok(Self { fields, row_bytes, converted: Vec::new() })
    }

    /// Claims the properties `names`, which become one array. `hint` is for the error if one is missing.
    fn group<S: AsRef<str>>(&mut self, names: &[S], hint: &'static str) -> Accepted<Group> {
        let mut fields = Vec::with_capacity(names.len());
        for name in names.iter().map(AsRef::as_ref) {
            let Some(field) = self.fields.remove(name) else {
                return Err(FormatError::MissingProperty { name: name.to_owned(), hint });
            };
            if field.ty != ScalarType::F32 {
                self.converted.push(format!("{name} ({})", field.ty.name()));
            }
            fields.push(field);
        }
        Ok(Group::new(&fields))
    }
}
