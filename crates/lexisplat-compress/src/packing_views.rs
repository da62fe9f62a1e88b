//! The views that packing draws. Some measure the sensitivity, and some judge the result.

use lexisplat::packed::curve_order;
use lexisplat::{Geometry, Progress, Sensitivity, Splats};
use lexisplat_render::{
    Camera, Renderer, Scene, Split, aside, between, interior_views, nearby, object, surround,
};

use crate::backgrounds::black_and_white;
use crate::error::{Error, Result};
use crate::found::{Found, GENERATED_SIZE, ViewCounts, evenly, find};
use crate::sharp_views::{sampled, sampled_again};
use crate::views::{DEFAULT_MAX_WIDTH, Viewpoints, marked};

/// Number of generated views that measure: [`GAUSSIANS_DRAWN`] over the number of Gaussians, within this range. Views of
/// many Gaussians take long to draw.
const GENERATED_VIEWS: std::ops::RangeInclusive<usize> = 24..=96;
/// Approximate number of Gaussians drawn in all generated views together.
const GAUSSIANS_DRAWN: usize = 48_000_000;
/// Number of found views that measure. It is the number of Gaussians over [`GAUSSIANS_OF_A_VIEW`], within this range. In
/// large scenes it is the number of Gaussians over [`GAUSSIANS_OF_A_LARGE_VIEW`] if that is more, up to
/// [`MOST_FOUND_VIEWS`].
const FOUND_VIEWS: std::ops::RangeInclusive<usize> = 48..=192;
const GAUSSIANS_OF_A_VIEW: usize = 256;
const GAUSSIANS_OF_A_LARGE_VIEW: usize = 2048;
const MOST_FOUND_VIEWS: usize = 256;
/// Number of found views that judge: the number of found views that measure over [`FOUND_JUDGE_SHARE`], within this range.
const FOUND_JUDGES: std::ops::RangeInclusive<usize> = 24..=48;
const FOUND_JUDGE_SHARE: usize = 4;
/// Distances from which generated views measure, in radii of the scene's detail.
const GENERATED_DISTANCES: [f64; 2] = [2.0, 12.0];
/// Number of views evenly spread over the Gaussians of a part of a scene. A part may have some Gaussians far from all others, which
/// views like photographs of the part seldom show. Every `EVEN_JUDGE_SHARE`-th of these views judges, the others measure.
const EVEN_VIEWS: usize = 96;
const EVEN_JUDGE_SHARE: usize = 4;
/// Number of generated views that judge, plus 1.
const JUDGES: usize = 24;
/// Number of pixels that measure, in all views together. Of sharper pictures only some squares are drawn ([`sampled`]).
/// With half as many pixels files were 16 % larger at equal quality on the large room, and about the same on scenes of up
/// to 90,000 Gaussians (docs/METHOD.md, "How sharp").
const MEASURED_PIXELS: Pixels = Pixels { always: 8_000_000, each: 30, most: 40_000_000 };
/// Numbers of pixels that judge a whole scene, and a part of a scene. Views evenly spread over a part have as many again.
const JUDGED_PIXELS: u64 = 8_000_000;
const PART_JUDGED_PIXELS: u64 = 2_000_000;
/// Largest number of views that judge a part of a scene.
const PART_JUDGES: usize = 24;
/// Number of pixels to which base colours and opacities are fitted.
const FITTED_PIXELS: Pixels = Pixels { always: 12_000_000, each: 6, most: 24_000_000 };
/// Divisor of [`FITTED_PIXELS`] for a part of a scene. With half this divisor three copies of room-large have 0.14 dB more,
/// in 1.2 times the time.
const PART_FITTED_SHARE: u64 = 4;
/// Number of pixels that are fitted to in a round of all views, and number of pixels in all. Rounds of given cameras draw other
/// squares than the round before. With the same squares in each round, files of room-large were 8 % larger (docs/METHOD.md, "Refining").
const REFINED_PIXELS: u64 = 24_000_000;
pub(crate) const MOST_REFINED_PIXELS: u64 = 96_000_000;
/// Every `MEASURED_HALVED`-th view that measures is also drawn at half its size. Every `FITTED_HALVED`-th view for fitting
/// is at half its size instead. Otherwise errors that are even over many pixels count for too little, and show when
/// pictures are drawn smaller (docs/METHOD.md, "How sharp").
const MEASURED_HALVED: usize = 2;
const FITTED_HALVED: usize = 3;
/// Every `REFINED_HALVED`-th view to which everything is fitted beside given cameras is at half its size. Without such views pictures of
/// half the width show 1.0 (room) to 1.1 dB (fern) less (docs/METHOD.md, appendix, "Smaller pictures").
const REFINED_HALVED: usize = 5;
/// Every `REFINED_QUARTERED`-th view is at a quarter of its size, if it is then at least `LEAST_QUARTERED` pixels wide. Without such
/// views pictures of room-large that are a third as wide as 1,200 pixels show 0.6 dB less. For models of pictures of 400 pixels these
/// views cost 1 to 3 % of the bytes. Cameras between 400 and 1,200 pixels were not measured.
const REFINED_QUARTERED: usize = 10;
const LEAST_QUARTERED: u32 = 200;
/// Largest number of given cameras that are used. They are chosen evenly.
const MAX_VIEWS: usize = 150;
/// Every `JUDGE_SHARE`-th given camera judges. All given cameras measure, so the judging views score up to 0.1 dB better
/// than views that did not measure (docs/METHOD.md).
const JUDGE_SHARE: usize = 2;
/// Every `REFINED_JUDGE_SHARE`-th of the given cameras that judge also judges a refined file, or more of them if these are
/// fewer than `REFINED_JUDGES`. The others are fitted to.
const REFINED_JUDGE_SHARE: usize = 3;
const REFINED_JUDGES: usize = 12;
/// Views between given cameras to which everything is fitted: the neighbour of each camera, from the nearest, and the share
/// of the way to it. Cameras that judge have such views too: without these views room takes 6 % more bytes, and judges show no less
/// than test views. Without any the fit suits the cameras, and views between these are up to 6 dB worse (docs/METHOD.md).
const REFINED_BETWEEN: [(usize, f64); 2] = [(0, 0.4), (2, 0.5)];
/// Most found views to which everything is fitted beside given cameras. Without them and views beside the cameras room takes
/// a fifth fewer bytes, and views off the path of the cameras lose 6 dB (docs/METHOD.md).
const REFINED_FOUND: usize = 48;
/// Rounds of views near the found views, after the round of the found views themselves. With the found views alone the fit of
/// bonsai-3dgs gains 0.4 dB less on the views that judge.
const REFINED_NEARBY: usize = 3;
/// Number of views beside given cameras that measure too. Without them Gaussians that only such views show have coarse
/// steps (docs/METHOD.md).
const ASIDE: usize = 20;
/// Largest number of found views to which base colours and opacities are fitted.
const FITTED_FOUND: usize = 64;
/// Largest number of given cameras to which base colours and opacities are fitted.
const FITTED_GIVEN: usize = 40;
/// Number of views from all around to which base colours and opacities are fitted too, beside given cameras.
const FITTED_AROUND: usize = 8;
/// Share of the judging views that points of view are chosen from: the views nearest to the view in the middle.
const USUAL_VIEWS: f32 = 0.67;
/// Share of the guess in [`Sensitivity::blend_with_prior`]. It is the best share on held-out views (docs/METHOD.md).
const PRIOR_SHARE: f32 = 0.3;

