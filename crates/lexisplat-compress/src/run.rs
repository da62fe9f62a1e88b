//! The steps from a source of splats to a written file and its report.

use lexisplat::lexi::LexiWriter;
use lexisplat::packed::Packer;
use lexisplat::{Layout, Progress, Sink, SplatSource, Splats, Stopwatch, stream};
use lexisplat_render::{Camera, Renderer};

use crate::belonging::belong;
use crate::error::{Error, Result};
use crate::fewer::Removal;
use crate::first_view::first_view;
use crate::judge::{Judge, reached};
use crate::packing::{Compression, Packing, Quality};
use crate::packing_views::Looked;
use crate::parts::in_parts;
use crate::refine::Refining;
use crate::refit::{Fit, Refitting};
use crate::report::{CompressionReport, SensitivitySource};
use crate::signs::near_plane_hides;
use crate::target::{pack_to_preset, pack_to_target};
use crate::views::Viewpoints;
use crate::with_view::WithView;

/// Bytes of a Gaussian in a PLY at SH degree 3.
const PLY_ROW: u64 = 248;
/// Largest number of views that judge a preset.
const PRESET_JUDGES: usize = 48;

impl Compression {
    /// Returns whether [`Self::run`] holds all Gaussians of a PLY of `bytes` bytes and SH degree 3 in memory at once.
    /// `likely_cameras` tells whether there are [likely cameras](Self::with_likely_cameras). Such a source is best opened
    /// with [`PlySource::open_whole`](lexisplat::ply::PlySource::open_whole).
    #[must_use]
    pub fn holds_whole(&self, bytes: u64, likely_cameras: bool) -> bool {
        let is_whole = |packing: &Packing| packing.is_whole(bytes / PLY_ROW, bytes, likely_cameras);
        matches!(self, Self::Packed(packing) if is_whole(packing).is_ok_and(|whole| whole))
    }

    /// Compresses `source` into `sink`: a file that appears when it is whole, or any writer. Reports every step to
    /// `progress`, which can cancel. A cancelled compression leaves no file.
    ///
    /// The file states the view from which viewers show the scene first: that of the source
    /// ([`WithView`]), or else the best of the cameras or of generated views. With [`Self::Guessed`] no view is chosen.
    ///
    /// The result is the same for any number of threads. A packed file depends on the memory allowed only in whether the
    /// scene is packed whole.
    ///
    /// # Errors
    /// [`Error::Parameter`](crate::Error::Parameter) for choices that are out of range or do not go together, for a target
    /// that cannot be met, and for a source without Gaussians. [`Error::Memory`](crate::Error::Memory) if a choice needs
    /// the whole scene and the memory allowed is too small. Errors of the source, of the sink and of a GPU.
    /// [`Error::Codec`](crate::Error::Codec) with [`lexisplat::Error::Cancelled`] if `progress` cancels.
    pub fn run<'a>(
        &self,
        source: &dyn SplatSource,
        sink: impl Into<Sink<'a>>,
        progress: &dyn Progress,
    ) -> Result<CompressionReport> {
        let clock = Stopwatch::start();
        let sink = sink.into();
        if source.is_empty() {
            return Err(Error::parameter(
                "scene",
                "no Gaussians",
                "one or more, or there is nothing to write",
            ));
        }
        let mut report = match self {
            Self::Exact(options, codes) => {
                let source = WithView::best(source, progress)?;
                let done = stream::compress(&source, options, *codes, sink, progress)?;
                CompressionReport::exact(done, Layout::of(*codes, options.values))
            }
            Self::Guessed(preset, options) => {
                in_parts(options, preset.decibels(), None, None, source, sink, progress)?
            }
            Self::Packed(packing) => packing.run(source, sink, progress)?,
        };
        report.source_bytes = source.source_bytes();
        report.warnings = [source.warnings(), &report.warnings].concat();
        report.total_seconds = clock.seconds();
        Ok(report)
    }
}

