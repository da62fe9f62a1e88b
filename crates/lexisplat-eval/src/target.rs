//! Packing to a target: the smallest file of a quality, or the best quality of a size. No photos needed.

use std::borrow::Borrow;

use lexisplat::lexi::LexiWriter;
use lexisplat::packed::{PackReport, Packed, Packer, TargetRecord};
use lexisplat::{Model, Progress, Sensitivity, Splats};
use lexisplat_render::{Camera, Image, RenderOptions, Renderer, Scene, Split, surround};

use crate::error::{Error, Result};
use crate::metrics::psnr;

/// Views generated for a scene without cameras, to see what shows: this many, or as few as that for
/// scenes so large that a view of this many Gaussians each would take minutes.
const GENERATED_VIEWS: std::ops::RangeInclusive<usize> = 24..=96;
const GAUSSIANS_DRAWN: usize = 48_000_000;
/// Their size in pixels.
const GENERATED_SIZE: [u32; 2] = [384, 256];
/// Their distances, in radii of the scene's detail.
const GENERATED_DISTANCES: [f64; 2] = [2.0, 12.0];
/// Views generated to judge from. Most are less demanding than photographs, which are taken of what has
/// detail; so the share of them with the most detail judges (docs/METHOD.md has the measurements).
const CANDIDATES: usize = 72;
const JUDGES: usize = 18;
/// Their distances.
const JUDGE_DISTANCES: [f64; 2] = [2.0, 10.0];
/// Widest picture of given cameras; sharper ones say the same about what shows.
const MAX_WIDTH: u32 = 480;
/// Of given cameras at most so many are used, evenly spread.
const MAX_VIEWS: usize = 150;
/// One given camera in so many judges. All say what shows: that flatters those that judge by less than
/// 0.1 dB (docs/METHOD.md).
const JUDGE_SHARE: usize = 2;
/// Say of the guess that knows no views in [`Sensitivity::blend_with_prior`]: measured on held-out views
/// (docs/METHOD.md).
const GUESS_SHARE: f32 = 0.3;
/// Identical pictures count as this many decibels, so that means stay numbers.
const IDENTICAL: f64 = 100.0;
/// A quality may exceed what was asked by this, in dB, and a size fall short of it by this share.
const CLOSE_DB: f64 = 0.06;
const CLOSE_SIZE: f64 = 0.01;
/// Packings tried at most.
const MAX_TRIES: usize = 9;
/// First guess of by how many decibels pictures gain when the step is halved.
const DB_PER_HALVING: f64 = 4.5;
/// First guess of bytes a Gaussian at [`FIRST_DB`], and by how much halving the step multiplies them.
const FIRST_DB: f64 = 40.0;
const FIRST_BYTES: f64 = 8.0;
const BYTES_PER_HALVING: f64 = 1.4;
/// Largest change of the step's binary logarithm from one try to the next.
const MAX_MOVE: f64 = 3.0;
/// Steps outside of this are useless.
const STEPS: [f64; 2] = [1e-9, 1e-2];

/// Views of a scene: those that say what shows, and those that judge.
#[derive(Debug, Clone)]
pub struct Views {
    measure: Vec<Camera>,
    /// Those that judge, or from among which the judging ones are chosen.
    judge: Vec<Camera>,
    given: bool,
}

impl Views {
    /// Views from all around.
    #[must_use]
    pub fn generated(splats: &Splats) -> Self {
        let (least, most) = (*GENERATED_VIEWS.start(), *GENERATED_VIEWS.end());
        let views = (GAUSSIANS_DRAWN / splats.len().max(1)).clamp(least, most);
        let around = |count, distances| surround(&splats.geometry, count, GENERATED_SIZE, distances);
        Self {
            measure: around(views, GENERATED_DISTANCES),
            judge: around(CANDIDATES, JUDGE_DISTANCES),
            given: false,
        }
    }

    /// Views from all around a part of a scene, only to see what shows in it: none of them judges. As many as
    /// for a large scene.
    #[must_use]
    pub fn of_part(part: &Splats) -> Self {
        let measure = surround(&part.geometry, *GENERATED_VIEWS.start(), GENERATED_SIZE, GENERATED_DISTANCES);
        Self { measure, judge: Vec::new(), given: false }
    }