/// A number of pixels: `always + each * gaussians`, and at most `most`.
struct Pixels {
    always: u64,
    /// Pixels for each Gaussian.
    each: u64,
    most: u64,
}

impl Pixels {
    fn of(&self, splats: &Splats) -> u64 {
        (self.always + self.each * splats.len() as u64).min(self.most)
    }
}

/// Halves the size of every `n`-th view, from the second one.
fn halve_every(n: usize, views: &mut [Camera]) {
    views.iter_mut().skip(1).step_by(n).for_each(|camera| *camera = camera.halved());
}

/// The views of a scene and its sensitivity, for several files of the scene.
#[derive(Debug, Clone)]
pub struct Looked {
    /// The views.
    pub views: PackingViews,
    /// The sensitivity that the views measured.
    pub sensitivity: Sensitivity,
}

impl Looked {
    /// Chooses views of `splats`, and measures its sensitivity from them. The views are `cameras`, or else those of
    /// `viewpoints`. `progress` can cancel.
    ///
    /// # Errors
    /// As [`PackingViews::given`], [`PackingViews::generated`] and [`PackingViews::sensitivity`].
    pub fn at(
        renderer: &mut Renderer,
        splats: &Splats,
        cameras: Option<&[Camera]>,
        viewpoints: Viewpoints,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let views = match cameras {
            Some(cameras) => PackingViews::given(cameras)?,
            None => PackingViews::generated(viewpoints, renderer, splats, progress)?,
        };
        let sensitivity = views.sensitivity(renderer, splats, progress)?;
        Ok(Self { views, sensitivity })
    }
}

