//! Finds views of a scene that are like photographs of it.
//!
//! Photographs show more detail than nearly all views from random places. They are taken of things with detail, through
//! clear space, and training puts detail where photographs look. The search therefore draws many small pictures and chooses
//! the views with the most detail.

use lexisplat::packed::curve_order;
use lexisplat::{Progress, ShDegree, Splats, Stage};
use lexisplat_render::{Camera, Image, RenderOptions, Renderer, Scene, natural_views, object};

use crate::error::Result;
use crate::natural_width::natural_width;
use crate::observed_directions::ObservedDirections;
use crate::photo_views::{likelihood, turned};
use crate::size_spread::{Sizes, SizesSeen};

/// Number of natural views that are tried: [`GAUSSIANS_DRAWN`] over the number of Gaussians, within this range.
const TRIED: std::ops::RangeInclusive<usize> = 320..=640;
/// Number of natural views generated for each one that is tried.
const CHOICE: usize = 4;
/// The number of tried views over the number of those from likely places of photographs. The other tried views cover the
/// rest of the scene.
const PHOTO_SHARE: usize = 2;
/// Approximate number of Gaussians drawn in all tried views together.
const GAUSSIANS_DRAWN: usize = 128_000_000;
/// Width and height of generated views, in pixels.
pub(crate) const GENERATED_SIZE: [u32; 2] = [384, 256];
/// Width and height of the small pictures, in pixels.
pub(crate) const SMALL: [u32; 2] = [96, 64];
/// Smallest opacity in the small pictures, 5 %, before the sigmoid.
const FAINT: f32 = -3.0;
/// A pixel shows something if one of its channels is above this value.
const LIT: f32 = 0.02;
/// Least share of lit pixels in a view that looks at the scene, as a multiple of the median share. Views with less look
/// past the scene.
pub(crate) const LEAST_LIT: f64 = 0.9;
/// Least median share of lit pixels in a scene with a background. With a lower median the scene is an object before
/// nothing, and pictures of such an object show all of it. The median is 0.9 to 1 for six captures with a background, and
/// 0.45 for lego.
pub(crate) const BARE: f64 = 0.7;

/// Views like photographs, in descending order of detail.
#[derive(Debug)]
pub(crate) struct Found {
    /// Views for measuring.
    pub(crate) best: Vec<Camera>,
    /// Views for judging. None of them is in `best`.
    pub(crate) judges: Vec<Camera>,
}

/// Numbers of views to find.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ViewCounts {
    pub(crate) measuring: usize,
    pub(crate) judging: usize,
}

/// Finds `measuring` views and `judging` views, or fewer in a scene of few Gaussians, among natural views and `more`.
/// Reports [`Stage::Draw`] to `progress`, in views. `progress` can cancel.
///
/// # Errors
/// [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`]; on a GPU [`crate::Error::Render`] if the scene or a view
/// does not fit.
pub(crate) fn find(
    renderer: &mut Renderer,
    splats: &Splats,
    more: Vec<Camera>,
    ViewCounts { measuring, judging }: ViewCounts,
    progress: &dyn Progress,
) -> Result<Found> {
    let tried = (GAUSSIANS_DRAWN / splats.len().max(1)).clamp(*TRIED.start(), *TRIED.end());
    let (photo, mut others) = likely(splats, tried);
    others.extend(more);
    let sketch = sketch(splats);
    let scene = renderer.prepare(Scene::from(&sketch))?;
    let mut seen = Vec::with_capacity(photo.len() + others.len());
    progress.begin(Stage::Draw, (photo.len() + others.len()) as u64);
    for views in [photo, others] {
        let mut of_kind = Vec::with_capacity(views.len());
        for camera in views {
            progress.check()?;
            let small = camera.resized(SMALL[0], SMALL[1]);
            let picture = renderer.render(&scene, &small, &RenderOptions::default())?;
            of_kind.push((detail(&picture), lit(&picture), camera));
            progress.advance(1);
        }
        // The sort is stable: views of equal detail keep their order.
        of_kind.sort_by(|a, b| b.0.total_cmp(&a.0));
        let count = of_kind.len() as f64;
        let ranked = of_kind.into_iter().enumerate();
        // Views through clutter have the most detail, so views from likely places and other views are ranked apart.
        seen.extend(ranked.map(|(index, (_, lit, camera))| Seen {
            rank: (index as f64 + 0.5) / count,
            may_judge: index.is_multiple_of(2),
            lit,
            camera,
        }));
    }
    progress.end();
    let mut shares: Vec<f64> = seen.iter().map(|view| view.lit).collect();
    shares.sort_by(f64::total_cmp);
    let median = shares.get(shares.len() / 2).copied().unwrap_or(0.0);
    let clear = |view: &Seen| view.lit >= LEAST_LIT * median;
    // Views past the scene come last.
    seen.sort_by(|a, b| clear(b).cmp(&clear(a)).then(a.rank.total_cmp(&b.rank)));
    // The best views of each kind are used for judging and for measuring in turn, until there are enough for judging.
    let (mut best, mut judges) = (Vec::new(), Vec::new());
    for Seen { camera, may_judge, .. } in seen {
        if may_judge && judges.len() < judging {
            judges.push(camera);
        } else if best.len() < measuring {
            best.push(camera);
        }
    }
    if median < BARE {
        judges = object(&splats.geometry, judging, GENERATED_SIZE[0], GENERATED_SIZE[1]);
    }
    let width = natural_width(&splats.geometry, &judges);
    let height = (width * GENERATED_SIZE[1] / GENERATED_SIZE[0]).max(1);
    for camera in best.iter_mut().chain(&mut judges) {
        *camera = camera.resized(width, height);
    }
    Ok(Found { best, judges })
}

