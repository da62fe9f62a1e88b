//! The numbers at the top of the page.

use lexisplat::packed::Preset;
use lexisplat_eval::Summary;
use lexisplat_eval::metrics::Metric;
use maud::{Markup, html};

use super::{card, decibels};
use crate::curve::{At, Kind, curve, dense_noise};
use crate::grid::Grid;
use crate::measure::Measure;
use crate::table::signed;
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
            let what = format!(
                "change of PSNR against photos at {label}; {} dB where it is worst",
                signed(worst, 2)
            );
            cards.push(card(decibels(&signed(mean, 2)), &what));
        }
        if let Some(speedup) = over(Measure::Speedup).mean {
            let what = format!("the frames a second of dense SH, from codes at {label} on {}", grid.device());
            let points: Vec<At<'_>> = grid
                .methods
                .iter()
                .flat_map(|&method| curve(grid, method, Kind::Tolerances, None))
                .filter(|at| at.setting == setting)
                .collect();
            let noise = dense_noise(&points).unwrap_or(f64::INFINITY);
            let within =
                if (speedup - 1.0).abs() > noise { "" } else { "; no more than that itself varies by" };
            cards.push(card(times(speedup), &format!("{what}{within}")));
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