/// Finds at most `count` views of `splats` that are like photographs. A search of the same kind finds the views that judge
/// a packed file without cameras.
///
/// # Errors
/// As [`PackingViews::found`].
pub fn judging_views(
    renderer: &mut Renderer,
    splats: &Splats,
    count: usize,
    progress: &dyn Progress,
) -> Result<Vec<Camera>> {
    let more = around(splats).into_iter().skip(1).step_by(2).collect();
    Ok(find(renderer, splats, more, ViewCounts { measuring: count, judging: count }, progress)?.judges)
}

/// Returns views from all around `splats`.
fn around(splats: &Splats) -> Vec<Camera> {
    let (least, most) = (*GENERATED_VIEWS.start(), *GENERATED_VIEWS.end());
    let views = (GAUSSIANS_DRAWN / splats.len().max(1)).clamp(least, most);
    surround(&splats.geometry, views, GENERATED_SIZE, GENERATED_DISTANCES)
}

/// Returns the numbers of found views of `splats` for measuring and for judging.
fn found_views(splats: &Splats) -> ViewCounts {
    let views = (splats.len() / GAUSSIANS_OF_A_VIEW).clamp(*FOUND_VIEWS.start(), *FOUND_VIEWS.end());
    let measuring = views.max(splats.len() / GAUSSIANS_OF_A_LARGE_VIEW).min(MOST_FOUND_VIEWS);
    let judging = (measuring / FOUND_JUDGE_SHARE).clamp(*FOUND_JUDGES.start(), *FOUND_JUDGES.end());
    ViewCounts { measuring, judging }
}

/// The views that packing draws: some measure the sensitivity, some judge the result. About half of each show the scene over black,
/// the others over white.
#[derive(Debug, Clone)]
pub struct PackingViews {
    measuring: Vec<Camera>,
    judging: Vec<Camera>,
    given: bool,
}

impl PackingViews {
    /// Finds views of `splats` that are like photographs, with `renderer`. Views from all around measure too, so that no
    /// Gaussian is without views.
    ///
    /// # Errors
    /// [`Error::Codec`] if `progress` cancels. On a GPU [`Error::Render`] if the scene or a view does not fit.
    pub fn found(renderer: &mut Renderer, splats: &Splats, progress: &dyn Progress) -> Result<Self> {
        let around = around(splats);
        let every_second = |first| around.iter().skip(first).step_by(2).cloned();
        let counts = found_views(splats);
        let Found { best, judges } = find(renderer, splats, every_second(1).collect(), counts, progress)?;
        Ok(Self::generated_from(every_second(0).chain(best).collect(), judges))
    }

