//! A trained scene as arrays, in the units of its PLY.

use serde::{Deserialize, Serialize};

use crate::formats::ply::is_extra_name;
use crate::scene::extra::{Extra, for_extra};
use crate::scene::offset::Offset;
use crate::scene::sh::ShDegree;
use crate::support::error::{Error, Result};

/// Value that replaces an infinite opacity, which keeps its sign. Opacities are stored before the sigmoid. In f32 the
/// sigmoid of this value is 1, and that of its negative is 0, to the last bit. Decoders of 8-bit opacities (SPZ,
/// compressed.ply) write infinities for 255 and 0.
pub const SURE_OPACITY: f32 = 100.0;

/// Value that replaces a scale of minus infinity, the logarithm of a size of zero, which converters of 2D Gaussians
/// write. e^-20 is 2e-9 units. No picture shows so small a size, since the rasteriser blurs by 0.3 squared pixels. It is
/// the smallest logarithm that the compressed PLY of `PlayCanvas` holds (`compressed-chunk.ts`). It does not depend on
/// the scene, so parts of a scene have the same values as the whole.
pub const FLAT_SCALE: f32 = -20.0;

/// Replaces scales of minus infinity by [`FLAT_SCALE`]. Returns the number of Gaussians that have any.
pub fn flatten_scales(scales: &mut [[f32; 3]]) -> usize {
    let mut flat = 0;
    for row in scales.iter_mut().filter(|row| row.contains(&f32::NEG_INFINITY)) {
        flat += 1;
        row.iter_mut().filter(|v| **v == f32::NEG_INFINITY).for_each(|v| *v = FLAT_SCALE);
    }
    flat
}

/// Returns the warning of a reader about `flat` Gaussians of [`flatten_scales`].
pub(crate) fn flat_note(flat: usize) -> String {
    let gaussians = if flat == 1 { "Gaussian has" } else { "Gaussians have" };
    format!("{flat} {gaussians} a size of zero (a scale of -inf), taken as e^{FLAT_SCALE}: flat")
}

/// Everything of a scene but its SH-rest coefficients. Every array has one entry for each Gaussian.
///
/// Values are as the trainer stored them, before any activation.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Geometry {
    /// Centres in world units, relative to [`SceneMeta::offset`].
    pub positions: Vec<[f32; 3]>,
    /// Normals. Empty if the file has none or all are zero. Every known trainer writes zeros.
    pub normals: Vec<[f32; 3]>,
    /// SH coefficient 0 of red, green and blue. The base colour is `0.5 + C0 * dc`.
    pub dc: Vec<[f32; 3]>,
    /// Opacity before the sigmoid.
    pub opacities: Vec<f32>,
    /// Natural logarithms of the standard deviations along the three axes. A reader gives [`FLAT_SCALE`] for a size of zero.
    pub scales: Vec<[f32; 3]>,
    /// Quaternions (w, x, y, z), not necessarily of unit length.
    pub rotations: Vec<[f32; 4]>,
    /// Per-Gaussian properties that 3DGS does not define, in file order.
    pub extras: Vec<Extra>,
}

/// Facts about a scene in its file, beside its Gaussians. They are kept from PLY to .lexi and back.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneMeta {
    /// `comment` lines of the source, without the keyword, in order.
    pub comments: Vec<String>,
    /// Whether the scene was trained with the anti-aliased (Mip-Splatting) dilation: Brush `SplatRenderMode: mip`,
    /// Postshot `antialiased 1`.
    pub antialiased: bool,
    /// The numbers that are added to positions to get the positions of the source; `None` if these are the same.
    pub offset: Option<Offset>,
    /// Text of the view from which viewers show the scene first: `Pose` of `lexisplat-render`. PLY files have none.
    /// Viewers ignore a text that they cannot read. An empty text stands for a file without a view.
    pub view: Option<String>,
}

impl SceneMeta {
    /// Adds the comments of `other` that are not there yet, and its view if there is none.
    pub(crate) fn join(&mut self, other: &Self) {
        self.view = self.view.take().or_else(|| other.view.clone());
        for comment in &other.comments {
            if !self.comments.contains(comment) {
                self.comments.push(comment.clone());
            }
        }
    }
}

