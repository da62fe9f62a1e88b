//! Removes and merges Gaussians until their number is at most a limit.

use lexisplat::{Progress, Sensitivity, Splats, Stage};
use lexisplat_render::{Renderer, Scene};

use crate::error::Result;
use crate::merge::lessened;
use crate::packing_views::PackingViews;
use crate::refit::Fit;

/// Largest share of the Gaussians by which there are fewer before the sensitivity is measured again. A Gaussian shows more once its
/// neighbours are gone (docs/METHOD.md, "At most so many").
const SHARE: f64 = 0.25;
/// Quality of all Gaussians, in dB, from which the number is interpolated if the first removal goes too far. Identical
/// pictures have no finite PSNR.
const FIRST_DB: f64 = 60.0;
/// Fall of the quality by one removal, as a share of the fall by the removal before, in dB for the same share of Gaussians. It is 0.50
/// (room) to 0.77 (room-large) near 40 dB.
const NEXT_FALL: f64 = 0.6;
/// Amount by which the quality after the last removal may exceed the quality asked for, in dB. If it is more, a little more is removed.
const SPARE_DB: f64 = 0.4;

/// Removes and merges Gaussians, and fits base colours and opacities of the others.
pub(crate) struct Removal<'a> {
    /// The views that measure.
    pub(crate) views: &'a PackingViews,
    pub(crate) renderer: &'a mut Renderer,
    /// The views to fit to, and their pictures of all Gaussians.
    pub(crate) fit: &'a Fit,
    pub(crate) progress: &'a dyn Progress,
}

impl Removal<'_> {
    /// Makes at most `most` Gaussians of `splats`. Returns them and their sensitivity. `sensitivity` is the
    /// sensitivity of `splats`.
    ///
    /// # Errors
    /// As [`PackingViews::sensitivity`].
    pub(crate) fn at_most(
        &mut self,
        most: usize,
        splats: &Splats,
        sensitivity: Sensitivity,
    ) -> Result<(Splats, Sensitivity)> {
        let (mut splats, mut sensitivity) = (splats.clone(), sensitivity);
        self.progress.begin(Stage::Look, (splats.len().saturating_sub(most)) as u64);
        while splats.len() > most {
            let count = share_of(&splats).min(splats.len() - most);
            let keep = lessened(&mut splats, &sensitivity, count);
            let before = splats.len();
            splats.retain(&keep);
            sensitivity.retain(&keep);
            let fitted =
                self.fit.appearances(Scene::from(&splats), &sensitivity.appearances(), self.progress)?;
            fitted.iter().enumerate().for_each(|(i, shown)| shown.give(&mut splats.geometry, i));
            sensitivity = self.views.sensitivity(self.renderer, &splats, self.progress)?;
            self.progress.advance((before - splats.len()) as u64);
        }
        self.progress.end();
        Ok((splats, sensitivity))
    }

    /// Makes `splats` fewer while their `quality` is at least `decibels`, about. Returns them and their sensitivity, as
    /// [`Self::at_most`] does. The number after the last whole removal follows from the falls of the quality before, so that no
    /// removal goes too far and is made once more.
    ///
    /// # Errors
    /// As [`Self::at_most`], and errors of `quality`.
    pub(crate) fn down_to(
        &mut self,
        decibels: f64,
        splats: &Splats,
        sensitivity: Sensitivity,
        quality: &mut dyn FnMut(&Splats) -> Result<f64>,
    ) -> Result<(Splats, Sensitivity)> {
        let (mut splats, mut sensitivity) = (splats.clone(), sensitivity);
        // The quality after the last removal, and its fall by that removal. The fall by the first removal is not known.
        let (mut last, mut fall) = (None, None);
        while splats.len() > 1 {
            let before = last.unwrap_or(FIRST_DB);
            if let Some(next) = fall.map(|fall: f64| NEXT_FALL * fall).filter(|next| before - next < decibels)
            {
                let share = (before - decibels) / next;
                let made = self.at_most(after_share(&splats, share), &splats, sensitivity)?;
                let after = quality(&made.0)?;
                if after < decibels + SPARE_DB {
                    return Ok(made);
                }
                // The quality falls less from removal to removal, so this does not go too far.
                let share = share * (after - decibels) / (before - after);
                return self.at_most(after_share(&made.0, share), &made.0, made.1);
            }
            let fewer = self.at_most(after_share(&splats, 1.0), &splats, sensitivity.clone())?;
            let after = quality(&fewer.0)?;
            if after < decibels {
                let share = (before - decibels) / (before - after);
                return self.at_most(after_share(&splats, share), &splats, sensitivity);
            }
            fall = last.map(|before| before - after);
            (splats, sensitivity, last) = (fewer.0, fewer.1, Some(after));
        }
        Ok((splats, sensitivity))
    }
}