    /// Finds views of a part of a scene, whose Gaussians are in the order of a curve: those of [`Self::found`], and [`EVEN_VIEWS`]
    /// evenly spread over the Gaussians. Some of the latter judge; they are the second value. The others measure.
    pub(crate) fn found_of_part(
        renderer: &mut Renderer,
        part: &Splats,
        progress: &dyn Progress,
    ) -> Result<(Self, Vec<Camera>)> {
        let mut views = Self::found(renderer, part, progress)?;
        let mut judges = Vec::new();
        let Some([width, height]) = views.judging.first().map(|camera| [camera.width, camera.height]) else {
            return Ok((views, judges));
        };
        let mut even = evenly(part, EVEN_VIEWS);
        black_and_white(&mut even);
        for (k, camera) in even.into_iter().enumerate() {
            let views = if k.is_multiple_of(EVEN_JUDGE_SHARE) { &mut judges } else { &mut views.measuring };
            views.push(camera.resized(width, height));
        }
        Ok((views, sampled(judges, PART_JUDGED_PIXELS)))
    }

    /// Generates views of `splats` from `viewpoints`. Half of the views that measure, and all views that judge, are around
    /// an object or inside a room. The other half of the views that measure is from all around.
    ///
    /// # Errors
    /// As [`Self::found`], which finds the views if `viewpoints` is [`Viewpoints::Auto`].
    pub fn generated(
        viewpoints: Viewpoints,
        renderer: &mut Renderer,
        splats: &Splats,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let [width, height] = GENERATED_SIZE;
        let views: fn(&Geometry, usize, u32, u32) -> Vec<Camera> = match viewpoints {
            Viewpoints::Auto => return Self::found(renderer, splats, progress),
            Viewpoints::Object => object,
            Viewpoints::Room => interior_views,
        };
        let mut measuring: Vec<Camera> = around(splats).into_iter().step_by(2).collect();
        measuring.extend(views(&splats.geometry, measuring.len(), width, height));
        // The number differs from that of the measuring views, so that most views are not among those.
        let judging = views(&splats.geometry, JUDGES - 1, width, height);
        Ok(Self::generated_from(measuring, judging))
    }

    /// Returns views that were generated, over black and over white.
    fn generated_from(mut measuring: Vec<Camera>, mut judging: Vec<Camera>) -> Self {
        black_and_white(&mut measuring);
        black_and_white(&mut judging);
        Self::of_found(measuring, judging)
    }

    /// Returns views that an earlier search found.
    pub(crate) fn of_found(measuring: Vec<Camera>, judging: Vec<Camera>) -> Self {
        Self { measuring, judging, given: false }
    }

    /// Takes the given cameras. If some cameras are marked as training cameras, takes only those.
    ///
    /// # Errors
    /// [`Error::Parameter`] if fewer than two cameras remain.
    pub fn given(cameras: &[Camera]) -> Result<Self> {
        let used = marked(cameras, Split::Train);
        if used.len() < 2 {
            return Err(Error::parameter("cameras", used.len(), "at least two training cameras"));
        }
        let stride = used.len().div_ceil(MAX_VIEWS);
        let sharp = |camera: &Camera| camera.with_max_width(DEFAULT_MAX_WIDTH);
        let mut measuring: Vec<Camera> = used.into_iter().step_by(stride).map(sharp).collect();
        black_and_white(&mut measuring);
        let judging = measuring.iter().skip(1).step_by(JUDGE_SHARE).cloned().collect();
        Ok(Self { measuring, judging, given: true })
    }

    /// Returns whether the cameras were given. Otherwise they were generated.
    #[must_use]
    pub fn are_given(&self) -> bool {
        self.given
    }

    /// Returns the views that measure the sensitivity. If they were given, [`Self::sensitivity`] adds views beside them.
    #[must_use]
    pub fn measuring(&self) -> &[Camera] {
        &self.measuring
    }

    /// Returns the views that judge.
    #[must_use]
    pub fn judging(&self) -> &[Camera] {
        &self.judging
    }

    /// Returns at most `most` of the views that judge, evenly chosen. Of sharp pictures only some squares are drawn.
    #[must_use]
    pub fn some_judging(&self, most: usize) -> Vec<Camera> {
        self.judging_by(most, JUDGED_PIXELS)
    }

