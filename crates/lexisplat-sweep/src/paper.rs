//! The numbers that the paper prints (arXiv 2605.30396v1), for comparison with ours.

use std::sync::LazyLock;

use serde::Deserialize;

use super::Method;

/// Every printed number of the paper's three tables: main, by tolerance, against photos.
const PRINTED: &str = include_str!("paper.csv");
/// The tolerance of the paper's main table. Its table against photos names none; its text suggests the same.
pub(crate) const TOLERANCE: f64 = 0.1;
/// The pursuit of the paper's method, orthogonal matching pursuit (section 4), by its name in results.
pub(crate) const PURSUIT: &str = "omp";
/// Tolerances of the paper's supplementary table.
pub(crate) const TOLERANCES: [f64; 4] = [0.03, 0.05, 0.1, 0.2];
/// SH-rest coefficients of the paper's Gaussians: degree 3.
pub(crate) const COEFFICIENTS: f64 = 45.0;
/// Largest difference of two tolerances that count as equal.
const SAME: f64 = 1e-9;

/// Columns of [`PRINTED`] before the scenes.
const LABELS: usize = 4;
/// Number of the paper's scenes.
const SCENE_COUNT: usize = 13;

/// The paper's scenes, in the order of its main table: the headings of [`PRINTED`].
pub(crate) static SCENES: LazyLock<Vec<&str>> = LazyLock::new(|| {
    let header = PRINTED.lines().next().unwrap_or_default();
    header.split(',').skip(LABELS).take(SCENE_COUNT).collect()
});

/// One of the paper's tables.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Experiment {
    /// Table 1: compressed at tolerance 0.1 against the original's pictures, with ratio and FPS.
    Main,
    /// Supplement: compressed at this tolerance against the original's pictures.
    Tolerance(f64),
    /// Supplement: the trained model against photos; EAGLES with and without scalar quantisation too.
    Base,
    /// Supplement: the compressed model against photos.
    Compressed,
}

/// What the paper measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Quantity {
    /// PSNR in dB.
    Psnr,
    /// SSIM.
    Ssim,
    /// LPIPS. The paper does not say which network and input range it used.
    Lpips,
    /// `Comp Ratio`: 45 over mean nonzeros, by the paper's own numbers. Main table only.
    Ratio,
    /// Frames a second of the compressed model. Main table only.
    Fps,
    /// `FPS(-Comp)`: frames a second of the original. Main table only.
    FpsDense,
}

/// One line of [`PRINTED`].
#[derive(Debug, Deserialize)]
struct Line {
    experiment: String,
    method: Method,
    tolerance: Option<f64>,
    quantity: Quantity,
    /// In the order of [`SCENES`].
    scenes: [f64; SCENE_COUNT],
    /// As printed. A few do not follow from their columns.
    #[cfg_attr(not(test), expect(dead_code, reason = "tests tell which"))]
    mean: f64,
}

static LINES: LazyLock<Vec<Line>> = LazyLock::new(|| {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(PRINTED.as_bytes());
    // Without headers fields are read in order. The first line names the columns.
    reader.deserialize().skip(1).filter_map(Result::ok).collect()
});

fn find(experiment: Experiment, method: Method, quantity: Quantity) -> Option<&'static Line> {
    let (name, tolerance) = match experiment {
        Experiment::Main => ("main", Some(TOLERANCE)),
        Experiment::Tolerance(tolerance) => ("tolerance", Some(tolerance)),
        Experiment::Base => ("base", None),
        Experiment::Compressed => ("compressed", None),
    };
    let same = |printed: Option<f64>| match (printed, tolerance) {
        (Some(a), Some(b)) => same_tolerance(a, b),
        (a, b) => a == b,
    };
    LINES.iter().find(|line| {
        line.experiment == name && line.method == method && line.quantity == quantity && same(line.tolerance)
    })
}

/// Whether two tolerances are equal up to rounding.
pub(crate) fn same_tolerance(a: f64, b: f64) -> bool {
    (a - b).abs() < SAME
}

/// The index of a scene in [`SCENES`]. Case does not matter.
fn scene(name: &str) -> Option<usize> {
    SCENES.iter().position(|scene| scene.eq_ignore_ascii_case(name.trim()))
}

/// The printed number. `None` if the paper has none.
pub(crate) fn value(
    experiment: Experiment,
    method: Method,
    quantity: Quantity,
    scene_name: &str,
) -> Option<f64> {
    find(experiment, method, quantity)?.scenes.get(scene(scene_name)?).copied()
}