/// Returns how many Gaussians stay after a share, between 0 and 1, of one removal. The quality falls about evenly with the logarithm of
/// the number.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of Gaussians")]
fn after_share(splats: &Splats, share: f64) -> usize {
    let len = splats.len() as f64;
    let whole = (splats.len() - share_of(splats)) as f64;
    (len * libm::pow(whole / len, share.clamp(0.0, 1.0))).round() as usize
}

/// Returns by how many Gaussians there are fewer at once.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a number")]
fn share_of(splats: &Splats) -> usize {
    (splats.len() as f64 * SHARE).ceil() as usize
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat_render::orbit;
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;
    use crate::views::Viewpoints;
    use crate::{Error, Judge, Looked};

    #[test]
    fn what_stays_is_more_like_all_than_what_a_guess_leaves() {
        let all = scene(&SampleOptions::new(1000, 3));
        let mut cpu = Renderer::cpu();
        let Looked { views, sensitivity } =
            Looked::at(&mut cpu, &all, None, Viewpoints::Auto, &Silent).unwrap();
        let fit = Fit::to(&all, views.fitting(&all), views.are_given(), &Silent).unwrap();
        let mut removal = Removal { views: &views, renderer: &mut cpu, fit: &fit, progress: &Silent };
        let made = removal.at_most(400, &all, sensitivity).unwrap();
        assert_eq!((made.0.len(), made.1.len()), (400, 400));
        let mut guessed = all.clone();
        let guess = Sensitivity::guess(&all.geometry).opacity;
        let mut sorted = guess.clone();
        sorted.sort_by(f32::total_cmp);
        guessed.retain(&guess.iter().map(|own| *own >= sorted[600]).collect::<Vec<_>>());
        assert_eq!(guessed.len(), 400);
        let mut judge = Judge::new(cpu, &all, &views.some_judging(12), false, &Silent).unwrap();
        let [made, guessed] = [&made.0, &guessed].map(|scene| judge.score(scene, &Silent).unwrap().mean);
        assert!(made > guessed + 3.0, "{made} {guessed}");
    }

    #[test]
    fn the_quality_after_removal_is_about_that_asked_for() {
        let all = scene(&SampleOptions::new(1000, 3));
        let cameras = orbit(&all.geometry, 24, 96, 72);
        let Looked { views, sensitivity } =
            Looked::at(&mut Renderer::cpu(), &all, Some(&cameras), Viewpoints::Auto, &Silent).unwrap();
        let fit = Fit::to(&all, views.fitting(&all), views.are_given(), &Silent).unwrap();
        let judges = views.some_judging(12);
        let mut judge = Judge::new(Renderer::cpu(), &all, &judges, true, &Silent).unwrap();
        for asked in [27.0, 34.0] {
            let mut scored = 0;
            let mut renderer = Renderer::cpu();
            let mut removal =
                Removal { views: &views, renderer: &mut renderer, fit: &fit, progress: &Silent };
            let mut score = |splats: &Splats| {
                scored += 1;
                Ok::<_, Error>(judge.score(splats, &Silent)?.mean)
            };
            let made = removal.down_to(asked, &all, sensitivity.clone(), &mut score).unwrap();
            let reached = score(&made.0).unwrap();
            assert!((reached - asked).abs() < 1.0, "{reached} instead of {asked}, {scored} tries");
        }
    }
}