    /// The given cameras; those marked as training ones where there are marks.
    ///
    /// # Errors
    /// [`Error::Parameter`] if there are fewer than two.
    pub fn given(cameras: &[Camera]) -> Result<Self> {
        let marked = cameras.iter().any(|c| c.split == Some(Split::Train));
        let used: Vec<&Camera> =
            cameras.iter().filter(|c| !marked || c.split == Some(Split::Train)).collect();
        if used.len() < 2 {
            return Err(Error::parameter("cameras", used.len(), "at least two to search with"));
        }
        let stride = used.len().div_ceil(MAX_VIEWS);
        let mut views = Self { measure: Vec::new(), judge: Vec::new(), given: true };
        for (i, camera) in used.into_iter().step_by(stride).enumerate() {
            let camera = camera.with_max_width(MAX_WIDTH);
            if i % JUDGE_SHARE == 1 {
                views.judge.push(camera.clone());
            }
            views.measure.push(camera);
        }
        Ok(views)
    }

    /// Number of views that say what shows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.measure.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.measure.is_empty()
    }

    /// Whether they were given, not generated.
    #[must_use]
    pub fn are_given(&self) -> bool {
        self.given
    }

    /// The views that say what shows.
    #[must_use]
    pub fn measuring(&self) -> &[Camera] {
        &self.measure
    }

    /// All of them, each once.
    pub fn all(&self) -> impl Iterator<Item = &Camera> {
        // Given cameras that judge are among those that measure.
        let judge = if self.given { &[] } else { self.judge.as_slice() };
        self.measure.iter().chain(judge)
    }

    /// How much the views' pictures, drawn with `renderer`, depend on each value of each Gaussian, tempered
    /// by a guess for views that are not among them.
    ///
    /// # Errors
    /// None on the processor; on a GPU [`Error::Render`] if the scene or a view does not fit.
    pub fn sensitivity(
        &self,
        renderer: &mut Renderer,
        splats: &Splats,
        on_view: &mut dyn FnMut(),
    ) -> Result<Sensitivity> {
        let mut seen = renderer.sensitivity(&Scene::from(splats), &self.measure, on_view)?;
        seen.blend_with_prior(&splats.geometry, GUESS_SHARE);
        Ok(seen)
    }
}

/// The judging views and the original's pictures from them.
#[derive(Debug)]
pub struct Judge<'a> {
    renderer: &'a mut Renderer,
    views: Vec<(&'a Camera, Image)>,
    given: bool,
}

impl<'a> Judge<'a> {
    /// Draws the original with `renderer`, as models will be.
    ///
    /// # Errors
    /// None on the processor; on a GPU [`Error::Render`] if the scene or a view does not fit.
    pub fn new(renderer: &'a mut Renderer, splats: &Splats, views: &'a Views) -> Result<Self> {
        let scene = renderer.prepare(Scene::from(splats))?;
        let most = if views.given { usize::MAX } else { JUDGES };
        let mut drawn: Vec<(f64, &Camera, Image)> = Vec::new();
        for camera in &views.judge {
            let picture = renderer.render(&scene, camera, &RenderOptions::default())?;
            drawn.push((detail(&picture), camera, picture));
            if drawn.len() > most
                && let Some(least) = (0..drawn.len()).min_by(|&a, &b| drawn[a].0.total_cmp(&drawn[b].0))
            {
                drawn.remove(least);
            }
        }
        let views_drawn = drawn.into_iter().map(|(_, camera, picture)| (camera, picture)).collect();
        Ok(Self { renderer, views: views_drawn, given: views.given })
    }

    /// Mean and least PSNR of `model` against the original.
    ///
    /// # Errors
    /// None on the processor; on a GPU [`Error::Render`] if the model or a view does not fit.
    pub fn score(&mut self, model: &Model) -> Result<[f64; 2]> {
        let scene = self.renderer.prepare(Scene::from(model))?;
        let (mut sum, mut least) = (0.0, IDENTICAL);
        for (camera, original) in &self.views {
            let picture = self.renderer.render(&scene, camera, &RenderOptions::default())?;
            let decibels = psnr(original, &picture)?.unwrap_or(IDENTICAL).min(IDENTICAL);
            sum += decibels;
            least = f64::min(least, decibels);
        }
        Ok([sum / self.views.len().max(1) as f64, least])
    }
}