/// Number of points of view from which the base colours of a file are evaluated. More points gained nothing
/// (docs/METHOD.md, "Layers").
const POINTS_OF_VIEW: usize = 8;

impl Packing {
    fn run(
        &self,
        source: &dyn SplatSource,
        sink: Sink<'_>,
        progress: &dyn Progress,
    ) -> Result<CompressionReport> {
        self.check()?;
        match self.holds(source, self.likely_cameras.is_some())? {
            true => self.whole(source, sink, progress),
            false => self.in_parts(source, sink, progress),
        }
    }

    /// Returns whether `source` is packed whole. `cameras` tells whether cameras belong to it. A compressed source counts
    /// with the bytes of its Gaussians.
    ///
    /// # Errors
    /// As [`Self::is_whole`].
    fn holds(&self, source: &dyn SplatSource, cameras: bool) -> Result<bool> {
        let gaussians = source.len() as u64;
        self.is_whole(
            gaussians,
            source.source_bytes().max(gaussians.saturating_mul(source.row_bytes())),
            cameras,
        )
    }

    fn in_parts(
        &self,
        source: &dyn SplatSource,
        sink: Sink<'_>,
        progress: &dyn Progress,
    ) -> Result<CompressionReport> {
        let source = WithView::best(source, progress)?;
        let renderer = Some(self.renderer()?);
        in_parts(&self.options, self.quality.decibels()?, self.refine, renderer, &source, sink, progress)
    }

    /// Returns the given cameras, or else likely cameras that seem to belong to `splats`.
    fn cameras_of(
        &self,
        renderer: &mut Renderer,
        splats: &Splats,
        progress: &dyn Progress,
    ) -> Result<Option<&[Camera]>> {
        if let (None, Viewpoints::Auto, Some(likely)) = (&self.cameras, self.viewpoints, &self.likely_cameras)
            && belong(renderer, splats, likely, progress)?
        {
            return Ok(Some(likely));
        }
        Ok(self.cameras.as_deref())
    }

