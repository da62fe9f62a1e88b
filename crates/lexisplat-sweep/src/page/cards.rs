//! The numbers at the top of the page.

use lexisplat::packed::Preset;
use lexisplat_eval::Summary;
use lexisplat_eval::metrics::Metric;
use maud::{Markup, html};

use super::{card, decibels};
use crate::grid::Grid;
use crate::measure::Measure;
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
        if let Some(psnr) = over(psnr).mean {
            let what = format!("mean PSNR against the original\u{2019}s pictures at {label}; more is closer");
            cards.push(card(decibels(&format!("{psnr:.1}")), &what));
        }
        if let Some(ratio) = over(Measure::FileRatio).mean {
            let what = format!("smaller at {label}: whole files, every byte counted, geometry exact");
            cards.push(card(times(ratio), &what));
        }
        if let Some(ratio) = over(Measure::CoefficientRatio).mean {
            let what = format!("fewer coefficients at {label}: the paper\u{2019}s way of counting");
            cards.push(card(times(ratio), &what));
        }
        if let Summary { mean: Some(mean), min: Some(worst), .. } = over(Measure::PhotoChange) {
            let what = format!("change of PSNR against photos at {label}; {worst:+.2} dB where it is worst");
            cards.push(card(decibels(&format!("{mean:+.2}")), &what));
        }
        if let Some(speedup) = over(Measure::Speedup).mean {
            let what = format!("the frames a second of dense SH, from codes at {label} on {}", grid.device());
            cards.push(card(times(speedup), &what));
        }
    }
    let packed = |measure| over_models(grid, Setting::Preset(PRESET), measure).mean;
    if let (Some(ratio), Some(psnr)) = (packed(Measure::FileRatio), packed(psnr)) {
        let what =
            format!("smaller as packed files ({}), everything quantised, at {psnr:.1} dB", PRESET.name());
        cards.push(card(times(ratio), &what));
    }
    html! { dl class="cards" { @for card in cards { (card) } } }
}
