//! The Gaussians of a scene that may be visible in a picture.

use lexisplat::Geometry;
use lexisplat::simd::Simd;

use crate::conventions::NEAR_Z;
use crate::parallel::*;
use crate::radiance::Radiance;

use super::lanes::LANES;
use super::math::whole;
use super::project::{Body, Projection};
use super::splat::{PixelRect, Splat};

/// Gaussians that one task projects.
pub(super) const GAUSSIANS_PER_TASK: usize = 1024;

/// The Gaussians that may be visible, in order of index: the first `counts[k]` of each [`GAUSSIANS_PER_TASK`] slots.
///
/// One allocation holds all of them. Many small ones from many threads would not be returned to the system.
#[derive(Debug, Default)]
pub(super) struct Visible {
    pub(super) slots: Vec<Splat>,
    /// What sorting and listing read of each slot, apart from the slots, which are many times as large.
    marks: Vec<Mark>,
    counts: Vec<usize>,
}

/// Where a splat comes in the order of depth, and where it goes.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Mark {
    /// Bits of the view-space z. It is positive, so the bits are in the order of the numbers.
    pub(super) depth: u32,
    /// The pixels that it may touch.
    pub(super) pixels: PixelRect,
}

impl Visible {
    /// Projects all Gaussians, in place of those of the picture before.
    pub(super) fn project(
        &mut self,
        simd: Simd,
        geometry: &Geometry,
        radiance: &Radiance<'_>,
        projection: &Projection,
    ) {
        self.slots.resize(geometry.len(), Splat::default());
        self.marks.resize(geometry.len(), Mark::default());
        self.counts = self
            .slots
            .par_chunks_mut(GAUSSIANS_PER_TASK)
            .zip(self.marks.par_chunks_mut(GAUSSIANS_PER_TASK))
            .enumerate()
            .map(|(task, (slots, marks))| {
                let first = task * GAUSSIANS_PER_TASK;
                simd.dispatch(
                    #[inline(always)]
                    || project(slots, marks, first, geometry, radiance, projection),
                )
            })
            .collect();
    }

    /// Number of Gaussians that may be visible.
    pub(super) fn len(&self) -> usize {
        self.counts.iter().sum()
    }

    /// The slots that hold a Gaussian, and their marks.
    pub(super) fn marked(&self) -> impl Iterator<Item = (u32, &Mark)> {
        // Gaussians are counted in u32.
        let slot = |slot: usize| u32::try_from(slot).unwrap_or(u32::MAX);
        let firsts = (0..).step_by(GAUSSIANS_PER_TASK);
        let tasks = firsts.zip(self.marks.chunks(GAUSSIANS_PER_TASK)).zip(&self.counts);
        tasks.flat_map(move |((first, marks), count)| {
            marks.iter().take(*count).enumerate().map(move |(k, mark)| (slot(first + k), mark))
        })
    }

    /// The mark of a slot.
    pub(super) fn mark(&self, slot: u32) -> &Mark {
        &self.marks[slot as usize]
    }
}

/// Projects the Gaussians from `first` on, as many as there are slots. Returns how many slots were filled.
#[inline(always)]
fn project(
    slots: &mut [Splat],
    marks: &mut [Mark],
    first: usize,
    geometry: &Geometry,
    radiance: &Radiance<'_>,
    projection: &Projection,
) -> usize {
    let end = first + slots.len();
    let mut count = 0;
    for start in (first..end).step_by(LANES) {
        let group = start..end.min(start + LANES);
        let in_front = |p: &[f32; 3]| projection.camera.to_view(*p)[2] > NEAR_Z;
        if !geometry.positions[group.clone()].iter().any(in_front) {
            continue;
        }
        let placed = projection.place(&Body::load(geometry, group.clone()));
        for (lane, i) in group.enumerate() {
            let [min, max] = placed.pixels.map(|corner| corner.map(|v| v[lane]));
            if !(min[0] < max[0] && min[1] < max[1]) {
                continue;
            }
            let colour = radiance.colour(i, placed.direction.map(|v| v[lane]));
            if !colour.iter().all(|v| v.is_finite()) {
                continue;
            }
            let pixels = PixelRect { min: min.map(whole), max: max.map(whole) };
            marks[count] = Mark { depth: placed.depth[lane].to_bits(), pixels };
            slots[count] = Splat {
                centre: placed.centre.map(|v| v[lane]),
                conic: placed.conic.map(|v| v[lane]),
                opacity: placed.opacity[lane],
                colour,
                cutoff: placed.cutoff[lane],
                pixels,
                variance_y: placed.variance_y[lane],
                // Gaussians are counted in u32 since `marked`.
                gaussian: u32::try_from(i).unwrap_or(u32::MAX),
            };
            count += 1;
        }
    }
    count
}
