//! All measurements of a sweep as one long CSV, for other programs.

use lexisplat_eval::Comparison;
use lexisplat_eval::metrics::Metric;

use super::{Results, csv_text};

/// Columns of [`long_csv`].
const HEADER: [&str; 8] = ["dataset", "scene", "method", "setting", "against", "view", "metric", "value"];

/// The last four columns: the reference of the number, its view, its name, and the number.
type Value = [String; 4];

/// Returns a CSV with one number on each line.
///
/// `setting` is `original` for the model itself. For scores, `against` is `original` or `photos`, and `view` is the name
/// of a view or `mean`. For sizes, frame rates and other numbers both are empty. The PSNR of identical pictures is `inf`.
/// Its mean is over the views that are not identical.
pub(crate) fn long_csv(results: &Results) -> String {
    let mut lines: Vec<Vec<String>> = vec![HEADER.map(str::to_owned).into()];
    for scene in &results.scenes {
        let mut add = |setting: &str, values: Vec<Value>| {
            let labels = [&scene.dataset, &scene.name, scene.method.name(), setting].map(str::to_owned);
            lines.extend(values.into_iter().map(|value| [labels.clone(), value].concat()));
        };
        let model = [
            number("gaussians", Some(scene.gaussians)),
            number("sh_degree", Some(scene.sh_degree)),
            number("ply_bytes", Some(scene.ply_bytes)),
            number("shipped_bytes", scene.shipped_bytes),
            number("views", Some(scene.views)),
        ];
        add(
            "original",
            model.into_iter().flatten().chain(scores("photos", scene.to_photos.as_ref())).collect(),
        );
        for point in &scene.points {
            let numbers = [
                number("file_bytes", Some(point.file_bytes)),
                number("sh_bytes", Some(point.sh_bytes)),
                number("resident_sh_bytes", Some(point.resident_sh_bytes)),
                number("atoms", Some(point.atoms)),
                number("mean_nonzeros", Some(point.mean_nonzeros)),
                number("coefficient_ratio", point.coefficient_ratio),
                number("max_residual", point.max_residual),
                number("over_tolerance", Some(point.over_tolerance)),
                number("seconds", Some(point.seconds)),
                number("fps", point.fps.map(|fps| fps.sparse.mean)),
                number("fps_least", point.fps.map(|fps| fps.sparse.least)),
                number("fps_most", point.fps.map(|fps| fps.sparse.most)),
                number("fps_dense", point.fps.map(|fps| fps.dense.mean)),
                number("fps_dense_least", point.fps.map(|fps| fps.dense.least)),
                number("fps_dense_most", point.fps.map(|fps| fps.dense.most)),
            ];
            let scores = scores("original", Some(&point.to_original))
                .into_iter()
                .chain(scores("photos", point.to_photos.as_ref()));
            add(&point.setting.label(), numbers.into_iter().flatten().chain(scores).collect());
        }
    }
    csv_text(lines)
}

/// Returns the columns of a number that is not a score.
fn number(name: &str, value: Option<impl ToString>) -> Option<Value> {
    value.map(|value| [String::new(), String::new(), name.to_owned(), value.to_string()])
}

/// Returns the means over the views, then the scores of each view.
fn scores(against: &str, comparison: Option<&Comparison>) -> Vec<Value> {
    let Some(comparison) = comparison.filter(|comparison| !comparison.views.is_empty()) else {
        return Vec::new();
    };
    let score = |view: &str, metric: Metric, identical: bool, value: Option<f64>| {
        let infinite = (metric == Metric::Psnr && identical).then_some(f64::INFINITY);
        let value = value.or(infinite)?.to_string();
        Some([against.to_owned(), view.to_owned(), metric.name().to_owned(), value])
    };
    let mean = |metric| comparison.get(metric).and_then(|summary| summary.mean);
    let means = comparison.metrics().map(|metric| score("mean", metric, comparison.identical, mean(metric)));
    let views = comparison.views.iter().flat_map(|view| {
        comparison.metrics().map(|metric| score(&view.name, metric, view.identical, view.get(metric)))
    });
    means.chain(views).flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::super::testing::results;
    use super::*;

    #[test]
    fn one_number_a_line() {
        let csv = long_csv(&results());
        for line in [
            "dataset,scene,method,setting,against,view,metric,value",
            "Mip-NeRF 360,bonsai,3dgs,tol 0.1,original,mean,psnr,42",
            "Mip-NeRF 360,bonsai,3dgs,tol 0.1,original,front,psnr,41",
            "Mip-NeRF 360,bonsai,3dgs,tol 0.1,photos,back|<,lpips_vgg_inria,0.25",
            "Mip-NeRF 360,bonsai,3dgs,tol 0.1,,,fps_dense,10",
            "Mip-NeRF 360,bonsai,3dgs,original,photos,mean,psnr,32",
            "Mip-NeRF 360,garden,3dgs,tol 0.1,original,mean,psnr,inf",
            "\"a&b|<c>\"\"_%$\",\"a&b|<c>\"\"_%$\",mcmc,tol 0.1,,,mean_nonzeros,5",
            "Mip-NeRF 360,bonsai,eagles,original,,,shipped_bytes,50000",
        ] {
            assert!(csv.lines().any(|l| l == line), "{line}\n{csv}");
        }
        assert_eq!(long_csv(&Results::default()).lines().count(), 1);
    }
}
