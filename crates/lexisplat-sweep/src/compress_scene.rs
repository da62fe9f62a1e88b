//! One model compressed in one way.

use std::sync::Arc;

use lexisplat::packed::PackOptions;
use lexisplat::{CompressOptions, Limits, Model, Progress, Sensitivity, Splats, Stopwatch, lexi};
use lexisplat_eval::compression::PackingViews;
use lexisplat_eval::{Compression, CompressionReport, Packing, Result};
use lexisplat_render::Renderer;

use super::options::SweepOptions;
use super::results::Setting;

/// Compresses `splats`. `sensitivity` is measured for the first packed file of a model and reused for the others.
pub(super) fn compress_scene(
    splats: &Splats,
    setting: Setting,
    options: &SweepOptions,
    renderer: &mut Renderer,
    sensitivity: &mut Option<Arc<Sensitivity>>,
    progress: &dyn Progress,
) -> Result<(Model, CompressionReport)> {
    let clock = Stopwatch::start();
    let exact = CompressOptions::default()
        .with_pursuit(options.pursuit)
        .with_values(options.layout.values())
        .with_seed(options.seed);
    let codes = options.layout.codes();
    let compression = match setting {
        Setting::Tolerance(tolerance) => Compression::Exact(exact.with_tolerance(tolerance), codes),
        Setting::MaxNonzeros(most) => {
            Compression::Exact(exact.with_tolerance(None).with_max_nonzeros(most), codes)
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
            let packing = PackOptions::default().with_seed(options.seed);
            Packing::new(preset).with_options(packing).with_sensitivity(Arc::clone(measured)).into()
        }
    };
    let look_seconds = clock.seconds();
    let mut file = Vec::new();
    let mut report = compression.run(splats, &mut file, progress)?;
    report.look_seconds += look_seconds;
    Ok((lexi::read_bytes("the compressed model", &file, &Limits::default())?, report))
}
