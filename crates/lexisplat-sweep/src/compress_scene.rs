//! One model compressed in one way.

use std::sync::Arc;
use std::time::Instant;

use lexisplat::packed::PackOptions;
use lexisplat::{CompressOptions, Layout, Limits, Model, Progress, Sensitivity, Splats, lexi};
use lexisplat_eval::compression::PackingViews;
use lexisplat_eval::{Comparison, Compression, Packing, Result};
use lexisplat_render::Renderer;

use super::options::SweepOptions;
use super::results::{Point, Setting};

/// Compresses `splats`. Returns the model, and a point without scores and speed. `sensitivity` is measured for the
/// first packed file of a model and reused for the others.
pub(super) fn compress_scene(
    splats: &Splats,
    setting: Setting,
    options: &SweepOptions,
    renderer: &mut Renderer,
    sensitivity: &mut Option<Arc<Sensitivity>>,
    progress: &dyn Progress,
) -> Result<(Model, Point)> {
    let clock = Instant::now();
    let mut exact = CompressOptions::default();
    (exact.pursuit, exact.values, exact.seed) = (options.pursuit, options.layout.values(), options.seed);
    let compression: Compression = match setting {
        Setting::Tolerance(tolerance) => {
            exact.tolerance = Some(tolerance);
            Compression::Exact(exact, options.layout.codes())
        }
        Setting::MaxNonzeros(most) => {
            (exact.tolerance, exact.max_nonzeros) = (None, Some(most));
            Compression::Exact(exact, options.layout.codes())
        }
        // As `lexisplat compress --preset` does without cameras.
        Setting::Preset(preset) => {
            let measured = match sensitivity {
                Some(measured) => measured,
                None => {
                    let views = PackingViews::generated(splats);
                    sensitivity.insert(Arc::new(views.sensitivity(renderer, splats, progress)?))
                }
            };
            let mut packing = PackOptions::default();
            packing.seed = options.seed;
            Packing::new(preset).with_options(packing).with_sensitivity(Arc::clone(measured)).into()
        }
    };
    let look_seconds = clock.elapsed().as_secs_f64();
    let mut file = Vec::new();
    let report = compression.run(splats, &mut file, progress)?;
    let model = lexi::read_bytes("the compressed model", &file, &Limits::default())?;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the file's size")]
    let sh_bytes = report.sh_bytes.round() as u64;
    let is_exact = report.layout != Layout::Packed;
    let point = Point {
        setting,
        file_bytes: report.file_bytes,
        sh_bytes,
        resident_sh_bytes: model.resident_sh_bytes() as u64,
        atoms: model.dictionary().len(),
        mean_nonzeros: report.mean_nonzeros,
        coefficient_ratio: report.coefficient_ratio,
        max_residual: is_exact.then_some(report.record.max_residual),
        over_tolerance: report.record.over_tolerance,
        to_original: Comparison::of(Vec::new()),
        to_photos: None,
        fps: None,
        seconds: look_seconds + report.pack_seconds,
    };
    Ok((model, point))
}
