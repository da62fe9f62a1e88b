//! Removes Gaussians until their number is at most a limit.

use lexisplat::{Progress, Sensitivity, Splats, Stage};
use lexisplat_render::{Renderer, Scene};

use crate::error::Result;
use crate::only_cancels::OnlyCancels;
use crate::packing_views::PackingViews;
use crate::refit::Fit;

/// Largest share of the Gaussians to remove before the sensitivity is measured again. A Gaussian shows more once its
/// neighbours are gone (docs/METHOD.md, "At most so many").
const SHARE: f64 = 0.25;

/// Returns at most `most` Gaussians of `splats`, those that show most, and their sensitivity in `views`. Their base colours
/// and opacities are fitted to the targets of `fit`, which are pictures of all Gaussians. `sensitivity` is the sensitivity
/// of `splats`.
///
/// # Errors
/// As [`PackingViews::sensitivity`].
pub(crate) fn at_most(
    most: usize,
    splats: &Splats,
    sensitivity: Sensitivity,
    views: &PackingViews,
    renderer: &mut Renderer,
    fit: &Fit,
    progress: &dyn Progress,
) -> Result<(Splats, Sensitivity)> {
    let (mut splats, mut sensitivity) = (splats.clone(), sensitivity);
    progress.begin(Stage::Look, (splats.len().saturating_sub(most)) as u64);
    let inner = &OnlyCancels(progress);
    while splats.len() > most {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a number")]
        let share = (splats.len() as f64 * SHARE).ceil() as usize;
        let keep = all_but(share.min(splats.len() - most), &sensitivity.opacity);
        let before = splats.len();
        splats.retain(&keep);
        sensitivity.retain(&keep);
        let fitted = fit.appearances(Scene::from(&splats), &sensitivity.appearances(), inner)?;
        fitted.iter().enumerate().for_each(|(i, shown)| shown.give(&mut splats.geometry, i));
        sensitivity = views.sensitivity(renderer, &splats, inner)?;
        progress.advance((before - splats.len()) as u64);
    }
    progress.end();
    Ok((splats, sensitivity))
}

/// Returns a mark for each of `changes`: false for the `count` smallest, true for the others. Of equal changes the last are
/// marked false first.
fn all_but(count: usize, changes: &[f32]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..changes.len()).collect();
    order.sort_by(|&a, &b| changes[a].total_cmp(&changes[b]).then(b.cmp(&a)));
    let mut keep = vec![true; changes.len()];
    order.iter().take(count).for_each(|&i| keep[i] = false);
    keep
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;
    use crate::views::Viewpoints;
    use crate::{Judge, Looked};

    #[test]
    fn the_smallest_go() {
        assert_eq!(all_but(3, &[0.5, 0.1, 0.3, 0.1, 0.3]), [true, false, true, false, false]);
        assert_eq!(all_but(1, &[0.0, 0.0]), [true, false]);
        assert_eq!(all_but(0, &[0.0]), [true]);
    }

    #[test]
    fn what_stays_is_more_like_all_than_what_a_guess_leaves() {
        let all = scene(&SampleOptions::new(1000, 3));
        let mut cpu = Renderer::cpu();
        let Looked { views, sensitivity } =
            Looked::at(&mut cpu, &all, None, Viewpoints::Auto, &Silent).unwrap();
        let fit = Fit::to(&all, views.fitting(&all), views.are_given(), &Silent).unwrap();
        let made = at_most(400, &all, sensitivity, &views, &mut cpu, &fit, &Silent).unwrap();
        assert_eq!((made.0.len(), made.1.len()), (400, 400));
        let mut guessed = all.clone();
        guessed.retain(&all_but(600, &Sensitivity::guess(&all.geometry).opacity));
        assert_eq!(guessed.len(), 400);
        let mut judge = Judge::new(cpu, &all, &views.some_judging(12), false, &Silent).unwrap();
        let [made, guessed] = [&made.0, &guessed].map(|scene| judge.score(scene, &Silent).unwrap().mean);
        assert!(made > guessed + 3.0, "{made} {guessed}");
    }
}
