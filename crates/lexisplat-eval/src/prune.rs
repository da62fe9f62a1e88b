//! Leaving out Gaussians that no view would miss.

use lexisplat::{Sensitivity, Silent, Splats};
use lexisplat_render::{Camera, RenderOptions, Renderer, Scene};

use crate::error::Result;
use crate::target::Views;

/// Candidates must change pictures less, each on its own, than the bound for all together, by a power of
/// this: what many small changes add up to is found by drawing.
const STRICTER: f32 = 0.7;
/// Powers tried.
const TRIES: i32 = 16;

/// What was left out.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Pruned {
    /// Gaussians left out.
    pub removed: usize,
    /// Largest change of a channel of any pixel of any view, in units of the channel (0 to 1).
    pub largest_change: f32,
    /// Views looked at.
    pub views: usize,
}

/// Leaves out Gaussians without which, all together, no channel of any pixel of any view changes by more
/// than `bound` (0 to 1). Given cameras are joined by generated views, so that what no camera saw is not
/// lost. `seen` is their [`Views::sensitivity`], and is filtered alike.
///
/// # Errors
/// None on the processor; on a GPU [`crate::Error::Render`] if the scene or a view does not fit.
///
/// # Panics
/// If `seen` and `splats` differ in length.
pub fn prune(
    renderer: &mut Renderer,
    splats: &mut Splats,
    seen: &mut Sensitivity,
    views: &Views,
    bound: f32,
) -> Result<Pruned> {
    let mut cameras: Vec<Camera> = views.all().cloned().collect();
    if views.are_given() {
        let around = Views::generated(splats);
        let more = renderer.sensitivity(&Scene::from(&*splats), around.measuring(), &Silent)?;
        for (a, b) in seen.removal.iter_mut().zip(more.removal) {
            *a = a.max(b);
        }
        cameras.extend(around.all().cloned());
    }
    let nothing = Pruned { removed: 0, largest_change: 0.0, views: cameras.len() };
    let mut last = usize::MAX;
    for power in 0..TRIES {
        // Not `powi`, whose last bit may differ between machines.
        let limit = bound * (0..power).fold(1.0, |share, _| share * STRICTER);
        let keep: Vec<bool> = seen.removal.iter().map(|&change| change > limit).collect();
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
            seen.retain(&keep);
            return Ok(Pruned { removed, largest_change, ..nothing });
        }
    }
    Ok(nothing)
}

/// Largest difference of any channel of any pixel between two scenes' pictures; of the first cameras alone
/// if it is over `bound` in one, which then goes first: what fails there is likely to fail at the next try.
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
        let views = Views::generated(&splats);
        let mut cpu = Renderer::cpu();
        let mut seen = views.sensitivity(&mut cpu, &splats, &Silent).unwrap();
        let pruned = prune(&mut cpu, &mut splats, &mut seen, &views, 0.5 / 255.0).unwrap();
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
        let views = Views::generated(&splats);
        let mut seen = Sensitivity::heuristic(&splats.geometry);
        let pruned = prune(&mut Renderer::cpu(), &mut splats, &mut seen, &views, 0.1).unwrap();
        assert_eq!(pruned.removed, 0);
        assert_eq!(splats, original);
    }
}