    /// Returns views that judge a part of a scene, like [`Self::some_judging`]. They draw fewer pixels.
    pub(crate) fn judging_part(&self) -> Vec<Camera> {
        self.judging_by(PART_JUDGES, PART_JUDGED_PIXELS)
    }

    fn judging_by(&self, most: usize, pixels: u64) -> Vec<Camera> {
        let some = self.judging.iter().step_by(self.judging.len().div_ceil(most.max(1)).max(1));
        sampled(some.cloned().collect(), pixels)
    }

    /// Returns up to `most` points that represent the positions of the views that judge. Starting points are chosen far
    /// from each other. Each position belongs to the nearest starting point. The result has the middle position of each
    /// group.
    pub(crate) fn points_of_view(&self, most: usize) -> Vec<[f32; 3]> {
        let mut positions: Vec<[f32; 3]> = self.judging.iter().map(|camera| camera.position).collect();
        let squared = |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f32>();
        let to_nearest = |of: [f32; 3], points: &[[f32; 3]]| {
            points.iter().map(|&point| squared(of, point)).fold(f32::INFINITY, f32::min)
        };
        let least = |cost: &dyn Fn([f32; 3]) -> f32, among: &[[f32; 3]]| {
            among.iter().copied().min_by(|&a, &b| cost(a).total_cmp(&cost(b)))
        };
        let to_all =
            |of: [f32; 3], all: &[[f32; 3]]| all.iter().map(|&other| squared(of, other).sqrt()).sum::<f32>();
        let mut points: Vec<[f32; 3]> = least(&|p| to_all(p, &positions), &positions).into_iter().collect();
        // Some found views may be far away, where few photographs are taken.
        positions.sort_by(|&a, &b| to_nearest(a, &points).total_cmp(&to_nearest(b, &points)));
        #[expect(clippy::cast_possible_truncation, reason = "a share of a count")]
        let usual = (positions.len() as f32 * USUAL_VIEWS).ceil() as usize;
        positions.truncate(usual);
        while points.len() < most.min(positions.len()) {
            let farthest = least(&|p| -to_nearest(p, &points), &positions);
            points.extend(farthest);
        }
        let groups = (0..points.len()).map(|k| {
            let own = |&&p: &&[f32; 3]| squared(p, points[k]) <= to_nearest(p, &points);
            let group: Vec<[f32; 3]> = positions.iter().filter(own).copied().collect();
            least(&|p| to_all(p, &group), &group).unwrap_or(points[k])
        });
        groups.collect()
    }

    /// Returns the views of `splats` to which base colours and opacities are fitted: some of the views that measure and do
    /// not judge, evenly chosen. If cameras were given, views from all around are added, so that colours do not suit the
    /// given cameras alone.
    #[must_use]
    pub fn fitting(&self, splats: &Splats) -> Vec<Camera> {
        self.fitting_to(splats, FITTED_PIXELS.of(splats))
    }

    /// Returns views to which a part of a scene is fitted, like [`Self::fitting`]. They draw fewer pixels.
    pub(crate) fn fitting_part(&self, part: &Splats) -> Vec<Camera> {
        self.fitting_to(part, FITTED_PIXELS.of(part) / PART_FITTED_SHARE)
    }

