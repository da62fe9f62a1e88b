//! The choice of the chunks that a view shows within a budget.

use super::budget::{Budget, Eye};
use super::outline::{ChunkOutline, Outline, RangeKind};
use crate::support::order::order;

/// Least factor on the need for detail of a chunk by the share of it that is in the cone of view. Chunks beside the cone stay
/// coarse, and are there when the eye turns.
const BESIDE: f32 = 1.0 / 32.0;
/// Factor on the need for the ranges of a chunk that are not needed at once: refinements, and SH-rest of smaller values.
const FINE: f32 = 0.25;
/// Share of the radius of a chunk's bounds that counts as a distance to it, beside the distance to the bounds: its Gaussians
/// are spread within, and few of them lie at the nearest point.
const SPREAD: f32 = 0.15;
/// Number of points along each axis of a chunk's bounds by which the share of the chunk in the cone of view is estimated.
const POINTS: usize = 4;

/// The need for a chunk whose detail no pixel shows.
const UNWANTED: f32 = -1.0;

/// The chunks to draw, and the ranges to hold of them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Selection {
    /// Numbers of the chunks in [`Outline::chunks`], those needed most first. No chunk comes before the chunks of the layer
    /// before it in whose cells it lies.
    pub chunks: Vec<usize>,
    /// Numbers of the ranges in [`Outline::ranges`], those needed most first.
    pub ranges: Vec<usize>,
    /// Number of Gaussians of the chunks.
    pub splats: u64,
    /// Number of bytes of the ranges.
    pub bytes: u64,
}

/// A step that a selection may take.
#[derive(Clone, Copy)]
struct Step {
    chunk: usize,
    layer: usize,
    /// Whether these are the ranges of the chunk that are not needed at once.
    is_fine: bool,
    need: f32,
    distance: f32,
}

impl Outline {
    /// Chooses the chunks that `eye` sees, as finely as `budget` allows.
    ///
    /// The first layer comes first, near chunks before far ones. Then a chunk comes the sooner, the farther apart the
    /// Gaussians of the layers before it are seen to be where it lies, and the more of it is seen. A chunk is chosen only
    /// with all chunks of the layer before it that lie around it. So where a chunk is missing, the Gaussians of those layers
    /// stand for it ([`ChunkOutline::next`]). A step for which there is no room is left out, and smaller ones may follow.
    ///
    /// Ranges of kinds that `wanted` refuses are not chosen.
    #[must_use]
    pub fn select(&self, eye: &Eye, budget: &Budget, wanted: &dyn Fn(RangeKind) -> bool) -> Selection {
        let steps = self.steps(eye);
        let by_need = |a: usize, b: usize| match (steps.get(a), steps.get(b)) {
            (Some(a), Some(b)) => {
                let nearer = a.distance.total_cmp(&b.distance);
                b.need.total_cmp(&a.need).then(a.layer.cmp(&b.layer)).then(nearer)
            }
            _ => a.cmp(&b),
        };
        let mut of_chunk = vec![[Vec::new(), Vec::new()]; self.chunks.len()];
        for (r, range) in self.ranges.iter().enumerate().filter(|(_, range)| wanted(range.kind)) {
            let is_fine = matches!(range.kind, RangeKind::Refinement(_) | RangeKind::Sh(1..));
            if let Some(ranges) = of_chunk.get_mut(range.chunk) {
                ranges[usize::from(is_fine)].push(r);
            }
        }
        let mut missing = self.missing();
        let mut selection = Selection::default();
        let mut is_chosen = vec![false; self.chunks.len()];
        for step in order(steps.len(), &mut { by_need }).into_iter().filter_map(|i| steps.get(i)) {
            let c = step.chunk;
            let (Some(chunk), Some(ranges)) = (self.chunks.get(c), of_chunk.get_mut(c)) else { continue };
            let new = if step.is_fine { 0 } else { chunk.gaussians as u64 };
            let ranges = std::mem::take(&mut ranges[usize::from(step.is_fine)]);
            let lengths = ranges.iter().filter_map(|&r| self.ranges.get(r)).map(|range| &range.bytes);
            let bytes: u64 = lengths.map(|bytes| bytes.end.saturating_sub(bytes.start)).sum();
            let may_come =
                if step.is_fine { is_chosen.get(c) == Some(&true) } else { missing.get(c) == Some(&0) };
            let fits = selection.splats.saturating_add(new) <= budget.splats
                && selection.bytes.saturating_add(bytes) <= budget.bytes;
            if !may_come || !fits {
                continue;
            }
            selection.splats += new;
            selection.bytes += bytes;
            selection.ranges.extend(ranges);
            if !step.is_fine {
                selection.chunks.push(c);
                if let Some(chosen) = is_chosen.get_mut(c) {
                    *chosen = true;
                }
                let next = missing.get_mut(chunk.next.clone()).unwrap_or_default();
                next.iter_mut().for_each(|missing| *missing -= 1);
            }
        }
        selection
    }