/// Mean squared difference of neighbouring pixels; never negative.
fn detail(picture: &Image) -> f64 {
    let width = picture.width as usize;
    let mut sum = 0.0;
    let mut add = |a: &[f32; 3], b: &[f32; 3]| {
        for (a, b) in a.iter().zip(b) {
            sum += f64::from(a - b).powi(2);
        }
    };
    for row in picture.pixels.chunks_exact(width.max(1)) {
        for pair in row.windows(2) {
            add(&pair[0], &pair[1]);
        }
    }
    for (above, below) in picture.pixels.iter().zip(picture.pixels.iter().skip(width)) {
        add(above, below);
    }
    sum / picture.pixels.len().max(1) as f64
}

/// What to pack to.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Goal {
    /// A mean PSNR of at least this, in dB.
    MeanPsnr(f64),
    /// At least this PSNR, in dB, in every judging view.
    MinPsnr(f64),
    /// A file of at most this many bytes.
    Size(u64),
}

impl Goal {
    fn name(self) -> &'static str {
        match self {
            Self::MeanPsnr(_) => "psnr",
            Self::MinPsnr(_) => "min-psnr",
            Self::Size(_) => "size",
        }
    }

    #[expect(clippy::cast_precision_loss, reason = "file sizes are far below 2^52")]
    fn asked(self) -> f64 {
        match self {
            Self::MeanPsnr(db) | Self::MinPsnr(db) => db,
            Self::Size(bytes) => bytes as f64,
        }
    }
}

/// One packing tried.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Try {
    log_step: f64,
    /// Decibels, which fall as the step grows; or minus the binary logarithm of the bytes, which grows.
    value: f64,
}

/// Packs until `goal` is met as closely as it can be. The promise is recorded in the file.
///
/// # Errors
/// [`Error::Parameter`] if it cannot be met; what packing and drawing say.
pub fn pack_to(
    packer: &Packer<impl Borrow<Splats>>,
    judge: &mut Judge<'_>,
    goal: Goal,
    progress: &dyn Progress,
) -> Result<(Packed, PackReport)> {
    let size = matches!(goal, Goal::Size(_));
    let wanted = if size { -libm::log2(goal.asked()) } else { goal.asked() };
    if !goal.asked().is_finite() || goal.asked() <= 0.0 {
        return Err(Error::parameter(goal.name(), goal.asked(), "a finite number above 0"));
    }
    let close = if size { -libm::log2(1.0 - CLOSE_SIZE) } else { CLOSE_DB };
    let mut slope = if size { libm::log2(BYTES_PER_HALVING) } else { -DB_PER_HALVING };
    let mut log_step = if size {
        #[expect(clippy::cast_precision_loss, reason = "a count of Gaussians")]
        let first = -libm::log2(FIRST_BYTES * packer.len().max(1) as f64);
        libm::log2(packer.step_for(FIRST_DB)) + (wanted - first) / slope
    } else {
        libm::log2(packer.step_for(wanted))
    };
    let mut tries: Vec<Try> = Vec::new();
    let mut best: Option<(f64, Packed, PackReport, [f64; 2])> = None;
    for _ in 0..MAX_TRIES {
        log_step = log_step.clamp(libm::log2(STEPS[0]), libm::log2(STEPS[1]));
        let (packed, report) = packer.pack(libm::exp2(log_step), progress)?;
        let bytes = LexiWriter::packed(&packed).file_bytes();
        let mut reached = [f64::NAN; 2];
        #[expect(clippy::cast_precision_loss, reason = "file sizes are far below 2^52")]
        let value = if size {
            // The promise is written into the header too.
            -libm::log2((bytes + PROMISE_BYTES) as f64)
        } else {
            reached = judge.score(&packed.unpack()?)?;
            if matches!(goal, Goal::MinPsnr(_)) { reached[1] } else { reached[0] }
        };
        tries.push(Try { log_step, value });
        let met = value >= wanted;
        // Of those that meet a quality the one with the largest step is smallest; of those that meet a
        // size the one with the smallest step is best.
        let better = |other: f64| if size { log_step < other } else { log_step > other };
        if met && best.as_ref().is_none_or(|b| better(b.0)) {
            best = Some((log_step, packed, report, reached));
        }
        let over = value - wanted;
        if met && over <= close {
            break;
        }
        let Some(next) = next_step(&tries, wanted + 0.5 * close, &mut slope) else { break };
        log_step = next;
    }
    let Some((_, packed, report, mut reached)) = best else {
        let found = tries.iter().map(|t| t.value).fold(f64::NEG_INFINITY, f64::max);
        let expected = if size {
            format!("at least {:.0} bytes: nothing smaller can be made of this scene", libm::exp2(-found))
        } else {
            format!("at most {found:.1} dB: nothing better can be made of this scene")
        };
        return Err(Error::parameter(goal.name(), goal.asked(), expected));
    };
    if reached[0].is_nan() {
        reached = judge.score(&packed.unpack()?)?;
    }
    let views = u32::try_from(judge.views.len()).unwrap_or(u32::MAX);
    let target = TargetRecord::new(goal.name(), goal.asked(), reached.map(rounded), views, judge.given);
    Ok((packed.with_target(target), report))
}