    /// Returns the views for refining, and those to which everything is fitted, round after round. Of sharp pictures the latter
    /// draw only some squares, other ones each round. Rounds of found views are near the found views.
    ///
    /// If cameras were given, fewer of them judge, so that more are left to fit to, and found views measure too. Everything
    /// is fitted to the views that measure and do not judge, and to views between and beside the cameras, so that other
    /// views than the given ones stay good. Found views that judge are never fitted to.
    ///
    /// # Errors
    /// As [`Self::found`].
    pub(crate) fn for_refining(
        mut self,
        renderer: &mut Renderer,
        splats: &Splats,
        progress: &dyn Progress,
    ) -> Result<(Self, Vec<Camera>)> {
        if !self.given {
            let fitted = self.refining_found(splats);
            return Ok((self, fitted));
        }
        let mut fitted = Vec::new();
        let stride = (self.judging.len() / REFINED_JUDGES).clamp(1, REFINED_JUDGE_SHARE);
        self.judging = self.judging.into_iter().step_by(stride).collect();
        for (rank, share) in REFINED_BETWEEN {
            fitted.extend(between(&self.measuring, rank, share));
        }
        fitted.extend(aside(&splats.geometry, &self.measuring, ASIDE));
        let found = Self::found(renderer, splats, progress)?.measuring;
        let stride = found.len().div_ceil(REFINED_FOUND).max(1);
        self.measuring.extend(found.into_iter().step_by(stride));
        fitted.extend(self.not_judging().cloned());
        halve_every(REFINED_HALVED, &mut fitted);
        // None of these was halved.
        let quartered = fitted.iter_mut().skip(3).step_by(REFINED_QUARTERED);
        quartered
            .filter(|camera| camera.width >= 4 * LEAST_QUARTERED)
            .for_each(|camera| *camera = camera.halved().halved());
        Ok((self, sampled_again(fitted, REFINED_PIXELS, MOST_REFINED_PIXELS)))
    }

    /// Returns the views to which everything of a scene or of a part is fitted if the views were found, round after round.
    pub(crate) fn refining_found(&self, splats: &Splats) -> Vec<Camera> {
        let found: Vec<Camera> = self.not_judging().cloned().collect();
        let rounds = nearby(&splats.geometry, &found, REFINED_NEARBY);
        std::iter::once(found).chain(rounds).flat_map(|round| sampled(round, REFINED_PIXELS)).collect()
    }

    /// Returns the views that measure and do not judge.
    fn not_judging(&self) -> impl Iterator<Item = &Camera> {
        self.measuring.iter().filter(|camera| !self.judging.contains(camera))
    }

    fn fitting_to(&self, splats: &Splats, pixels: u64) -> Vec<Camera> {
        let free: Vec<&Camera> = self.not_judging().collect();
        let [most, around] = if self.given { [FITTED_GIVEN, FITTED_AROUND] } else { [FITTED_FOUND, 0] };
        let stride = free.len().div_ceil(most).max(1);
        let mut views: Vec<Camera> = free.into_iter().step_by(stride).cloned().collect();
        let mut around = surround(&splats.geometry, around, GENERATED_SIZE, GENERATED_DISTANCES);
        black_and_white(&mut around);
        views.extend(around);
        halve_every(FITTED_HALVED, &mut views);
        sampled(views, pixels)
    }

    /// Measures how much the pictures drawn with `renderer` depend on each value of each Gaussian. The result is blended
    /// with a guess, which stands for all other views. Reports [`Stage::Draw`](lexisplat::Stage::Draw) to `progress`, in
    /// views.
    ///
    /// # Errors
    /// [`Error::Codec`] if `progress` cancels. On a GPU [`Error::Render`] if the scene or a view does not fit.
    pub fn sensitivity(
        &self,
        renderer: &mut Renderer,
        splats: &Splats,
        progress: &dyn Progress,
    ) -> Result<Sensitivity> {
        let mut cameras = self.measuring.clone();
        if self.given {
            cameras.extend(aside(&splats.geometry, &self.measuring, ASIDE));
        }
        let smaller: Vec<Camera> = cameras.iter().step_by(MEASURED_HALVED).map(Camera::halved).collect();
        cameras.extend(smaller);
        let cameras = sampled(cameras, MEASURED_PIXELS.of(splats));
        let mut measured = match renderer.is_gpu() {
            true => renderer.sensitivity(&Scene::from(splats), &cameras, progress)?,
            false => {
                let order = curve_order(&splats.geometry);
                let ordered = splats.gathered(&order);
                renderer.sensitivity(&Scene::from(&ordered), &cameras, progress)?.scattered(&order)
            }
        };
        measured.blend_with_prior(&splats.geometry, PRIOR_SHARE);
        Ok(measured)
    }
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat_render::orbit;
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    /// `splats` in units that are `factor` times as small, moved by `shift` of the old units.
    fn in_other_units(splats: &Splats, factor: f32, shift: f32) -> Splats {
        let mut out = splats.clone();
        for position in &mut out.geometry.positions {
            *position = position.map(|v| (v + shift) * factor);
        }
        for scales in &mut out.geometry.scales {
            *scales = scales.map(|v| v + factor.ln());
        }
        out
    }

