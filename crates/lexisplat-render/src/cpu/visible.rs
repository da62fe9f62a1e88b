//! The Gaussians of a scene that may be visible in a picture.

use lexisplat::Geometry;
use lexisplat::simd::Simd;

use crate::parallel::*;
use crate::radiance::Radiance;

use super::clusters::Clusters;
use super::lanes::{LANES, Lanes};
use super::math::whole;
use super::project::{Body, Projection};
use super::splat::{PixelRect, Splat};

/// Number of Gaussians that one task projects, or carries changes over to.
pub(super) const GAUSSIANS_PER_TASK: usize = 1024;

/// The Gaussians that may be visible, in order of index. They are the first few of each [`GAUSSIANS_PER_TASK`] slots.
///
/// One allocation holds all slots. Many small allocations from many threads would not be returned to the system.
#[derive(Debug, Default)]
pub(super) struct Visible {
    pub(super) slots: Vec<Splat>,
    /// The pixels that each slot may touch. They are apart from the slots, because listing reads nothing else, and slots
    /// are many times as large.
    rects: Vec<PixelRect>,
}

/// Some of the Gaussians of a scene, or all of them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece<'a> {
    pub(super) geometry: &'a Geometry,
    /// The clusters of `geometry`. Clusters that a picture cannot show are skipped, if there are any.
    pub(super) clusters: Option<&'a Clusters>,
    pub(super) radiance: &'a Radiance<'a>,
}

impl Visible {
    /// Projects the Gaussians of all pieces, and overwrites those of the last picture. Replaces `keys` by the (depth,
    /// slot) of the Gaussians that may be visible, piece by piece, in order of index.
    pub(super) fn project(
        &mut self,
        keys: &mut Vec<(u32, u32)>,
        simd: Simd,
        pieces: &[Piece<'_>],
        projection: &Projection,
    ) {
        let all = pieces.iter().map(|piece| piece.geometry.len()).sum();
        self.slots.resize(all, Splat::default());
        self.rects.resize(all, PixelRect::default());
        keys.resize(all, (0, 0));
        let (mut first, mut len) = (0, 0);
        for piece in pieces {
            let end = first + piece.geometry.len();
            let counts: Vec<usize> = self.slots[first..end]
                .par_chunks_mut(GAUSSIANS_PER_TASK)
                .zip(self.rects[first..end].par_chunks_mut(GAUSSIANS_PER_TASK))
                .zip(keys[first..end].par_chunks_mut(GAUSSIANS_PER_TASK))
                .enumerate()
                .map(|(task, ((slots, rects), keys))| {
                    let own = task * GAUSSIANS_PER_TASK;
                    let mut task = Task { first: own, slot: first + own, slots, rects, keys };
                    simd.dispatch(
                        #[inline(always)]
                        || task.project(piece, projection),
                    )
                })
                .collect();
            for (task, count) in counts.into_iter().enumerate() {
                let at = first + task * GAUSSIANS_PER_TASK;
                keys.copy_within(at..at + count, len);
                len += count;
            }
            first = end;
        }
        keys.truncate(len);
    }

    /// Returns the pixels that a slot may touch.
    pub(super) fn rect(&self, slot: u32) -> PixelRect {
        self.rects[slot as usize]
    }
}

/// Returns a number of a slot or Gaussian, of which there are fewer than 2^32.
fn index(i: usize) -> u32 {
    u32::try_from(i).unwrap_or(u32::MAX)
}

/// Returns the values of one lane.
#[inline(always)]
fn at<const N: usize>(values: &[Lanes; N], lane: usize) -> [f32; N] {
    // By reference: the lanes of a group are many times as large.
    values.each_ref().map(|lanes| lanes[lane])
}

/// The projections of consecutive Gaussians.
struct Task<'a> {
    /// Index of the first Gaussian within its piece.
    first: usize,
    /// Index of the first slot.
    slot: usize,
    slots: &'a mut [Splat],
    rects: &'a mut [PixelRect],
    keys: &'a mut [(u32, u32)],
}

impl Task<'_> {
    /// Projects as many Gaussians as there are slots. Returns the number of slots that were filled.
    #[inline(always)]
    fn project(&mut self, piece: &Piece<'_>, projection: &Projection) -> usize {
        let Piece { geometry, clusters, radiance } = *piece;
        let Self { first, slot, slots, rects, keys } = self;
        let (first, first_slot) = (*first, *slot);
        let end = first + slots.len();
        let mut count = 0;
        for start in (first..end).step_by(LANES) {
            let group = start..end.min(start + LANES);
            let in_front = |p: &[f32; 3]| projection.camera.to_view(*p)[2] > projection.camera.near;
            let shows = match clusters.and_then(|clusters| clusters.at(start)) {
                Some(sphere) => projection.may_see(sphere),
                None => geometry.positions[group.clone()].iter().any(in_front),
            };
            if !shows {
                continue;
            }
            let placed = projection.place(&Body::load(geometry, group.clone()));
            for (lane, i) in group.enumerate() {
                let [min, max] = placed.pixels.each_ref().map(|corner| at(corner, lane));
                if !(min[0] < max[0] && min[1] < max[1]) {
                    continue;
                }
                let mut pixels = PixelRect { min: min.map(whole), max: max.map(whole) };
                if let Some(chosen) = &projection.chosen {
                    let Some(within) = chosen.within(pixels) else { continue };
                    pixels = within;
                }
                rects[count] = pixels;
                // Depths are positive, so the order of their bits is the order of their values.
                keys[count] = (placed.depth[lane].to_bits(), index(first_slot + count));
                slots[count] = Splat {
                    centre: at(&placed.centre, lane),
                    conic: at(&placed.conic, lane),
                    opacity: placed.opacity[lane],
                    // Directions are replaced by colours below.
                    colour: at(&placed.direction, lane),
                    cutoff: placed.cutoff[lane],
                    pixels,
                    variance_y: placed.variance_y[lane],
                    gaussian: index(i),
                };
                count += 1;
            }
        }
        // Colours have a loop of their own, which stays small enough for the compiler to keep it in registers.
        radiance.colours(
            &mut slots[..count],
            #[inline(always)]
            |slot| (slot.gaussian as usize, slot.colour),
            #[inline(always)]
            |slot, colour| slot.colour = colour,
        );
        self.keep_finite(count)
    }

    /// Leaves out those of the first `count` slots whose colours are not finite. Returns the number of slots that stay.
    fn keep_finite(&mut self, count: usize) -> usize {
        let Self { slot: first_slot, slots, rects, keys, .. } = self;
        let is_finite = |slot: &Splat| slot.colour.iter().all(|v| v.is_finite());
        let mut kept = 0;
        for k in 0..count {
            if is_finite(&slots[k]) {
                if kept < k {
                    (slots[kept], rects[kept]) = (slots[k], rects[k]);
                    keys[kept] = (keys[k].0, index(*first_slot + kept));
                }
                kept += 1;
            }
        }
        kept
    }
}
