//! The numbers that the paper prints (arXiv 2605.30396v1), for comparison with ours.

use std::sync::LazyLock;

use serde::Deserialize;

use lexisplat_eval::metrics::Metric;

use super::measure::{self, Measure};
use super::{Method, Setting};

/// Every number in the paper's three tables: main, by tolerance, against photos.
const PRINTED: &str = include_str!("paper.csv");
/// Tolerance of the paper's main table. The table against photos names no tolerance; the text suggests the same one.
pub(crate) const TOLERANCE: f64 = 0.1;
/// Pursuit of the paper's method, orthogonal matching pursuit (section 4), by its name in results.
pub(crate) const PURSUIT: &str = "omp";
/// Tolerances of the paper's supplementary table.
pub(crate) const TOLERANCES: [f64; 4] = [0.03, 0.05, 0.1, 0.2];
/// Largest difference of two tolerances that count as equal.
const SAME: f64 = 1e-9;

/// Number of columns of [`PRINTED`] before the scenes.
const LABELS: usize = 4;
/// Number of the paper's scenes.
const SCENE_COUNT: usize = 13;

/// The paper's scenes, in the order of its main table. They are the headings of [`PRINTED`].
pub(crate) static SCENES: LazyLock<Vec<&str>> = LazyLock::new(|| {
    let header = PRINTED.lines().next().unwrap_or_default();
    header.split(',').skip(LABELS).take(SCENE_COUNT).collect()
});

/// A line of [`PRINTED`].
#[derive(Debug, Deserialize)]
struct Line {
    /// Table of the number. `main`: Table 1, compressed at tolerance 0.1, against the original's pictures, with ratio and
    /// FPS. `tolerance`: the same numbers at each tolerance, of the supplement. `base` and `compressed`: the trained and
    /// the compressed model against photos.
    table: String,
    method: Method,
    tolerance: Option<f64>,
    /// Quantity of the number: `psnr` in dB; `ssim`; `lpips`, of an unknown network and input range, because the paper
    /// does not name them; `ratio`, which is 45 over mean nonzeros by the paper's own numbers; `fps`; and `fps_dense` of
    /// the original.
    quantity: String,
    /// Numbers in the order of [`SCENES`].
    scenes: [f64; SCENE_COUNT],
    /// Mean as printed. A few printed means do not follow from their columns.
    #[cfg_attr(not(test), expect(dead_code, reason = "tests tell which"))]
    mean: f64,
}

static LINES: LazyLock<Vec<Line>> = LazyLock::new(|| {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(PRINTED.as_bytes());
    // Without headers, fields are read in order. The first line names the columns, and is skipped.
    reader.deserialize().skip(1).filter_map(Result::ok).collect()
});

/// Returns whether two tolerances are equal up to rounding.
fn same_tolerance(a: f64, b: f64) -> bool {
    (a - b).abs() < SAME
}

/// Returns whether a scene is one of the paper's.
pub(crate) fn has(name: &str) -> bool {
    scene(name).is_some()
}

/// Returns the index of a scene in [`SCENES`]. Case does not matter.
fn scene(name: &str) -> Option<usize> {
    SCENES.iter().position(|scene| scene.eq_ignore_ascii_case(name.trim()))
}

/// Returns the number printed in a table; `None` if there is none.
fn printed(table: &str, tolerance: Option<f64>, method: Method, quantity: &str, name: &str) -> Option<f64> {
    let is_same = |line: &&Line| match (line.tolerance, tolerance) {
        (Some(a), Some(b)) => same_tolerance(a, b),
        (a, b) => a == b,
    };
    let mut lines = LINES.iter().filter(is_same);
    let line =
        lines.find(|line| line.table == table && line.method == method && line.quantity == quantity)?;
    line.scenes.get(scene(name)?).copied()
}

