//! One model compressed in one way.

use std::sync::Arc;
use std::time::Instant;

use lexisplat::packed::PackOptions;
use lexisplat::{CompressOptions, Layout, Limits, Model, Progress, Pursuit, Sensitivity, Splats, lexi};
use lexisplat_eval::compression::PackingViews;
use lexisplat_eval::{Compression, Packing, Result};
use lexisplat_render::Renderer;

use super::results::Setting;

/// How models are compressed besides the [`Setting`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct How {
    pub(super) pursuit: Pursuit,
    pub(super) layout: Layout,
    pub(super) seed: u64,
}

/// A compressed model and what is known of it before it is drawn.
pub(super) struct Squeezed {
    pub(super) model: Model,
    pub(super) file_bytes: u64,
    pub(super) sh_bytes: u64,
    pub(super) mean_nonzeros: f64,
    pub(super) coefficient_ratio: Option<f64>,
    pub(super) max_residual: Option<f64>,
    pub(super) over_tolerance: u64,
    pub(super) seconds: f64,
}

/// Compresses `splats`. The sensitivity is measured for the first packed file of a model and kept in
/// `sensitivity` for the others.
pub(super) fn squeeze(
    splats: &Splats,
    setting: Setting,
    how: How,
    renderer: &mut Renderer,
    sensitivity: &mut Option<Arc<Sensitivity>>,
    progress: &dyn Progress,
) -> Result<Squeezed> {
    let clock = Instant::now();
    let mut exact = CompressOptions::default();
    (exact.pursuit, exact.values, exact.seed) = (how.pursuit, how.layout.values(), how.seed);
    let compression: Compression = match setting {
        Setting::Tolerance(tolerance) => {
            exact.tolerance = Some(tolerance);
            Compression::Exact(exact, how.layout.codes())
        }
        Setting::MaxNonzeros(most) => {
            (exact.tolerance, exact.max_nonzeros) = (None, Some(most));
            Compression::Exact(exact, how.layout.codes())
        }
        Setting::Preset(preset) => {
            let measured = match sensitivity {
                Some(measured) => measured,
                None => {
                    let views = PackingViews::generated(splats);
                    sensitivity.insert(Arc::new(views.sensitivity(renderer, splats, progress)?))
                }
            };
            let mut options = PackOptions::default();
            options.seed = how.seed;
            Packing::new(preset).with_options(options).with_sensitivity(Arc::clone(measured)).into()
        }
    };
    let look_seconds = clock.elapsed().as_secs_f64();
    let mut file = Vec::new();
    let report = compression.run(splats, &mut file, progress)?;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the file's size")]
    let sh_bytes = report.sh_bytes.round() as u64;
    let is_exact = report.layout != Layout::Packed;
    Ok(Squeezed {
        model: lexi::read_bytes("the compressed model", &file, &Limits::default())?,
        file_bytes: report.file_bytes,
        sh_bytes,
        mean_nonzeros: report.mean_nonzeros,
        coefficient_ratio: report.coefficient_ratio,
        max_residual: is_exact.then_some(report.record.max_residual),
        over_tolerance: report.record.over_tolerance,
        seconds: look_seconds + report.pack_seconds,
    })
}
