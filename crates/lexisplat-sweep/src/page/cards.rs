//! The numbers at the top of the page.

use lexisplat::packed::Preset;
use lexisplat_eval::Summary;
use lexisplat_eval::metrics::Metric;
use maud::{Markup, html};

use super::{card, decibels};
use crate::grid::Grid;
use crate::measure::Measure;
use crate::numbers::signed;
use crate::{SceneResult, Setting};

/// The preset that has a card: the default of packed files.
const PRESET: Preset = Preset::Balanced;

/// A measure over all models that were compressed at one setting.
fn over_models(grid: &Grid<'_>, setting: Setting, measure: Measure) -> Summary {
    let value = |(_, scene): (&str, &SceneResult)| measure.value(scene, Some(scene.point(setting)?));
    Summary::of(grid.scenes().filter_map(value))
}

fn times(value: f64) -> Markup {
    html! { (format!("{value:.2}\u{d7}")) }
}

/// A card for each number of the main setting that there is, and one for packed files.
pub(super) fn cards(grid: &Grid<'_>) -> Markup {
    let psnr = Measure::ToOriginal(Metric::Psnr);
    let mut cards = Vec::new();
    if let Some(setting) = grid.main_setting() {
        let label = setting.label();
        let over = |measure| over_models(grid, setting, measure);
        let mut add = |value: Option<Markup>, what: &str| cards.extend(value.map(|value| card(value, what)));
        let decibels_of = |value: f64| decibels(&format!("{value:.1}"));
        add(
            over(psnr).mean.map(decibels_of),
            &format!("mean PSNR against the original\u{2019}s pictures at {label}; more is closer"),
        );
        add(
            over(Measure::FileRatio).mean.map(times),
            &format!("smaller at {label}: whole files, every byte counted, geometry exact"),
        );
        add(
            over(Measure::CoefficientRatio).mean.map(times),
            &format!("fewer coefficients at {label}: the paper\u{2019}s way of counting"),
        );
        let change = over(Measure::PhotoChange);
        let worst = signed(change.min.unwrap_or_default(), 2);
        add(
            change.mean.map(|mean| decibels(&signed(mean, 2))),
            &format!("change of PSNR against photos at {label}; {worst} dB where it is worst"),
        );
        let speedup = over(Measure::Speedup).mean;
        let noise = dense_noise(grid, setting).unwrap_or(f64::INFINITY);
        let is_told = speedup.is_none_or(|speedup| (speedup - 1.0).abs() > noise);
        let within = if is_told { "" } else { "; no more than that itself varies by" };
        add(
            speedup.map(times),
            &format!("the frames a second of dense SH, from codes at {label} on {}{within}", grid.device()),
        );
    }
    let packed = |measure| over_models(grid, Setting::Preset(PRESET), measure).mean;
    if let (Some(ratio), Some(psnr)) = (packed(Measure::FileRatio), packed(psnr)) {
        let what =
            format!("smaller as packed files ({}), everything quantised, at {psnr:.1} dB", PRESET.name());
        cards.push(card(times(ratio), &what));
    }
    html! { dl class="cards" { @for card in cards { (card) } } }
}

/// By how much the same drawing of dense SH varied over the rounds beside a setting: the range over the mean, of the model
/// where it is largest. `None` if frames were not timed.
fn dense_noise(grid: &Grid<'_>, setting: Setting) -> Option<f64> {
    let noise = grid.scenes().filter_map(|(_, scene)| {
        let dense = scene.point(setting)?.fps?.dense;
        (dense.mean > 0.0).then(|| (dense.most - dense.least) / dense.mean)
    });
    noise.reduce(f64::max)
}