/// Returns the paper's number for a measure: without a setting that of models as trained, otherwise that of compressed
/// models. The paper's FPS are of another device. Its LPIPS is assumed to be that of the 3DGS repository.
pub(crate) fn value(measure: Measure, method: Method, setting: Option<Setting>, scene: &str) -> Option<f64> {
    let tolerance = match setting {
        Some(Setting::Tolerance(tolerance)) => Some(tolerance),
        Some(_) => return None,
        None => None,
    };
    let is_main = tolerance.is_some_and(|tolerance| same_tolerance(tolerance, TOLERANCE));
    let (table, tolerance) = match measure {
        Measure::ToOriginal(_) => ("tolerance", Some(tolerance?)),
        Measure::CoefficientRatio => ("main", Some(tolerance?)),
        Measure::ToPhotos(_) if is_main => ("compressed", None),
        Measure::ToPhotos(_) if setting.is_none() => ("base", None),
        Measure::PhotoChange if is_main => {
            let psnr = |setting| value(Measure::ToPhotos(Metric::Psnr), method, setting, scene);
            return Some(psnr(setting)? - psnr(None)?);
        }
        _ => return None,
    };
    let quantity = match measure {
        Measure::ToOriginal(Metric::LpipsVggInria) | Measure::ToPhotos(Metric::LpipsVggInria) => "lpips",
        Measure::ToOriginal(metric) | Measure::ToPhotos(metric) => metric.name(),
        _ => "ratio",
    };
    printed(table, tolerance, method, quantity, scene)
}

