//! One model compressed in one way.

use std::time::Instant;

use lexisplat::lexi::LexiWriter;
use lexisplat::packed::{PackOptions, Packer, Preset};
use lexisplat::{CompressOptions, Layout, Model, Progress, Pursuit, Sensitivity, Splats, compress};
use lexisplat_render::Renderer;

use super::results::Setting;
use lexisplat_eval::Result;
use lexisplat_eval::Views;

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

/// Compresses `splats`. `seen` is what pictures depend on, looked up once a model for its packed files.
pub(super) fn squeeze(
    splats: Splats,
    setting: Setting,
    how: How,
    renderer: &mut Renderer,
    seen: &mut Option<Sensitivity>,
    progress: &dyn Progress,
) -> Result<Squeezed> {
    match setting {
        Setting::Tolerance(tolerance) => exact(splats, Some(tolerance), None, how, progress),
        Setting::MaxNonzeros(most) => exact(splats, None, Some(most), how, progress),
        Setting::Preset(preset) => packed(&splats, preset, how.seed, renderer, seen, progress),
    }
}

fn exact(
    splats: Splats,
    tolerance: Option<f64>,
    max_nonzeros: Option<u8>,
    how: How,
    progress: &dyn Progress,
) -> Result<Squeezed> {
    let clock = Instant::now();
    let mut options = CompressOptions::default();
    options.tolerance = tolerance;
    options.max_nonzeros = max_nonzeros;
    options.pursuit = how.pursuit;
    options.values = how.layout.values();
    options.seed = how.seed;
    let (model, report) = compress(splats, &options, progress)?;
    let seconds = clock.elapsed().as_secs_f64();
    let writer = LexiWriter::exact(&model, how.layout.codes())?;
    let (file_bytes, sh_bytes) = (writer.file_bytes(), writer.sh_bytes());
    drop(writer);
    Ok(Squeezed {
        file_bytes,
        sh_bytes,
        mean_nonzeros: report.mean_nonzeros,
        coefficient_ratio: report.coefficient_ratio(),
        max_residual: Some(model.record().max_residual),
        over_tolerance: model.record().over_tolerance,
        seconds,
        model,
    })
}

/// As `lexisplat compress --preset` does without cameras.
fn packed(
    splats: &Splats,
    preset: Preset,
    seed: u64,
    renderer: &mut Renderer,
    seen: &mut Option<Sensitivity>,
    progress: &dyn Progress,
) -> Result<Squeezed> {
    let clock = Instant::now();
    let seen = match seen {
        Some(seen) => seen,
        None => seen.insert(Views::generated(splats).sensitivity(renderer, splats, &mut || ())?),
    };
    let mut options = PackOptions::default();
    options.seed = seed;
    let packer = Packer::new(splats, seen, &options)?;
    let (packed, report) = packer.pack(packer.step_for(preset.decibels()), progress)?;
    let seconds = clock.elapsed().as_secs_f64();
    let dim = splats.degree.rest();
    let is_sh = |name: &str| name == "dictionary" || name.starts_with("codes.");
    let sh_bits: f64 = packed.stream_bits()?.iter().filter(|s| is_sh(s.attribute)).map(|s| s.bits).sum();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the file's size")]
    let sh_bytes = (sh_bits / 8.0).round() as u64;
    Ok(Squeezed {
        file_bytes: LexiWriter::packed(&packed).file_bytes(),
        sh_bytes,
        mean_nonzeros: report.mean_nonzeros,
        coefficient_ratio: (report.mean_nonzeros > 0.0).then(|| dim as f64 / report.mean_nonzeros),
        max_residual: None,
        over_tolerance: packed.head().record().over_tolerance,
        seconds,
        model: packed.unpack()?,
    })
}
