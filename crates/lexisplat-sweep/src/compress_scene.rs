//! One model compressed in one way.

use std::time::Instant;

use lexisplat::packed::{PackOptions, Packed, Packer};
use lexisplat::{CompressOptions, Model, Progress, Sensitivity, Splats, compress, lexi};
use lexisplat_eval::{Comparison, Result, Views};
use lexisplat_render::Renderer;

use super::measure::quotient;
use super::options::SweepOptions;
use super::results::{Point, Setting};

/// Compresses `splats`. Returns the model, and a point without scores and speed. `sensitivity` is measured for the
/// first packed file of a model and reused for the others.
pub(super) fn compress_scene(
    splats: &Splats,
    setting: Setting,
    options: &SweepOptions,
    renderer: &mut Renderer,
    sensitivity: &mut Option<Sensitivity>,
    progress: &dyn Progress,
) -> Result<(Model, Point)> {
    let clock = Instant::now();
    let seconds: f64;
    let (model, mean_nonzeros, file_bytes, sh_bytes) = if let Setting::Preset(preset) = setting {
        // As `lexisplat compress --preset` does without cameras.
        let sensitivity = match sensitivity {
            Some(sensitivity) => sensitivity,
            None => sensitivity.insert(Views::generated(splats).sensitivity(renderer, splats, &mut || ())?),
        };
        let mut packing = PackOptions::default();
        packing.seed = options.seed;
        let packer = Packer::new(splats, sensitivity, &packing)?;
        let (packed, report) = packer.pack(packer.step_for(preset.decibels()), progress)?;
        seconds = clock.elapsed().as_secs_f64();
        let model = lexi::unpack(preset.name(), &packed)?;
        (model, report.mean_nonzeros, lexi::packed_bytes(&packed), packed_sh_bytes(&packed)?)
    } else {
        let mut exact = CompressOptions::default();
        (exact.pursuit, exact.layout, exact.seed) = (options.pursuit, options.layout, options.seed);
        (exact.tolerance, exact.max_nonzeros) = match setting {
            Setting::Tolerance(tolerance) => (Some(tolerance), None),
            Setting::MaxNonzeros(most) => (None, Some(most)),
            Setting::Preset(_) => (None, None),
        };
        let (model, report) = compress(splats.clone(), &exact, progress)?;
        seconds = clock.elapsed().as_secs_f64();
        let (file_bytes, sh_bytes) = (lexi::file_bytes(&model)?, lexi::sh_bytes(&model)?);
        (model, report.mean_nonzeros, file_bytes, sh_bytes)
    };
    let point = Point {
        setting,
        file_bytes,
        sh_bytes,
        resident_sh_bytes: model.resident_sh_bytes() as u64,
        atoms: model.dictionary.len(),
        mean_nonzeros,
        coefficient_ratio: quotient(splats.degree.rest() as f64, mean_nonzeros),
        max_residual: (!matches!(setting, Setting::Preset(_))).then_some(model.record.max_residual),
        over_tolerance: model.record.over_tolerance,
        to_original: Comparison::of(Vec::new()),
        to_photos: None,
        fps: None,
        seconds,
    };
    Ok((model, point))
}

/// Bytes of view-dependent colour in a packed file.
fn packed_sh_bytes(packed: &Packed) -> Result<u64> {
    let is_sh = |name: &str| name == "dictionary" || name.starts_with("codes.");
    let bits: f64 = packed.stream_bits()?.iter().filter(|s| is_sh(s.attribute)).map(|s| s.bits).sum();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the file's size")]
    let bytes = (bits / 8.0).round() as u64;
    Ok(bytes)
}