/// A scene with dense SH, as in a trainer's PLY.
#[derive(Debug, Clone, PartialEq)]
pub struct Splats {
    /// Everything but SH-rest.
    pub geometry: Geometry,
    /// SH degree.
    pub degree: ShDegree,
    /// SH-rest: `degree.rest()` values for each Gaussian, channel-major.
    pub sh_rest: Vec<f32>,
    /// Comments and marks.
    pub meta: SceneMeta,
}

/// Refuses the first value of named arrays that is not finite, as [`Error::Parameter`].
pub(crate) fn all_finite<'a>(arrays: impl IntoIterator<Item = (&'static str, &'a [f32])>) -> Result<()> {
    for (name, values) in arrays {
        if let Some(value) = values.iter().find(|v| !v.is_finite()) {
            return Err(Error::parameter(name, value, "finite values"));
        }
    }
    Ok(())
}

impl Geometry {
    /// Appends the Gaussians of `other`, which has the same extras, and normals if this one has any.
    pub(crate) fn append(&mut self, other: Self) {
        self.positions.extend(other.positions);
        self.normals.extend(other.normals);
        self.dc.extend(other.dc);
        self.opacities.extend(other.opacities);
        self.scales.extend(other.scales);
        self.rotations.extend(other.rotations);
        for (to, from) in self.extras.iter_mut().zip(other.extras) {
            to.values.append(from.values);
        }
    }

    /// Returns `n` Gaussians of zeros, without normals and extras.
    pub(crate) fn zeros(n: usize) -> Self {
        Self {
            positions: vec![[0.0; 3]; n],
            dc: vec![[0.0; 3]; n],
            opacities: vec![0.0; n],
            scales: vec![[0.0; 3]; n],
            rotations: vec![[0.0; 4]; n],
            ..Self::default()
        }
    }

    /// Returns the number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Returns whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Checks that all arrays have the same length.
    ///
    /// # Errors
    /// [`Error::Parameter`] that names the array with another length.
    pub fn validate(&self) -> Result<()> {
        let n = self.len();
        let lengths = [
            ("dc", self.dc.len()),
            ("opacities", self.opacities.len()),
            ("scales", self.scales.len()),
            ("rotations", self.rotations.len()),
        ];
        for (name, len) in lengths {
            if len != n {
                return Err(Error::parameter(name, len, format!("{n} entries, one a position")));
            }
        }
        if !self.normals.is_empty() && self.normals.len() != n {
            return Err(Error::parameter("normals", self.normals.len(), format!("none or {n} entries")));
        }
        for extra in &self.extras {
            if extra.values.len() != n {
                return Err(Error::parameter("extra", &extra.name, format!("{n} entries, one a position")));
            }
            if !is_extra_name(&extra.name) {
                let expected =
                    "a name without white space and control characters that no property of 3DGS has";
                return Err(Error::parameter("extra", extra.name.escape_debug(), expected));
            }
        }
        Ok(())
    }

    /// Checks that every value is finite, except those of extras.
    ///
    /// # Errors
    /// [`Error::Parameter`] that names the array and the first value that is not finite.
    pub(crate) fn validate_values(&self) -> Result<()> {
        let names = ["positions", "dc", "opacities", "scales", "rotations", "normals"];
        all_finite(names.into_iter().zip(self.floats()))
    }

    /// Returns the values of positions, base colours, opacities, scales, rotations and normals.
    pub(crate) fn floats(&self) -> [&[f32]; 6] {
        [
            self.positions.as_flattened(),
            self.dc.as_flattened(),
            &self.opacities,
            self.scales.as_flattened(),
            self.rotations.as_flattened(),
            self.normals.as_flattened(),
        ]
    }

    /// Keeps only the Gaussians for which `keep` is true, in order. `keep` has one entry for each Gaussian.
    pub fn retain(&mut self, keep: &[bool]) {
        filter(&mut self.positions, keep);
        filter(&mut self.normals, keep);
        filter(&mut self.dc, keep);
        filter(&mut self.opacities, keep);
        filter(&mut self.scales, keep);
        filter(&mut self.rotations, keep);
        for extra in &mut self.extras {
            for_extra!(&mut extra.values, v => filter(v, keep));
        }
    }
}

