//! The splats of all primitives, one after another.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use lexisplat::ply::ReadOptions;
use lexisplat::sh::CHANNELS;
use lexisplat::{Error, Result, ShDegree};

use super::accessor::{Accessor, Component};
use super::buffers::Buffers;
use super::document::{Document, Shape};
use super::place::Place;
use super::primitive::{Found, Source};
use super::{attribute, rest_attributes, warn};
use crate::rows::{Rows, RowsMut};
use crate::spz;

use Component::{F32, I8, I8Share, I16, I16Share, U8, U8Share, U16, U16Share};

/// What the numbers of positions may be, with `KHR_mesh_quantization`.
const POSITION: &[Component] = &[F32, I8, I8Share, U8, U8Share, I16, I16Share, U16, U16Share];
const ROTATION: &[Component] = &[F32, I8Share, I16Share];
const SCALE: &[Component] = &[F32, U8, U8Share, U16, U16Share];
const OPACITY: &[Component] = &[F32, U8Share, U16Share];
const HARMONICS: &[Component] = &[F32];

/// The accessors of a primitive, all of as many elements.
#[derive(Debug)]
struct Accessors {
    position: Accessor,
    rotation: Accessor,
    scale: Accessor,
    opacity: Accessor,
    dc: Accessor,
    rest: Vec<Accessor>,
}

/// An SPZ of a bufferView.
#[derive(Clone)]
struct Packed {
    rows: Arc<dyn Rows>,
    len: usize,
    degree: ShDegree,
    antialiased: bool,
}

enum Splats {
    Plain(Box<Accessors>),
    Packed(Packed),
}

/// The splats of a primitive in their place.
struct Part {
    /// Number of the part's first Gaussian, and of the first after it.
    range: Range<usize>,
    splats: Splats,
    place: Place,
}

/// The splats of all primitives.
pub(super) struct Scene<'a> {
    buffers: Buffers<'a>,
    parts: Vec<Part>,
    /// The highest SH degree.
    degree: ShDegree,
}

impl fmt::Debug for Scene<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Scene").field("parts", &self.parts.len()).finish_non_exhaustive()
    }
}

impl<'a> Scene<'a> {
    pub(super) fn new(buffers: Buffers<'a>) -> Self {
        Self { buffers, parts: Vec::new(), degree: ShDegree::ZERO }
    }

    /// Number of Gaussians.
    pub(super) fn len(&self) -> usize {
        self.parts.last().map_or(0, |part| part.range.end)
    }

    /// The highest SH degree.
    pub(super) fn degree(&self) -> ShDegree {
        self.degree
    }

    /// Whether all parts have the mark of anti-aliasing, which only an SPZ has.
    pub(super) fn is_antialiased(&self) -> bool {
        self.parts.iter().all(|part| matches!(&part.splats, Splats::Packed(packed) if packed.antialiased))
    }

    /// Adds the splats of all of `found`.
    ///
    /// # Errors
    /// [`Error::Format`] for numbers that are not all there or of the wrong kind, [`Error::Limit`] for too many Gaussians.
    pub(super) fn add_all(
        &mut self,
        name: &str,
        document: &Document<'_>,
        found: &[Found],
        file_bytes: u64,
        options: &ReadOptions,
        warnings: &mut Vec<String>,
    ) -> Result<()> {
        // Nodes that show the same SPZ share it.
        let mut packed = BTreeMap::<usize, Packed>::new();
        let mut packed_bytes = 0;
        for found in found {
            let (splats, len, degree) = match &found.source {
                Source::Plain { geometry, rest, degree } => {
                    let accessors = self.accessors(name, document, found, (geometry, rest, *degree))?;
                    let len = accessors.position.count;
                    (Splats::Plain(Box::new(accessors)), len, *degree)
                }
                Source::Spz { view, count } => {
                    let packed = match packed.get(view) {
                        Some(packed) => packed.clone(),
                        None => {
                            let (span, _) = self.buffers.view(name, document, *view)?;
                            packed_bytes += span.length as u64;
                            if packed_bytes > file_bytes {
                                return Err(Error::malformed(name, "bufferViews of SPZs overlap"));
                            }
                            let new = unpack(name, found, self.buffers.get(span), options, warnings)?;
                            packed.entry(*view).or_insert(new).clone()
                        }
                    };
                    if let Some(count) = count.filter(|count| *count != packed.len as u64) {
                        let text = format!(
                            "{}: its accessors have {count} elements, and its SPZ {}",
                            found.label, packed.len
                        );
                        warn(warnings, text);
                    }
                    let (len, degree) = (packed.len, packed.degree);
                    (Splats::Packed(packed), len, degree)
                }
            };
            let start = self.len();
            options.limits.check_gaussians(name, (start as u64).saturating_add(len as u64))?;
            self.degree = self.degree.max(degree);
            self.parts.push(Part { range: start..start + len, splats, place: found.place });
        }
        Ok(())
    }