    /// Returns for each chunk the number of chunks of the layer before it that lie around it.
    fn missing(&self) -> Vec<usize> {
        let mut missing = vec![0; self.chunks.len()];
        for chunk in &self.chunks {
            let next = missing.get_mut(chunk.next.clone()).unwrap_or_default();
            next.iter_mut().for_each(|missing| *missing += 1);
        }
        missing
    }

    /// Returns all steps: each chunk without and with its fine ranges.
    fn steps(&self, eye: &Eye) -> Vec<Step> {
        let mut before = 0_u64;
        // The ratio of the Gaussians of a layer to those of all layers before it.
        let ratios: Vec<f32> = (self.layers.iter())
            .map(|layer| {
                let ratio = layer.gaussians as f32 / before as f32;
                before += layer.gaussians;
                ratio
            })
            .collect();
        let mut steps: Vec<Step> = Vec::with_capacity(2 * self.chunks.len());
        let mut needs = vec![UNWANTED; self.chunks.len()];
        // Chunks of later layers have larger numbers.
        for (c, chunk) in self.chunks.iter().enumerate().rev() {
            let Sight { distance, share } = sight(chunk, eye);
            let spacing = |ratio: f32| spacing(chunk, ratio) / distance.max(f32::MIN_POSITIVE);
            let angle = spacing(ratios.get(chunk.layer).copied().unwrap_or(0.0));
            let weight = share.sqrt().max(BESIDE);
            // Bounds in files are any numbers, and of some there is no angle.
            let own = if angle < eye.pixel { UNWANTED } else { (weight * angle).max(0.0) };
            // The chunks of the next layer around it cannot come without it.
            let next = needs.get(chunk.next.clone()).unwrap_or_default();
            let need = next.iter().copied().fold(own, f32::max);
            let need = if chunk.layer == 0 { f32::INFINITY } else { need };
            if need == UNWANTED {
                continue;
            }
            if let Some(of_chunk) = needs.get_mut(c) {
                *of_chunk = need;
            }
            let distance = distance / weight;
            let step = Step { chunk: c, layer: chunk.layer, is_fine: false, need, distance };
            // The Gaussians of the chunk itself are closer to each other.
            let fine = (FINE * weight * spacing(1.0)).min(need);
            steps.extend([step, Step { is_fine: true, need: fine, ..step }]);
        }
        steps
    }
}

/// The place of a chunk in a view.
struct Sight {
    /// Distance from the eye to the Gaussians of the chunk, about.
    distance: f32,
    /// Share of its bounds that the cone of view holds.
    share: f32,
}

fn sight(chunk: &ChunkOutline, eye: &Eye) -> Sight {
    let [least, most] = chunk.bounds;
    let square = |v: [f32; 3]| v.iter().map(|x| x * x).sum::<f32>();
    let radius = 0.5 * square(std::array::from_fn(|k| most[k] - least[k])).sqrt();
    let distance = (chunk.square_distance(eye.position) + (SPREAD * radius).powi(2)).sqrt();
    let Some(forward) = eye.forward else { return Sight { distance, share: 1.0 } };
    let limit = libm::cosf(eye.half_angle.clamp(0.0, std::f32::consts::PI)) * square(forward).sqrt();
    let is_inside = |point: &usize| {
        let place = [point % POINTS, point / POINTS % POINTS, point / (POINTS * POINTS)];
        let way: [f32; 3] = std::array::from_fn(|k| {
            let part = (place[k] as f32 + 0.5) / POINTS as f32;
            least[k] + part * (most[k] - least[k]) - eye.position[k]
        });
        (0..3).map(|k| way[k] * forward[k]).sum::<f32>() >= limit * square(way).sqrt()
    };
    let inside = (0..POINTS.pow(3)).filter(is_inside).count();
    Sight { distance, share: inside as f32 / POINTS.pow(3) as f32 }
}