/// The mean over the 13 scenes, computed from their columns: a few printed means do not follow from theirs. `None` if
/// the paper has none.
pub(crate) fn mean(experiment: Experiment, method: Method, quantity: Quantity) -> Option<f64> {
    let scenes = &find(experiment, method, quantity)?.scenes;
    Some(scenes.iter().sum::<f64>() / scenes.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_is_read() {
        assert_eq!(PRINTED.lines().count(), 79);
        // 3 methods x 6 quantities, x 4 tolerances x 3, x 2 against photos x 3, and EAGLES twice x 3.
        let count = |table: &str| LINES.iter().filter(|line| line.experiment == table).count();
        assert_eq!([count("main"), count("tolerance"), count("base"), count("compressed")], [18, 36, 15, 9]);
        let header = PRINTED.lines().next().unwrap();
        assert_eq!(header, format!("table,method,tolerance,metric,{},mean", SCENES.join(",")));
    }

    #[test]
    fn spot_values_are_the_papers() {
        use Method::{Eagles, EaglesNoSq, Gs3d, Mcmc, PixelGs};
        use Quantity::{Fps, FpsDense, Lpips, Psnr, Ratio, Ssim};
        let spots = [
            (Experiment::Main, Gs3d, Psnr, "bicycle", 38.54),
            (Experiment::Main, Mcmc, Ratio, "Drjohnson", 3.56),
            (Experiment::Main, PixelGs, Fps, "treehill", 97.3),
            (Experiment::Main, Mcmc, FpsDense, "garden", 82.9),
            (Experiment::Tolerance(0.03), Mcmc, Psnr, "stump", 53.86),
            (Experiment::Tolerance(0.2), PixelGs, Lpips, "flowers", 0.0284),
            (Experiment::Tolerance(0.05), Gs3d, Ssim, "truck", 0.9897),
            // The table against photos has its scenes in another order.
            (Experiment::Base, Gs3d, Psnr, "drjohnson", 29.41),
            (Experiment::Compressed, PixelGs, Psnr, "truck", 25.38),
            (Experiment::Compressed, Mcmc, Ssim, "garden", 0.9250),
            (Experiment::Base, Eagles, Psnr, "bonsai", 31.24),
            (Experiment::Base, EaglesNoSq, Lpips, "treehill", 0.2663),
        ];
        for (table, method, quantity, scene, expected) in spots {
            assert_eq!(value(table, method, quantity, scene), Some(expected), "{table:?} {method} {scene}");
        }
        assert_eq!(value(Experiment::Main, Gs3d, Psnr, "garage"), None);
        assert_eq!(value(Experiment::Tolerance(0.07), Gs3d, Psnr, "garden"), None);
        assert_eq!(value(Experiment::Compressed, Eagles, Psnr, "garden"), None);
        assert_eq!(value(Experiment::Base, Gs3d, Ratio, "garden"), None);
    }

    /// The supplement repeats the main table at its tolerance.
    #[test]
    fn both_tables_agree_at_the_main_tolerance() {
        for method in [Method::Gs3d, Method::Mcmc, Method::PixelGs] {
            for quantity in [Quantity::Psnr, Quantity::Ssim, Quantity::Lpips] {
                for scene in SCENES.iter().copied() {
                    assert_eq!(
                        value(Experiment::Main, method, quantity, scene),
                        value(Experiment::Tolerance(TOLERANCE), method, quantity, scene)
                    );
                }
            }
        }
    }

    /// Columns are rounded, so their mean may be off by half a unit of the last digit, and the printed mean
    /// is rounded itself. What is further off than that was not computed from its row.
    #[test]
    fn printed_means_follow_from_their_columns_but_for_four() {
        let mut wrong = Vec::new();
        for (line, row) in PRINTED.lines().skip(1).zip(LINES.iter()) {
            let digits = line.rsplit('.').next().unwrap().len();
            let unit = 10_f64.powi(-i32::try_from(digits).unwrap());
            let computed = row.scenes.iter().sum::<f64>() / 13.0;
            if (computed - row.mean).abs() > unit {
                wrong.push((row.experiment.as_str(), row.method.name(), row.quantity, row.mean, computed));
            }
        }
        let rounded: Vec<_> = wrong.iter().map(|w| (w.0, w.1, w.2, w.3, (w.4 * 1e4).round() / 1e4)).collect();
        assert_eq!(
            rounded,
            [
                ("main", "3dgs", Quantity::FpsDense, 169.3, 176.9615),
                ("main", "mcmc", Quantity::FpsDense, 113.0, 120.8077),
                ("compressed", "mcmc", Quantity::Lpips, 0.1677, 0.1667),
                ("base", "eagles", Quantity::Ssim, 0.8689, 0.8535),
            ]
        );
        // Rounded to its digits a fifth differs by one, which rounding of the columns explains.
        let fifth = (Experiment::Compressed, Method::PixelGs, Quantity::Ssim);
        let printed = find(fifth.0, fifth.1, fifth.2).unwrap().mean;
        let computed = mean(fifth.0, fifth.1, fifth.2).unwrap();
        assert_eq!((printed, (computed * 1e4).round() / 1e4), (0.8619, 0.8618));
    }
}
