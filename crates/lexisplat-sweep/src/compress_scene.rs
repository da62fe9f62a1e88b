//! Compresses one model in one way.

use std::sync::Arc;

use lexisplat::packed::PackOptions;
use lexisplat::{CompressOptions, Limits, Model, Progress, Splats, Stopwatch, lexi};
use lexisplat_compress::{Compression, CompressionReport, Looked, Packing, Result, Viewpoints};
use lexisplat_render::Renderer;

use super::options::SweepOptions;
use super::results::Setting;

/// Compresses `splats`. The views and the sensitivity of the model are measured for its first packed file. `looked` keeps
/// them for the other files.
pub(super) fn compress_scene(
    splats: &Splats,
    setting: Setting,
    options: &SweepOptions,
    renderer: &mut Renderer,
    looked: &mut Option<Arc<Looked>>,
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
        // The result is that of `lexisplat compress --preset` without cameras.
        Setting::Preset(preset) => {
            let looked = match looked {
                Some(looked) => looked,
                None => {
                    looked.insert(Arc::new(Looked::at(renderer, splats, None, Viewpoints::Auto, progress)?))
                }
            };
            let packing = PackOptions::default().with_seed(options.seed);
            Packing::new(preset).with_options(packing).with_looked(Arc::clone(looked)).into()
        }
    };
    let look_seconds = clock.seconds();
    let mut file = Vec::new();
    let mut report = compression.run(splats, &mut file, progress)?;
    report.look_seconds += look_seconds;
    Ok((lexi::read_bytes("the compressed model", &file, &Limits::default())?, report))
}
