//! The splats of all primitives, one after another.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use lexisplat::ply::ReadOptions;
use lexisplat::{Error, Offset, Result, Rounding, ShDegree};

use super::buffers::Buffers;
use super::columns::Accessors;
use super::document::Document;
use super::placement::Placement;
use super::primitive::{Found, Source};
use super::warn;
use crate::rows::{Rows, RowsMut};
use crate::spz;

/// Number of Gaussians whose sizes tell whether single precision is too coarse for a translation.
const SAMPLE: usize = 4096;
/// Half of the relative distance of neighbouring values in single precision, at most.
const HALF_STEP: f64 = 1.0 / (1_u64 << 24) as f64;

/// An SPZ in a bufferView.
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

/// The splats of a primitive with their placement.
struct PlacedSplats {
    /// Numbers of the Gaussians.
    gaussians: Range<usize>,
    splats: Splats,
    placement: Placement,
}

/// The splats of all primitives.
pub(super) struct Scene<'a> {
    buffers: Buffers<'a>,
    primitives: Vec<PlacedSplats>,
    /// Highest SH degree of all primitives.
    degree: ShDegree,
}

impl fmt::Debug for Scene<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Scene").field("primitives", &self.primitives.len()).finish_non_exhaustive()
    }
}

impl<'a> Scene<'a> {
    pub(super) fn new(buffers: Buffers<'a>) -> Self {
        Self { buffers, primitives: Vec::new(), degree: ShDegree::ZERO }
    }

    /// Returns the number of Gaussians.
    pub(super) fn len(&self) -> usize {
        self.primitives.last().map_or(0, |one| one.gaussians.end)
    }

    /// Returns the highest SH degree of all primitives.
    pub(super) fn degree(&self) -> ShDegree {
        self.degree
    }

    /// Returns whether all primitives have the mark of anti-aliasing, which only an SPZ can have.
    pub(super) fn is_antialiased(&self) -> bool {
        self.primitives.iter().all(|one| matches!(&one.splats, Splats::Packed(packed) if packed.antialiased))
    }

    /// Subtracts the translation of the first primitive from all primitives and returns it, if single precision is too
    /// coarse at this distance from the origin for the sizes of the first Gaussians.
    pub(super) fn settle_offset(&mut self) -> Option<Offset> {
        let translation = self.primitives.first()?.placement.translation();
        let offset = Offset::new(translation).ok()??;
        let most = translation.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        let n = self.len().min(SAMPLE);
        let (mut positions, mut dc, mut scales) = (vec![[0.0; 3]; n], vec![[0.0; 3]; n], vec![[0.0; 3]; n]);
        let (mut opacities, mut rotations) = (vec![0.0; n], vec![[0.0; 4]; n]);
        let mut sh_rest = vec![0.0; n * self.degree.rest()];
        let out = RowsMut {
            positions: &mut positions,
            dc: &mut dc,
            opacities: &mut opacities,
            scales: &mut scales,
            rotations: &mut rotations,
            sh_rest: &mut sh_rest,
        };
        self.fill(0..n, out);
        let sizes = scales.into_iter().map(Rounding::size_of).filter(|size| size.is_finite()).collect();
        let rounding = Rounding { error: most * HALF_STEP, size: Rounding::median(sizes) };
        if !rounding.is_coarse() {
            return None;
        }
        self.primitives.iter_mut().for_each(|one| one.placement.rebase(offset));
        Some(offset)
    }

    /// Adds the splats of all of `found`.
    ///
    /// # Errors
    /// [`Error::Format`] for numbers that are not all in the file or have the wrong type, [`Error::Limit`] for too many
    /// Gaussians.
    pub(super) fn add_all(
        &mut self,
        name: &str,
        document: &Document<'_>,
        found: &[Found],
        file_bytes: u64,
        options: &ReadOptions,
        warnings: &mut Vec<String>,
    ) -> Result<()> {
        // Nodes that show the same SPZ share its decoded form.
        let mut packed = BTreeMap::<usize, Packed>::new();
        let mut packed_bytes = 0;
        for found in found {
            let (splats, len, degree) = match &found.source {
                Source::Plain { geometry, rest, degree } => {
                    let accessors =
                        Accessors::check(name, document, &self.buffers, found, (geometry, rest, *degree))?;
                    let len = accessors.len();
                    (Splats::Plain(Box::new(accessors)), len, *degree)
                }
                Source::Spz { buffer_view, count } => {
                    let packed = match packed.get(buffer_view) {
                        Some(packed) => packed.clone(),
                        None => {
                            let (span, _) = self.buffers.buffer_view(name, document, *buffer_view)?;
                            packed_bytes += span.length as u64;
                            if packed_bytes > file_bytes {
                                return Err(Error::malformed(name, "bufferViews of SPZs overlap"));
                            }
                            let new = unpack(name, found, self.buffers.get(span), options, warnings)?;
                            packed.entry(*buffer_view).or_insert(new).clone()
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
            self.primitives.push(PlacedSplats {
                gaussians: start..start + len,
                splats,
                placement: found.placement,
            });
        }
        Ok(())
    }
}

/// Reads the SPZ in `bytes`, which belongs to `found`.
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
        let first = self.primitives.partition_point(|one| one.gaussians.end <= range.start);
        for one in self.primitives.iter().skip(first).take_while(|one| one.gaussians.start < range.end) {
            let [start, end] =
                [range.start, range.end].map(|k| k.clamp(one.gaussians.start, one.gaussians.end));
            let local = start - one.gaussians.start..end - one.gaussians.start;
            let mut out = out.take(local.len(), degree.rest());
            match &one.splats {
                Splats::Plain(accessors) => accessors.fill(&self.buffers, local, degree, out.reborrow()),
                Splats::Packed(packed) => packed.fill(local, degree, out.reborrow()),
            }
            one.placement.apply(degree, out);
        }
    }

    fn is_finite(&self) -> bool {
        false
    }
}

impl Packed {
    /// Decodes Gaussians `range` to SH of `degree`, which must not be lower than the degree of the SPZ.
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