/// A view that was tried.
struct Seen {
    /// Rank by detail among the views of its kind, from 0 to 1, divided by their number.
    rank: f64,
    /// Whether the view may judge: true for every second view of its kind.
    may_judge: bool,
    /// Share of the pixels that show something.
    lit: f64,
    camera: Camera,
}

/// Returns `count` natural views of `splats`, evenly spread over its opaque Gaussians in their order. Each is the
/// one of a few neighbours from which Gaussians look most alike in size.
pub(crate) fn evenly(splats: &Splats, count: usize) -> Vec<Camera> {
    let views = natural_views(&splats.geometry, CHOICE * count, GENERATED_SIZE);
    let sizes = Sizes::of(&splats.geometry);
    let least = |few: &[Camera]| {
        let spreads = few.iter().map(|view| sizes.seen_from(view.position).spread);
        let least = spreads.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        least.map(|(k, _)| few[k].clone())
    };
    views.chunks(CHOICE).filter_map(least).collect()
}

/// Returns two lists of natural views of `splats` to try. The first has views from likely places of photographs. It is
/// empty if no colour depends on the view. The second has views from which Gaussians look most alike in size. Without the
/// first list it has `count` views; otherwise both have half as many.
pub(crate) fn likely(splats: &Splats, count: usize) -> (Vec<Camera>, Vec<Camera>) {
    let views = natural_views(&splats.geometry, CHOICE * count, GENERATED_SIZE);
    let sizes = Sizes::of(&splats.geometry);
    let sizes: Vec<SizesSeen> = views.iter().map(|view| sizes.seen_from(view.position)).collect();
    let best = |cost: &dyn Fn(usize) -> f64, count: usize| {
        let mut order: Vec<usize> = (0..views.len()).collect();
        order.sort_by(|&a, &b| cost(a).total_cmp(&cost(b)));
        order.truncate(count);
        order
    };
    let mut others = best(&|k| sizes[k].spread, count);
    others.sort_unstable();
    let observed = ObservedDirections::of(splats);
    let mut photo = Vec::new();
    if !observed.is_empty() {
        let likelihoods: Vec<f64> =
            (0..views.len()).map(|k| likelihood(&observed, views[k].position, &sizes[k])).collect();
        let chosen = best(&|k| -likelihoods[k], count / PHOTO_SHARE);
        photo = chosen.iter().map(|&k| turned(&views[k], k, &observed)).collect();
        // The other views are thinned by the same factor, evenly.
        others = others.into_iter().step_by(PHOTO_SHARE).collect();
    }
    (photo, others.into_iter().map(|k| views[k].clone()).collect())
}

/// Returns a copy of `splats` that is faster to draw: without view-dependent colour, without Gaussians that are hardly
/// visible, and in an order that puts neighbours side by side.
pub(crate) fn sketch(splats: &Splats) -> Splats {
    let mut sketch = splats.with_degree_cut(ShDegree::ZERO);
    let keep: Vec<bool> = splats.geometry.opacities.iter().map(|&opacity| opacity > FAINT).collect();
    sketch.retain(&keep);
    sketch.gathered(&curve_order(&sketch.geometry))
}

