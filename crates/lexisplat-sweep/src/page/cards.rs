//! The numbers at the top of the page.

use lexisplat::packed::Preset;
use lexisplat_eval::Summary;
use lexisplat_eval::metrics::Metric;
use maud::{Markup, html};

use super::card;
use crate::grid::Grid;
use crate::measure::Measure;
use crate::numbers::signed;
use crate::{SceneResult, Setting};

/// Preset with a card: the default of packed files.
const PRESET: Preset = Preset::Balanced;
/// Sign after ratios.
const TIMES: &str = "\u{d7}";

/// Returns the summary of a measure over all models that were compressed at one setting.
fn over_models(grid: &Grid<'_>, setting: Setting, measure: Measure) -> Summary {
    let value = |(_, scene): (&str, &SceneResult)| measure.value(scene, Some(scene.point(setting)?));
    Summary::of(grid.scenes().filter_map(value).filter(|value| value.is_finite()))
}

/// Returns how much the frame rate of the same dense SH varied over the rounds of a setting: the range over the mean, for
/// the model with the largest variation. It is infinite if frames were not timed.
fn dense_noise(grid: &Grid<'_>, setting: Setting) -> f64 {
    let noise = grid.scenes().filter_map(|(_, scene)| {
        let dense = scene.point(setting)?.fps?.dense;
        (dense.mean > 0.0).then(|| (dense.most - dense.least) / dense.mean)
    });
    noise.reduce(f64::max).unwrap_or(f64::INFINITY)
}

/// Returns a card for each existing number of the main setting, and a card for packed files.
pub(super) fn cards(grid: &Grid<'_>) -> Markup {
    let psnr = Measure::ToOriginal(Metric::Psnr);
    let mut cards = Vec::new();
    let mut add = |setting, measure, unit, what: String| {
        let mean = over_models(grid, setting, measure).mean;
        cards.extend(mean.map(|mean| card(html! { (measure.shown(Some(mean))) small { (unit) } }, &what)));
    };
    if let Some(setting) = grid.main_setting() {
        let (label, device) = (setting.label(), grid.device());
        let worst = over_models(grid, setting, Measure::PhotoChange).min.unwrap_or_default();
        let worst = format!("{} dB where it is worst", signed(worst, 2));
        let speedup = over_models(grid, setting, Measure::Speedup).mean.unwrap_or(1.0);
        let is_told = (speedup - 1.0).abs() > dense_noise(grid, setting);
        let within = if is_told { "" } else { "; no more than that itself varies by" };
        add(setting, psnr, " dB", format!("mean PSNR against the original\u{2019}s pictures at {label}"));
        add(setting, Measure::FileRatio, TIMES, format!("smaller whole files at {label}, geometry exact"));
        add(
            setting,
            Measure::CoefficientRatio,
            TIMES,
            format!("fewer coefficients at {label}, the paper\u{2019}s count"),
        );
        add(
            setting,
            Measure::PhotoChange,
            " dB",
            format!("change of PSNR against photos at {label}; {worst}"),
        );
        let what = format!("the frames a second of dense SH, from codes at {label} on {device}{within}");
        add(setting, Measure::Speedup, TIMES, what);
    }
    let packed = Setting::Preset(PRESET);
    if let Some(psnr) = over_models(grid, packed, psnr).mean {
        let what =
            format!("smaller as packed files ({}), everything quantised, at {psnr:.1} dB", PRESET.name());
        add(packed, Measure::FileRatio, TIMES, what);
    }
    html! { dl class="cards" { @for card in cards { (card) } } }
}