    #[test]
    fn rounds_of_found_views_are_near_them_and_none_of_them_judges() {
        let splats = scene(&SampleOptions::new(1500, 3));
        let views = PackingViews::found(&mut Renderer::cpu(), &splats, &Silent).unwrap();
        let measuring = views.measuring.len();
        let (views, fitted) = views.for_refining(&mut Renderer::cpu(), &splats, &Silent).unwrap();
        assert_eq!(views.measuring.len(), measuring);
        assert!(
            fitted.len() > measuring * REFINED_NEARBY && fitted.len() <= measuring * (1 + REFINED_NEARBY)
        );
        let pose = |camera: &Camera| (camera.position, camera.rotation);
        assert!(fitted.iter().all(|camera| views.judging.iter().all(|judge| pose(judge) != pose(camera))));
        let places: std::collections::HashSet<[u32; 3]> =
            fitted.iter().map(|camera| camera.position.map(f32::to_bits)).collect();
        assert!(places.len() > fitted.len() * 9 / 10, "{} of {}", places.len(), fitted.len());
    }

    #[test]
    fn some_views_beside_given_cameras_are_fitted_to_at_half_and_a_quarter_of_their_size() {
        let splats = scene(&SampleOptions::new(300, 3));
        // Found views have other widths than the cameras, and come last.
        for width in [4 * LEAST_QUARTERED, 4 * LEAST_QUARTERED - 2] {
            let cameras = orbit(&splats.geometry, 12, width, 400);
            let views = PackingViews::given(&cameras).unwrap();
            let (_, fitted) = views.for_refining(&mut Renderer::cpu(), &splats, &Silent).unwrap();
            for (k, camera) in fitted.iter().enumerate().take(REFINED_BETWEEN.len() * cameras.len()) {
                let expected = match [k % REFINED_HALVED, k % REFINED_QUARTERED] {
                    [1, _] => width / 2,
                    [_, 3] if width == 4 * LEAST_QUARTERED => LEAST_QUARTERED,
                    _ => width,
                };
                assert_eq!(camera.width, expected, "{k}");
            }
        }
    }

    #[test]
    fn a_scene_is_looked_at_in_its_own_size() {
        let splats = scene(&SampleOptions::new(1500, 3));
        let looked = |splats: &Splats| {
            Looked::at(&mut Renderer::cpu(), splats, None, Viewpoints::Auto, &Silent).unwrap()
        };
        let whole = looked(&splats);
        for (factor, shift) in [(1e-4, 0.0), (0.03, 0.0), (1e4, 0.0), (0.5, 64.0)] {
            let other = looked(&in_other_units(&splats, factor, shift));
            let others = other.views.measuring();
            for (view, other) in whole.views.measuring().iter().zip(others) {
                let off = (0..3).map(|k| (view.position[k] + shift) * factor - other.position[k]);
                assert!(
                    off.map(f32::abs).fold(0.0, f32::max) < 1e-3 * factor,
                    "{factor} {shift}: {view:?} {other:?}"
                );
                assert!((view.near * factor / other.near - 1.0).abs() < 1e-3, "{} {}", view.near, other.near);
            }
            let off = |(a, b): (&f32, &f32)| (a / b - 1.0).abs();
            let pairs = whole.sensitivity.colour.iter().zip(&other.sensitivity.colour);
            let mut off: Vec<f32> = pairs.filter(|(a, _)| **a > 0.0).map(off).collect();
            off.sort_by(f32::total_cmp);
            assert!(off[off.len() * 99 / 100] < 1e-3, "{factor} {shift}: {off:?}");
        }
    }
}
