//! Pruning: Gaussians that no view would miss are left out.

use lexisplat::{Progress, Sensitivity, Splats};
use lexisplat_render::{Camera, RenderOptions, Renderer, Scene};
use serde::Serialize;

use super::views::PackingViews;
use crate::error::{Error, Result};

/// Largest value of an 8-bit channel.
pub(super) const LEVELS: f32 = 255.0;
/// Factor by which the limit for one Gaussian falls from one try to the next. Many small changes add up, and
/// only drawing shows to how much.
const STRICTER: f32 = 0.7;
/// Number of limits tried.
const TRIES: i32 = 16;

/// What pruning did.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Pruned {
    /// Number of Gaussians left out.
    #[serde(rename = "gaussians")]
    pub removed: usize,
    /// Largest change of a channel of any pixel of any view, in units of the channel (0 to 1).
    pub largest_change: f32,
    /// Number of views that were compared.
    pub views: usize,
}

/// Leaves Gaussians out as long as no channel of any pixel of any view changes by more than `levels` of 255.
/// Views generated from all around join given cameras, so that what no camera saw is not lost. `sensitivity`
/// is the one that `views` measured. It is filtered as `splats` are.
///
/// # Errors
/// [`Error::Parameter`] if `levels` is not finite and above 0, or if `sensitivity` and `splats` differ in
/// length. On a GPU [`Error::Render`] if the scene or a view does not fit.
pub fn prune(
    renderer: &mut Renderer,
    splats: &mut Splats,
    sensitivity: &mut Sensitivity,
    views: &PackingViews,
    levels: f32,
    progress: &dyn Progress,
) -> Result<Pruned> {
    if !levels.is_finite() || levels <= 0.0 {
        return Err(Error::parameter("prune", levels, "a finite number above 0"));
    }
    if sensitivity.len() != splats.len() {
        return Err(Error::parameter("sensitivity", sensitivity.len(), "one entry a Gaussian"));
    }
    let bound = levels / LEVELS;
    let mut cameras: Vec<Camera> = views.all().cloned().collect();
    if views.are_given() {
        let around = PackingViews::generated(splats);
        let more = renderer.sensitivity(&Scene::from(&*splats), around.measuring(), progress)?;
        for (a, b) in sensitivity.removal.iter_mut().zip(more.removal) {
            *a = a.max(b);
        }
        cameras.extend(around.all().cloned());
    }
    let nothing = Pruned { removed: 0, largest_change: 0.0, views: cameras.len() };
    let mut last = usize::MAX;
    for power in 0..TRIES {
        progress.check()?;
        // `powi` may differ between machines in its last bit.
        let limit = bound * (0..power).fold(1.0, |share, _| share * STRICTER);
        let keep: Vec<bool> = sensitivity.removal.iter().map(|&change| change > limit).collect();
        let removed = keep.iter().filter(|&&k| !k).count();
        if removed == 0 {
            return Ok(nothing);
        }
        if std::mem::replace(&mut last, removed) == removed {
            continue;
        }
        let mut rest = splats.clone();
        rest.retain(&keep);
        let largest_change = largest_change(renderer, [splats, &rest], &mut cameras, bound)?;
        if largest_change <= bound {
            *splats = rest;
            sensitivity.retain(&keep);
            return Ok(Pruned { removed, largest_change, ..nothing });
        }
    }
    Ok(nothing)
}

/// Returns the largest difference of any channel of any pixel between the pictures of two scenes. Stops at the
/// first camera whose difference is over `bound`, and puts it first: the next try is likely to fail there too.
fn largest_change(
    renderer: &mut Renderer,
    scenes: [&Splats; 2],
    cameras: &mut [Camera],
    bound: f32,
) -> Result<f32> {
    let [a, b] = scenes;
    let (a, b) = (renderer.prepare(Scene::from(a))?, renderer.prepare(Scene::from(b))?);
    let mut largest = 0.0;
    for k in 0..cameras.len() {
        let mut draw = |scene| renderer.render(scene, &cameras[k], &RenderOptions::default());
        let (a, b) = (draw(&a)?, draw(&b)?);
        let pairs = a.pixels.as_flattened().iter().zip(b.pixels.as_flattened());
        largest = pairs.map(|(a, b)| (a.clamp(0.0, 1.0) - b.clamp(0.0, 1.0)).abs()).fold(largest, f32::max);
        if largest > bound {
            cameras.swap(0, k);
            break;
        }
    }
    Ok(largest)
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    #[test]
    fn what_is_hidden_or_invisible_goes_and_the_rest_stays() {
        let mut splats = scene(&SampleOptions::new(800, 3));
        // Too transparent to be drawn; seen from nowhere.
        for i in (0..80).map(|k| 10 * k) {
            splats.geometry.opacities[i] = -8.0;
        }
        let original = splats.clone();
        let views = PackingViews::generated(&splats);
        let mut cpu = Renderer::cpu();
        let mut seen = views.sensitivity(&mut cpu, &splats, &Silent).unwrap();
        let pruned = prune(&mut cpu, &mut splats, &mut seen, &views, 0.5, &Silent).unwrap();
        assert!(pruned.removed >= 80, "{pruned:?}");
        assert!(pruned.largest_change <= 0.5 / 255.0);
        assert_eq!(splats.len() + pruned.removed, original.len());
        assert_eq!(seen.len(), splats.len());
        assert!(splats.geometry.opacities.iter().all(|&o| o > -8.0));
        for camera in views.all() {
            let only = &mut [camera.clone()];
            assert!(largest_change(&mut cpu, [&original, &splats], only, 1.0).unwrap() <= 0.5 / 255.0);
        }
    }

    #[test]
    fn nothing_goes_where_everything_shows() {
        let mut splats = scene(&SampleOptions::new(60, 3));
        let original = splats.clone();
        let views = PackingViews::generated(&splats);
        let mut seen = Sensitivity::heuristic(&splats.geometry);
        let pruned = prune(&mut Renderer::cpu(), &mut splats, &mut seen, &views, 25.5, &Silent).unwrap();
        assert_eq!(pruned.removed, 0);
        assert_eq!(splats, original);
    }
}