/// Returns the share of the pixels that show something.
pub(crate) fn lit(picture: &Image) -> f64 {
    let lit = picture.pixels.iter().filter(|pixel| pixel.iter().any(|value| *value > LIT)).count();
    lit as f64 / picture.pixels.len().max(1) as f64
}

/// Returns the mean absolute difference of neighbouring pixels, summed over the channels and over both directions.
pub(crate) fn detail(picture: &Image) -> f64 {
    let width = picture.width as usize;
    let difference = |a: &[f32; 3], b: &[f32; 3]| -> f64 {
        let channel = |k: usize| f64::from((a[k].clamp(0.0, 1.0) - b[k].clamp(0.0, 1.0)).abs());
        channel(0) + channel(1) + channel(2)
    };
    let rows = picture.pixels.chunks_exact(width.max(1));
    let across: f64 = rows.flat_map(|row| row.windows(2)).map(|pair| difference(&pair[0], &pair[1])).sum();
    let below = picture.pixels.iter().skip(width);
    let down: f64 = picture.pixels.iter().zip(below).map(|(a, b)| difference(a, b)).sum();
    (across + down) / picture.pixels.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat_render::{render, surround};
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    fn found(splats: &Splats) -> Found {
        let counts = ViewCounts { measuring: 10, judging: 6 };
        let more = surround(&splats.geometry, 8, GENERATED_SIZE, [2.0, 12.0]);
        find(&mut Renderer::cpu(), splats, more, counts, &Silent).unwrap()
    }

    #[test]
    fn views_of_detail_measure_and_others_of_it_judge() {
        let splats = scene(&SampleOptions::new(1500, 3));
        let Found { best, judges } = found(&splats);
        assert_eq!((best.len(), judges.len()), (10, 6));
        assert!(judges.iter().all(|judge| !best.contains(judge)));
        let again = found(&splats);
        assert!(again.best == best && again.judges == judges);
        let mean_detail = |views: &[Camera]| {
            let draw = |view: &Camera| {
                let small = view.resized(SMALL[0], SMALL[1]);
                render(&Scene::from(&splats), &small, &RenderOptions::default()).unwrap()
            };
            views.iter().map(|view| detail(&draw(view))).sum::<f64>() / views.len() as f64
        };
        let others = natural_views(&splats.geometry, 60, GENERATED_SIZE);
        assert!(mean_detail(&best) > 1.2 * mean_detail(&others));
        assert!(mean_detail(&judges) > 1.2 * mean_detail(&others));
    }

    #[test]
    fn an_object_before_nothing_is_judged_from_a_ring() {
        let mut splats = scene(&SampleOptions::new(1500, 3));
        // A flat piece of the scene, of which most natural views show little.
        let near: Vec<bool> = splats.geometry.positions.iter().map(|p| p[1].abs() < 0.02).collect();
        splats.retain(&near);
        splats.geometry.scales.iter_mut().for_each(|scales| *scales = scales.map(|s| s.min(-4.5)));
        let Found { judges, .. } = found(&splats);
        let [width, height] = [judges[0].width, judges[0].height];
        let ring = object(&splats.geometry, 6, GENERATED_SIZE[0], GENERATED_SIZE[1]);
        let ring: Vec<Camera> = ring.iter().map(|camera| camera.resized(width, height)).collect();
        assert_eq!(judges, ring);
    }

    #[test]
    fn scenes_without_anything_have_views() {
        let mut splats = scene(&SampleOptions::new(10, 3));
        splats.retain(&[false; 10]);
        let Found { best, judges } = found(&splats);
        assert!(best.len() + judges.len() > 0);
    }

    #[test]
    fn evenly_spread_views_show_a_few_gaussians_far_from_all_others() {
        let mut splats = scene(&SampleOptions::new(1350, 3));
        let mut few = scene(&SampleOptions::new(150, 4));
        let place = [1000.0, 0.0, 0.0];
        for position in &mut few.geometry.positions {
            *position = std::array::from_fn(|k| position[k] + place[k]);
        }
        splats.append(few);
        let splats = splats.gathered(&curve_order(&splats.geometry));
        // The one view in ten that is of them looks at their middle, from no farther than they are from the others.
        let shows = |camera: &&Camera| {
            let [x, y, z] = camera.to_view(place);
            z > 0.0 && z < 500.0 && x.hypot(y) < z
        };
        let count = evenly(&splats, 40).iter().filter(shows).count();
        assert!((2..8).contains(&count), "{count}");
    }
}