/// Returns the mean over the 13 scenes at the main tolerance; `None` if the paper has no such numbers. It is computed
/// from the columns, because a few printed means do not follow from their columns.
pub(crate) fn mean(measure: Measure, method: Method) -> Option<f64> {
    let setting = Some(Setting::Tolerance(TOLERANCE));
    measure::mean(SCENES.iter().filter_map(|scene| value(measure, method, setting, scene)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_is_read() {
        assert_eq!(PRINTED.lines().count(), 79);
        // 3 methods x 6 quantities, x 4 tolerances x 3, x 2 against photos x 3, and EAGLES twice x 3.
        let count = |table: &str| LINES.iter().filter(|line| line.table == table).count();
        assert_eq!([count("main"), count("tolerance"), count("base"), count("compressed")], [18, 36, 15, 9]);
        let header = PRINTED.lines().next().unwrap();
        assert_eq!(header, format!("table,method,tolerance,metric,{},mean", SCENES.join(",")));
    }

    #[test]
    fn spot_values_are_the_papers() {
        use Method::{Eagles, EaglesNoSq, Gs3d, Mcmc, PixelGs};
        let (main, fine) = (Some(TOLERANCE), Some(0.03));
        let spots = [
            ("main", main, Gs3d, "psnr", "bicycle", 38.54),
            ("main", main, Mcmc, "ratio", "Drjohnson", 3.56),
            ("main", main, PixelGs, "fps", "treehill", 97.3),
            ("main", main, Mcmc, "fps_dense", "garden", 82.9),
            ("tolerance", fine, Mcmc, "psnr", "stump", 53.86),
            ("tolerance", Some(0.2), PixelGs, "lpips", "flowers", 0.0284),
            ("tolerance", Some(0.05), Gs3d, "ssim", "truck", 0.9897),
            // The table against photos has its scenes in another order.
            ("base", None, Gs3d, "psnr", "drjohnson", 29.41),
            ("compressed", None, PixelGs, "psnr", "truck", 25.38),
            ("compressed", None, Mcmc, "ssim", "garden", 0.9250),
            ("base", None, Eagles, "psnr", "bonsai", 31.24),
            ("base", None, EaglesNoSq, "lpips", "treehill", 0.2663),
        ];
        for (table, tolerance, method, quantity, scene, expected) in spots {
            let found = printed(table, tolerance, method, quantity, scene);
            assert_eq!(found, Some(expected), "{table} {method} {scene}");
        }
        assert_eq!(printed("main", main, Gs3d, "psnr", "garage"), None);
        assert_eq!(printed("tolerance", Some(0.07), Gs3d, "psnr", "garden"), None);
        assert_eq!(printed("compressed", None, Eagles, "psnr", "garden"), None);
        assert_eq!(printed("base", None, Gs3d, "ratio", "garden"), None);
    }

    #[test]
    fn measures_find_their_tables() {
        let at = |tolerance: f64| Some(Setting::Tolerance(tolerance));
        let of = |measure, method, setting| value(measure, method, setting, "bonsai");
        let (original, photos) = (Measure::ToOriginal(Metric::Psnr), Measure::ToPhotos(Metric::Psnr));
        assert_eq!(of(original, Method::Gs3d, at(0.05)), Some(44.14));
        assert_eq!(of(original, Method::Mcmc, at(0.1)), Some(43.09));
        assert_eq!(of(photos, Method::Eagles, None), Some(31.24));
        assert_eq!(of(Measure::CoefficientRatio, Method::Gs3d, at(0.1)), Some(4.65));
        for (measure, setting) in [
            (original, None),
            (photos, at(0.2)),
            (Measure::CoefficientRatio, at(0.2)),
            (Measure::SparseFps, at(0.1)),
            (original, Some(Setting::MaxNonzeros(1))),
            (Measure::ToPhotos(Metric::LpipsVgg), None),
        ] {
            assert_eq!(of(measure, Method::Gs3d, setting), None, "{measure:?} {setting:?}");
        }
        let means = [Measure::ToOriginal(Metric::Psnr), Measure::CoefficientRatio, Measure::PhotoChange];
        let rounded = means.map(|measure| (mean(measure, Method::PixelGs).unwrap() * 100.0).round() / 100.0);
        assert_eq!(rounded, [42.02, 4.55, -0.18]);
        assert_eq!(mean(Measure::PhotoChange, Method::Eagles), None);
    }

    /// The supplement repeats the main table at its tolerance.
    #[test]
    fn both_tables_agree_at_the_main_tolerance() {
        for method in [Method::Gs3d, Method::Mcmc, Method::PixelGs] {
            for quantity in ["psnr", "ssim", "lpips"] {
                for scene in SCENES.iter().copied() {
                    assert_eq!(
                        printed("main", Some(TOLERANCE), method, quantity, scene),
                        printed("tolerance", Some(TOLERANCE), method, quantity, scene)
                    );
                }
            }
        }
    }

    /// Columns are rounded, so their mean may be off by half a unit of the last digit, and the printed mean
    /// is rounded itself. A mean that is further off was not computed from its row.
    #[test]
    fn printed_means_follow_from_their_columns_but_for_four() {
        let mut wrong = Vec::new();
        for (line, row) in PRINTED.lines().skip(1).zip(LINES.iter()) {
            let digits = line.rsplit('.').next().unwrap().len();
            let unit = 10_f64.powi(-i32::try_from(digits).unwrap());
            let computed = row.scenes.iter().sum::<f64>() / 13.0;
            if (computed - row.mean).abs() > unit {
                wrong.push((
                    row.table.as_str(),
                    row.method.name(),
                    row.quantity.as_str(),
                    row.mean,
                    computed,
                ));
            }
        }
        let rounded: Vec<_> = wrong.iter().map(|w| (w.0, w.1, w.2, w.3, (w.4 * 1e4).round() / 1e4)).collect();
        assert_eq!(
            rounded,
            [
                ("main", "3dgs", "fps_dense", 169.3, 176.9615),
                ("main", "mcmc", "fps_dense", 113.0, 120.8077),
                ("compressed", "mcmc", "lpips", 0.1677, 0.1667),
                ("base", "eagles", "ssim", 0.8689, 0.8535),
            ]
        );
        // Rounded to its digits a fifth differs by one, which rounding of the columns explains.
        let is_fifth = |line: &&Line| line.table == "compressed" && line.method == Method::PixelGs;
        let fifth = LINES.iter().filter(is_fifth).find(|line| line.quantity == "ssim").unwrap();
        let (printed, computed) = (fifth.mean, fifth.scenes.iter().sum::<f64>() / 13.0);
        assert_eq!((printed, (computed * 1e4).round() / 1e4), (0.8619, 0.8618));
    }
}