/// Room kept for the promise in the header of a file of a given size.
const PROMISE_BYTES: u64 = 256;

/// Decibels as they are worth recording.
fn rounded(decibels: f64) -> f64 {
    (decibels * 1000.0).round() / 1000.0
}

/// Where to try next: on the line through the two tries around the wanted value, or beyond the last.
/// `None` if nothing new would be tried.
fn next_step(tries: &[Try], wanted: f64, slope: &mut f64) -> Option<f64> {
    let above = tries.iter().filter(|t| t.value >= wanted).min_by(|a, b| a.value.total_cmp(&b.value));
    let below = tries.iter().filter(|t| t.value < wanted).max_by(|a, b| a.value.total_cmp(&b.value));
    let next = match (above, below) {
        (Some(a), Some(b)) => {
            let t = (wanted - b.value) / (a.value - b.value);
            // Not too near either end, so that the interval shrinks.
            b.log_step + (a.log_step - b.log_step) * t.clamp(0.05, 0.95)
        }
        (one, other) => {
            if let [.., p, q] = tries
                && (p.log_step - q.log_step).abs() > 1e-3
            {
                let measured = (q.value - p.value) / (q.log_step - p.log_step);
                *slope = slope.signum() * (measured / *slope).clamp(1.0 / 3.0, 3.0) * slope.abs();
            }
            let from = one.or(other)?;
            from.log_step + ((wanted - from.value) / *slope).clamp(-MAX_MOVE, MAX_MOVE)
        }
    };
    tries.iter().all(|t| (t.log_step - next).abs() > 1e-4).then_some(next)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The nearest value to `wanted` the search finds on `curve`.
    fn nearest(curve: impl Fn(f64) -> f64, wanted: f64, mut slope: f64) -> f64 {
        let mut tries = vec![Try { log_step: -17.0, value: curve(-17.0) }];
        while tries.len() < MAX_TRIES {
            let Some(next) = next_step(&tries, wanted, &mut slope) else { break };
            tries.push(Try { log_step: next, value: curve(next) });
        }
        tries.iter().map(|t| (t.value - wanted).abs()).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn the_search_closes_in_on_decibels() {
        // As a curve of the step's logarithm, steeper on one side.
        let curve = |x: f64| 40.0 - 4.0 * (x + 17.0) - 0.2 * (x + 17.0).powi(2) * (x + 17.0).signum();
        for wanted in [25.0, 40.0, 47.3, 60.0] {
            assert!(nearest(curve, wanted, -DB_PER_HALVING) < 0.02, "{wanted}");
        }
    }

    #[test]
    fn the_search_closes_in_on_sizes() {
        // Minus the logarithm of bytes: a floor of dictionary and tables, and a part that shrinks.
        let curve = |x: f64| -(5000.0 + 90_000.0 * (-0.45 * (x + 17.0)).exp2()).log2();
        for bytes in [8e3_f64, 2e4, 1e5, 1e6] {
            let wanted = -bytes.log2();
            assert!(nearest(curve, wanted, BYTES_PER_HALVING.log2()) < 0.01, "{bytes}");
        }
    }
}