/// Returns how far apart the Gaussians of earlier layers are within the bounds of `chunk`, which has `ratio` times as many
/// Gaussians as they have there. They are taken to lie on a surface as large as half of that of the bounds.
fn spacing(chunk: &ChunkOutline, ratio: f32) -> f32 {
    let [least, most] = chunk.bounds;
    let [x, y, z]: [f32; 3] = std::array::from_fn(|k| (most[k] - least[k]).max(0.0));
    ((x * y + y * z + z * x) * ratio / chunk.gaussians.max(1) as f32).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packed::decode::outline::{LayerOutline, RangeOutline};

    /// Chunks of each layer along the x axis: so many, of so many Gaussians each, over the same length.
    const LAYERS: [(usize, usize); 3] = [(1, 100), (4, 100), (16, 100)];
    const LENGTH: f32 = 160.0;

    fn outline() -> Outline {
        let mut outline = Outline::default();
        let mut start = 0;
        for (layer, (count, gaussians)) in LAYERS.into_iter().enumerate() {
            let first = outline.chunks.len();
            let chunks = first..first + count;
            outline.layers.push(LayerOutline {
                gaussians: (count * gaussians) as u64,
                chunks: chunks.clone(),
                refinements: 1,
                sh_parts: 2,
            });
            for c in chunks {
                let k = c - first;
                let side = LENGTH / count as f32;
                let bounds = [[k as f32 * side, 0.0, 0.0], [(k + 1) as f32 * side, 10.0, 10.0]];
                let next = if layer < 2 { first + count + 4 * k..first + count + 4 * k + 4 } else { 0..0 };
                outline.chunks.push(ChunkOutline { layer, gaussians, bounds, next, ..Default::default() });
                for (kind, length) in [
                    (RangeKind::Base, 1000),
                    (RangeKind::Sh(0), 10),
                    (RangeKind::Refinement(0), 100),
                    (RangeKind::Sh(1), 100),
                ] {
                    let bytes = start..start + length;
                    start += length;
                    outline.ranges.push(RangeOutline { chunk: c, kind, bytes, checksum: 0, integers: 0 });
                }
            }
        }
        outline
    }

    fn select(eye: &Eye, budget: &Budget) -> Selection {
        outline().select(eye, budget, &|_| true)
    }

    /// The chunks of the last layer that are chosen, from 0 to 15.
    fn finest(selection: &Selection) -> Vec<usize> {
        let mut chunks: Vec<usize> = selection.chunks.iter().filter_map(|c| c.checked_sub(5)).collect();
        chunks.sort_unstable();
        chunks
    }

    #[test]
    fn what_is_near_comes_first() {
        for k in 0..16 {
            let eye = Eye::at([10.0 * k as f32 + 5.0, 5.0, -1.0]);
            let found = select(&eye, &Budget::default().with_splats(300_u64));
            assert_eq!(finest(&found), [k]);
            assert_eq!((found.chunks[0], found.splats), (0, 300));
        }
    }

    #[test]
    fn what_lies_beside_the_view_stays_coarse() {
        let eye = Eye::at([80.0, 5.0, 5.0]).with_half_angle(0.5);
        let budget = Budget::default().with_splats(1000_u64);
        let right = finest(&select(&eye.with_forward([2.0, 0.0, 0.0]), &budget));
        let left = finest(&select(&eye.with_forward([-0.1, 0.0, 0.0]), &budget));
        assert!(right.len() > 2 && left.len() > 2);
        assert!(right.iter().all(|&k| k >= 7) && left.iter().all(|&k| k < 9), "{left:?} {right:?}");
    }

    #[test]
    fn nothing_finer_than_a_pixel_is_chosen() {
        let eye = |pixel| Eye::at([-1000.0, 5.0, 5.0]).with_pixel(pixel);
        let splats = |pixel| select(&eye(pixel), &Budget::default()).splats;
        assert_eq!([splats(0.0), splats(1e-6), splats(0.1)], [2100, 2100, 100]);
        let some: Vec<u64> = (1..100).map(|k| splats(0.0001 * k as f32)).collect();
        assert!(some.is_sorted_by(|a, b| a >= b) && some.contains(&500));
    }

    /// A few bytes show all chunks before any of them is fine.
    #[test]
    fn refinements_wait_for_what_shows_more() {
        let eye = Eye::at([5.0, 5.0, -100.0]);
        let all = select(&eye, &Budget::default());
        assert_eq!((all.splats, all.bytes), (2100, 21 * 1210));
        let outline = outline();
        let kinds: Vec<RangeKind> = all.ranges.iter().map(|&r| outline.ranges[r].kind).collect();
        assert_eq!(kinds[..4], [RangeKind::Base, RangeKind::Sh(0), RangeKind::Base, RangeKind::Sh(0)]);
        // A step that does not fit is left out, and smaller steps follow.
        let tight = select(&eye, &Budget::default().with_bytes(1210_u64));
        assert_eq!((tight.chunks, tight.bytes), (vec![0], 1210));
    }

    #[test]
    fn a_scene_in_other_units_is_seen_alike() {
        let budget = Budget::default().with_splats(1000_u64);
        let look = |unit: f32| {
            let mut outline = outline();
            outline
                .chunks
                .iter_mut()
                .for_each(|chunk| chunk.bounds = chunk.bounds.map(|x| x.map(|x| unit * x)));
            let eye = Eye::at([unit * 80.0, unit * 5.0, unit * 5.0]).with_half_angle(0.5).with_pixel(0.01);
            outline.select(&eye.with_forward([1.0, 0.0, 0.0]), &budget, &|_| true)
        };
        // Powers of two leave all roundings as they are.
        for unit in [1.0 / 1024.0, 4096.0] {
            assert_eq!(look(unit), look(1.0));
        }
    }

    /// Bounds in a file may be any finite numbers.
    #[test]
    fn wild_bounds_and_eyes_are_no_fault() {
        let mut outline = outline();
        for (k, chunk) in outline.chunks.iter_mut().enumerate() {
            let wild = [f32::MAX, -f32::MAX, 0.0, f32::MIN_POSITIVE][k % 4];
            chunk.bounds = [[wild, 0.0, -wild], [-wild, wild, 0.0]];
        }
        for forward in [[0.0; 3], [f32::NAN; 3], [f32::MAX; 3]] {
            let eye = Eye::at([f32::INFINITY, 0.0, f32::NAN]).with_forward(forward);
            let found = outline.select(&eye, &Budget::default(), &|_| true);
            assert_eq!(found.splats, 2100);
        }
    }
}