/// Keeps the values for which `keep` is true.
pub(crate) fn filter<T: Copy>(values: &mut Vec<T>, keep: &[bool]) {
    let mut flags = keep.iter();
    values.retain(|_| flags.next().copied().unwrap_or(false));
}

impl Splats {
    /// Returns the number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        self.geometry.len()
    }

    /// Returns whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.geometry.is_empty()
    }

    /// Returns the SH-rest of Gaussian `i`: `degree.rest()` values, channel-major.
    ///
    /// # Panics
    /// If `i` is not below [`Self::len`].
    #[must_use]
    pub fn rest(&self, i: usize) -> &[f32] {
        let dim = self.degree.rest();
        &self.sh_rest[i * dim..(i + 1) * dim]
    }

    /// Checks that all arrays have the same length.
    ///
    /// # Errors
    /// [`Error::Parameter`] that names the array with another length.
    pub fn validate(&self) -> Result<()> {
        self.geometry.validate()?;
        let expected = self.len() * self.degree.rest();
        if self.sh_rest.len() == expected {
            Ok(())
        } else {
            Err(Error::parameter("sh_rest", self.sh_rest.len(), format!("{expected} values")))
        }
    }

    /// Appends the Gaussians of `other`, which has the same degree, the same extras, and normals if this one has any.
    pub fn append(&mut self, other: Self) {
        self.geometry.append(other.geometry);
        self.sh_rest.extend(other.sh_rest);
    }

    /// Frees memory that a longer scene took, except that of extras.
    pub(crate) fn shrink_to_fit(&mut self) {
        let g = &mut self.geometry;
        g.positions.shrink_to_fit();
        g.normals.shrink_to_fit();
        g.dc.shrink_to_fit();
        g.opacities.shrink_to_fit();
        g.scales.shrink_to_fit();
        g.rotations.shrink_to_fit();
        self.sh_rest.shrink_to_fit();
    }

    /// Returns a copy of the Gaussians at the indices `order`, in this order.
    ///
    /// # Panics
    /// If an index is out of range.
    #[must_use]
    pub fn gathered(&self, order: &[u32]) -> Self {
        let from = || order.iter().map(|&i| i as usize);
        let g = &self.geometry;
        let extras = g.extras.iter().map(|extra| {
            let mut extra = Extra { name: extra.name.clone(), values: extra.values.clone() };
            for_extra!(&mut extra.values, v => *v = from().map(|i| v[i]).collect());
            extra
        });
        let geometry = Geometry {
            positions: from().map(|i| g.positions[i]).collect(),
            normals: if g.normals.is_empty() { Vec::new() } else { from().map(|i| g.normals[i]).collect() },
            dc: from().map(|i| g.dc[i]).collect(),
            opacities: from().map(|i| g.opacities[i]).collect(),
            scales: from().map(|i| g.scales[i]).collect(),
            rotations: from().map(|i| g.rotations[i]).collect(),
            extras: extras.collect(),
        };
        let dim = self.degree.rest();
        let mut sh_rest = Vec::with_capacity(order.len() * dim);
        from().for_each(|i| sh_rest.extend_from_slice(&self.sh_rest[i * dim..(i + 1) * dim]));
        Self { geometry, degree: self.degree, sh_rest, meta: self.meta.clone() }
    }

    /// Keeps only the Gaussians for which `keep` is true, in order. `keep` has one entry for each Gaussian.
    pub fn retain(&mut self, keep: &[bool]) {
        self.geometry.retain(keep);
        let dim = self.degree.rest();
        let mut kept = 0;
        for i in (0..keep.len()).filter(|&i| keep[i]) {
            self.sh_rest.copy_within(i * dim..(i + 1) * dim, kept * dim);
            kept += 1;
        }
        self.sh_rest.truncate(kept * dim);
    }

    /// Returns the scene with SH of at most `degree`. Higher coefficients are cut off.
    #[must_use]
    pub fn with_degree_cut(&self, degree: ShDegree) -> Self {
        let degree = degree.min(self.degree);
        let (from, to) = (self.degree.rest_per_channel(), degree.rest_per_channel());
        let sh_rest = match from {
            0 => Vec::new(),
            _ => self.sh_rest.chunks_exact(from).flat_map(|channel| &channel[..to]).copied().collect(),
        };
        Self { geometry: self.geometry.clone(), degree, sh_rest, meta: self.meta.clone() }
    }
}