    fn whole(
        &self,
        source: &dyn SplatSource,
        sink: Sink<'_>,
        progress: &dyn Progress,
    ) -> Result<CompressionReport> {
        let clock = Stopwatch::start();
        let splats = source.whole()?;
        let read_seconds = clock.seconds();

        let clock = Stopwatch::start();
        let mut renderer = self.renderer()?;
        let device = gpu(&renderer);
        let Looked { views, sensitivity } = match &self.looked {
            Some(looked) => Looked::clone(looked),
            None => {
                let cameras = self.cameras_of(&mut renderer, &splats, progress)?;
                if !self.holds(source, cameras.is_some())? {
                    drop(splats);
                    return self.in_parts(source, sink, progress);
                }
                Looked::at(&mut renderer, &splats, cameras, self.viewpoints, progress)?
            }
        };
        let view = match &splats.meta.view {
            Some(view) => Some(view.clone()),
            None => {
                let cameras = views.are_given().then(|| views.measuring());
                first_view(&*splats, cameras, progress)?.map(|pose| pose.to_string())
            }
        };
        let look_seconds = clock.seconds();

        let clock = Stopwatch::start();
        let given = views.are_given();
        let hidden = given.then(|| near_plane_hides(&splats.geometry, views.measuring())).flatten();
        let (views, sensitivity, fitted) = match self.refine {
            Some(_) => {
                let (views, fitted) = views.for_refining(&mut renderer, &splats, progress)?;
                let sensitivity = match given {
                    true => views.sensitivity(&mut renderer, &splats, progress)?,
                    false => sensitivity,
                };
                (views, sensitivity, fitted)
            }
            None => (views, sensitivity, Vec::new()),
        };
        let fit = match self.options.may_change() {
            true => Some(Fit::to(&splats, views.fitting(&splats), given, progress)?),
            false => None,
        };
        let fit = if self.refine.is_some() { fit.map(Fit::before_refining) } else { fit };
        let most = self.max_gaussians.filter(|&most| most < splats.len());
        let (mut fewer, mut sensitivity) = (None, sensitivity);
        let (mut refining, mut refined) = (None, None);
        if let Some(fit) = &fit {
            let mut removal = Removal { views: &views, renderer: &mut renderer, fit, progress };
            if let Some(most) = most {
                let made = removal.at_most(most, &splats, sensitivity)?;
                (fewer, sensitivity) = (Some(made.0), made.1);
            }
            if let Some(effort) = self.refine {
                let to = Refining::to(&splats, fitted, effort, progress)?;
                let judges = views.some_judging(PRESET_JUDGES);
                let judge = Judge::new(self.renderer()?, &splats, &judges, given, progress)?;
                let mut judge = judge.of_refined(true);
                let start = fewer.as_ref().unwrap_or(&splats);
                let bytes = source.source_bytes();
                let score = &mut |splats: &Splats| judge.score(splats, progress);
                let made = self.reduced(start, sensitivity, &mut removal, &to, score, bytes)?;
                refining = Some((to, made.gain));
                (fewer, sensitivity, refined) = (Some(made.splats), made.sensitivity, Some(made.report));
            }
        }
        let packed_scene = fewer.as_ref().unwrap_or(&splats);
        let options = match self.options.points_of_view.is_empty() {
            true => self.options.clone().with_points_of_view(views.points_of_view(POINTS_OF_VIEW)),
            false => self.options.clone(),
        };
        let packer = Packer::new(packed_scene, &sensitivity, &options)?;
        drop(sensitivity);
        let refitting = Refitting::new(packer, fit);
        let refitting = match refining {
            Some((refining, gain)) => refitting.refining(refining, gain),
            None => refitting,
        };
        let (packed, report, judge, score) = match self.quality {
            Quality::Preset(preset) => {
                // A preset cannot make up for Gaussians that a limit removes, so it is judged against the reduced scene.
                let judges = views.some_judging(PRESET_JUDGES);
                let judged_by = if most.is_some() { packed_scene } else { &splats };
                let judge = Judge::new(renderer, judged_by, &judges, given, progress)?;
                let mut judge = judge.of_refined(refitting.refines());
                let (packed, report, mut score) = pack_to_preset(&refitting, &mut judge, preset, progress)?;
                if most.is_some() {
                    judge = judge.against(&splats, progress)?;
                    score = judge.score(&packed.unpack()?, progress)?;
                }
                (packed, report, judge, score)
            }
            Quality::Target(target) => {
                let judges = views.some_judging(usize::MAX);
                let judge = Judge::new(renderer, &splats, &judges, given, progress)?;
                let mut judge = judge.of_refined(refitting.refines());
                let bytes = source.source_bytes();
                let (packed, report, score) =
                    pack_to_target(&refitting, &mut judge, target, bytes, progress)?;
                (packed, report, judge, score)
            }
        };
        let removed = (splats.len() - packed.len()) as u64;
        let packed = packed
            .with_device(device)
            .with_reached(reached(score, &judge))
            .with_removed(removed)
            .with_view(view);
        drop(refitting);
        let pack_seconds = clock.seconds();

        let clock = Stopwatch::start();
        let writer = LexiWriter::packed(&packed);
        let tensors = writer.tensor_bytes().to_vec();
        writer.write(sink, progress)?;
        let write_seconds = clock.seconds();
        let report = CompressionReport::packed(packed.head(), &report, &tensors, SensitivitySource::Views);
        let warnings = hidden.into_iter().collect();
        Ok(CompressionReport {
            read_seconds,
            look_seconds,
            pack_seconds,
            write_seconds,
            warnings,
            refined,
            ..report
        })
    }
}

/// Returns the name of the GPU on which `renderer` draws, if it is a GPU. Files record the name, because results differ
/// between GPUs.
fn gpu(renderer: &Renderer) -> Option<String> {
    renderer.is_gpu().then(|| renderer.name().to_owned())
}
