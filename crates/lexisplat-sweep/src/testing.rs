//! Made-up results for tests. The numbers are chosen so that cells can be computed by hand.

use lexisplat::packed::Preset;

use super::{Fps, Method, Point, Results, SceneResult, Setting, Skipped};
use lexisplat_eval::metrics::Metric;
use lexisplat_eval::{Comparison, FrameRate, ViewScore};

/// Name of a scene that every format must escape.
pub(super) const ODD: &str = "a&b|<c>\"_%$";

pub(super) fn view(name: &str, psnr: Option<f64>) -> ViewScore {
    let identical = psnr.is_none();
    let more = [(Metric::LpipsVggInria, if identical { 0.0 } else { 0.25 })].into();
    ViewScore::new(name, [64, 48], psnr, if identical { 1.0 } else { 0.9 }, more)
}

/// Returns rates whose rounds differ by 5 % to each side.
pub(super) fn fps(dense: f64, sparse: f64) -> Fps {
    let rate = |mean: f64| FrameRate { mean, least: 0.95 * mean, most: 1.05 * mean };
    Fps { dense: rate(dense), sparse: rate(sparse) }
}

/// Returns the comparison of two views with PSNRs around `psnr`; both views are identical for `None`.
pub(super) fn comparison(psnr: Option<f64>) -> Comparison {
    Comparison::of(vec![view("front", psnr.map(|p| p - 1.0)), view("back|<", psnr.map(|p| p + 1.0))])
}

pub(super) fn point(setting: Setting, nonzeros: f64, psnr: Option<f64>) -> Point {
    Point {
        setting,
        file_bytes: 100_000,
        sh_bytes: 30_000,
        resident_sh_bytes: 50_000,
        atoms: 90,
        mean_nonzeros: nonzeros,
        coefficient_ratio: (nonzeros > 0.0).then(|| 45.0 / nonzeros),
        max_residual: (!matches!(setting, Setting::Preset(_))).then_some(0.099),
        over_tolerance: 0,
        to_original: comparison(psnr),
        to_photos: None,
        fps: None,
        seconds: 1.5,
    }
}

pub(super) fn scene(dataset: &str, name: &str, method: Method) -> SceneResult {
    SceneResult {
        dataset: dataset.to_owned(),
        name: name.to_owned(),
        method,
        model: format!("{name}.ply"),
        gaussians: 1000,
        sh_degree: 3,
        ply_bytes: 250_000,
        shipped_bytes: None,
        views_from: "cameras.json".to_owned(),
        views: 2,
        size: [64, 48],
        device: "cpu".to_owned(),
        on_gpu: false,
        to_photos: None,
        fps: None,
        points: Vec::new(),
    }
}

/// Returns results of three scenes: bonsai by all methods with photos, garden by one method with identical pictures, and
/// an odd scene by another method. One more scene was skipped.
pub(super) fn results() -> Results {
    let fps = |dense, sparse| Some(fps(dense, sparse));
    let mut bonsai = scene("Mip-NeRF 360", "bonsai", Method::Gs3d);
    bonsai.to_photos = Some(comparison(Some(32.0)));
    bonsai.points = vec![
        Point {
            to_photos: Some(comparison(Some(31.75))),
            fps: fps(10.0, 12.0),
            ..point(Setting::Tolerance(0.1), 9.0, Some(42.0))
        },
        point(Setting::Tolerance(0.05), 15.0, Some(48.0)),
        point(Setting::Tolerance(1.0), 1.5, Some(30.0)),
        Point {
            max_residual: Some(2.5),
            over_tolerance: 7,
            ..point(Setting::MaxNonzeros(4), 4.0, Some(36.0))
        },
        point(Setting::MaxNonzeros(1), 0.9, Some(29.0)),
        point(Setting::MaxNonzeros(0), 0.0, Some(25.0)),
        Point { file_bytes: 20_000, ..point(Setting::Preset(Preset::Small), 3.0, Some(35.0)) },
        Point { file_bytes: 40_000, ..point(Setting::Preset(Preset::High), 6.0, Some(45.0)) },
    ];
    let mut bonsai_mcmc = scene("", "Bonsai", Method::Mcmc);
    bonsai_mcmc.to_photos = Some(comparison(Some(33.0)));
    bonsai_mcmc.points = vec![
        Point {
            to_photos: Some(comparison(Some(32.5))),
            fps: fps(8.0, 10.0),
            ..point(Setting::Tolerance(0.1), 15.0, Some(44.0))
        },
        point(Setting::Tolerance(1.0), 3.0, Some(31.0)),
    ];
    let mut garden = scene("Mip-NeRF 360", "garden", Method::Gs3d);
    garden.points = vec![point(Setting::Tolerance(0.1), 11.25, None)];
    let mut odd = scene(ODD, ODD, Method::Mcmc);
    odd.to_photos = Some(comparison(Some(28.0)));
    odd.points = vec![Point {
        to_photos: Some(comparison(Some(27.0))),
        fps: fps(4.0, 6.0),
        ..point(Setting::Tolerance(0.1), 5.0, Some(40.0))
    }];
    let mut eagles = scene("Mip-NeRF 360", "bonsai", Method::Eagles);
    eagles.to_photos = Some(comparison(Some(31.0)));
    eagles.shipped_bytes = Some(50_000);
    let mut eagles_no_sq = scene("Mip-NeRF 360", "bonsai", Method::EaglesNoSq);
    eagles_no_sq.to_photos = Some(comparison(Some(31.5)));
    Results {
        version: "0.1.0".to_owned(),
        command: format!("lexisplat sweep '{ODD}.toml'"),
        pursuit: "omp".to_owned(),
        layout: "f16".to_owned(),
        eight_bit: true,
        scenes: vec![bonsai, bonsai_mcmc, garden, odd, eagles, eagles_no_sq],
        skipped: vec![Skipped {
            dataset: "Deep Blending".to_owned(),
            name: "play<room>".to_owned(),
            method: Method::PixelGs,
            reason: "no such file: a|b & \"c\"".to_owned(),
        }],
    }
}