    /// The accessors of a primitive that is not compressed.
    fn accessors(
        &self,
        name: &str,
        document: &Document<'_>,
        found: &Found,
        (geometry, rest, degree): (&[usize; 5], &[usize], ShDegree),
    ) -> Result<Accessors> {
        let check = |name_of: &str, index: usize, shape, components| {
            Accessor::check(name, document, &self.buffers, (name_of, index), shape, components)
        };
        let [position, rotation, scale, opacity, dc] = *geometry;
        let position = check("POSITION", position, Shape::Vec3, POSITION)?;
        let same = |name_of: &str, accessor: Accessor| {
            if accessor.count == position.count {
                return Ok(accessor);
            }
            let text = format!(
                "{}: {} elements of {name_of}, and {} of POSITION",
                found.label, accessor.count, position.count
            );
            Err(Error::malformed(name, text))
        };
        let of = |word: &str, index: usize, shape, components| {
            let name_of = attribute(word);
            same(&name_of, check(&name_of, index, shape, components)?)
        };
        let sh = |(name_of, index): (String, &usize)| {
            same(&name_of, check(&name_of, *index, Shape::Vec3, HARMONICS)?)
        };
        Ok(Accessors {
            position,
            rotation: of("ROTATION", rotation, Shape::Vec4, ROTATION)?,
            scale: of("SCALE", scale, Shape::Vec3, SCALE)?,
            opacity: of("OPACITY", opacity, Shape::Scalar, OPACITY)?,
            dc: of("SH_DEGREE_0_COEF_0", dc, Shape::Vec3, HARMONICS)?,
            rest: rest_attributes(degree).zip(rest).map(sh).collect::<Result<_>>()?,
        })
    }
}

/// The SPZ in `bytes`, which `found` has.
fn unpack(
    name: &str,
    found: &Found,
    bytes: &[u8],
    options: &ReadOptions,
    warnings: &mut Vec<String>,
) -> Result<Packed> {
    let described = spz::read(&format!("{name}, {}", found.label), bytes, options)?;
    described.warnings.into_iter().for_each(|text| warn(warnings, text));
    Ok(Packed {
        rows: Arc::from(described.rows),
        len: described.len,
        degree: described.degree,
        antialiased: described.meta.antialiased,
    })
}

impl Rows for Scene<'_> {
    fn fill(&self, range: Range<usize>, mut out: RowsMut<'_>) {
        let degree = self.degree();
        let first = self.parts.partition_point(|part| part.range.end <= range.start);
        for part in self.parts.iter().skip(first).take_while(|part| part.range.start < range.end) {
            let [start, end] = [range.start, range.end].map(|k| k.clamp(part.range.start, part.range.end));
            let local = start - part.range.start..end - part.range.start;
            let mut out = out.take(local.len(), degree.rest());
            match &part.splats {
                Splats::Plain(accessors) => accessors.fill(&self.buffers, local, degree, out.reborrow()),
                Splats::Packed(packed) => packed.fill(local, degree, out.reborrow()),
            }
            part.place.apply(degree, out);
        }
    }

    fn is_finite(&self) -> bool {
        false
    }
}

impl Packed {
    /// Decodes Gaussians `range` to SH of `degree`, which is no lower than that of the SPZ.
    fn fill(&self, range: Range<usize>, degree: ShDegree, out: RowsMut<'_>) {
        if self.degree == degree {
            return self.rows.fill(range, out);
        }
        let (from, to) = (self.degree.rest_per_channel(), degree.rest_per_channel());
        let mut rest = vec![0.0; range.len() * self.degree.rest()];
        let RowsMut { positions, dc, opacities, scales, rotations, sh_rest } = out;
        self.rows.fill(range, RowsMut { positions, dc, opacities, scales, rotations, sh_rest: &mut rest });
        sh_rest.fill(0.0);
        if from > 0 {
            for (wide, narrow) in sh_rest.chunks_exact_mut(to).zip(rest.chunks_exact(from)) {
                wide[..from].copy_from_slice(narrow);
            }
        }
    }
}

impl Accessors {
    /// Decodes Gaussians `range` to SH of `degree`, which is no lower than that of the primitive.
    fn fill(&self, buffers: &Buffers<'_>, range: Range<usize>, degree: ShDegree, out: RowsMut<'_>) {
        let RowsMut { positions, dc, opacities, scales, rotations, sh_rest } = out;
        self.position.read(buffers, range.clone(), |i, v| positions[i] = v);
        self.rotation.read(buffers, range.clone(), |i, [x, y, z, w]| rotations[i] = [w, x, y, z]);
        let half_step = self.scale.component.half_step();
        self.scale.read(buffers, range.clone(), |i, v: [f32; 3]| {
            scales[i] = v.map(|v| log_scale(v, half_step));
        });
        self.opacity.read(buffers, range.clone(), |i, [share]| opacities[i] = logit(share));
        self.dc.read(buffers, range.clone(), |i, v| dc[i] = v);
        if self.rest.len() < degree.rest_per_channel() {
            sh_rest.fill(0.0);
        }
        let (all, per) = (degree.rest(), degree.rest_per_channel());
        for (k, accessor) in self.rest.iter().enumerate() {
            accessor.read(buffers, range.clone(), |i, colours: [f32; CHANNELS]| {
                for (c, v) in colours.into_iter().enumerate() {
                    sh_rest[i * all + c * per + k] = v;
                }
            });
        }
    }
}

/// The opacity before the sigmoid of `share`, 0 to 1. It is infinite for 0 and 1, and below and above.
#[expect(clippy::cast_possible_truncation, reason = "scenes are in single precision")]
pub(super) fn logit(share: f32) -> f32 {
    if share <= 0.0 {
        f32::NEG_INFINITY
    } else if share >= 1.0 {
        f32::INFINITY
    } else {
        let share = f64::from(share);
        libm::log(share / (1.0 - share)) as f32
    }
}

/// The logarithm of `scale`, and of half the smallest scale above 0 for 0, whose logarithm is not finite.
#[expect(clippy::cast_possible_truncation, reason = "scenes are in single precision")]
pub(super) fn log_scale(scale: f32, half_step: f64) -> f32 {
    libm::log(if scale == 0.0 { half_step } else { scale.into() }) as f32
}
