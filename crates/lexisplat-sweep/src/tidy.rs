//! Everything a sweep measured as one long CSV, for other programs.

use super::csv;
use super::{Results, SceneResult};
use lexisplat_eval::Comparison;
use lexisplat_eval::metrics::Metric;

/// Columns of [`tidy_csv`].
const HEADER: [&str; 8] = ["dataset", "scene", "method", "setting", "against", "view", "metric", "value"];

/// One number a line. `setting` is `original` for the model itself. `against` is `original` or `photos` for
/// scores, with `view` a view's name or `mean`; for sizes, speeds and the rest both are empty. A PSNR of
/// identical pictures is `inf`; the mean is over the views that are not.
#[must_use]
pub fn tidy_csv(results: &Results) -> String {
    let mut out = String::new();
    csv::line(&mut out, HEADER);
    for scene in &results.scenes {
        Lines { out: &mut out, scene, setting: "original".to_owned() }.model();
        for point in &scene.points {
            let mut lines = Lines { out: &mut out, scene, setting: point.setting.label() };
            lines.value("file_bytes", point.file_bytes);
            lines.value("sh_bytes", point.sh_bytes);
            lines.value("resident_sh_bytes", point.resident_sh_bytes);
            lines.value("atoms", point.atoms);
            lines.value("mean_nonzeros", point.mean_nonzeros);
            lines.maybe("coefficient_ratio", point.coefficient_ratio);
            lines.maybe("max_residual", point.max_residual);
            lines.value("over_tolerance", point.over_tolerance);
            lines.value("seconds", point.seconds);
            lines.maybe("fps", point.fps.map(|fps| fps.sparse));
            lines.maybe("fps_dense", point.fps.map(|fps| fps.dense));
            lines.scores("original", Some(&point.to_original));
            lines.scores("photos", point.to_photos.as_ref());
        }
    }
    out
}

struct Lines<'a> {
    out: &'a mut String,
    scene: &'a SceneResult,
    setting: String,
}

impl Lines<'_> {
    fn model(&mut self) {
        self.value("gaussians", self.scene.gaussians);
        self.value("sh_degree", self.scene.sh_degree);
        self.value("ply_bytes", self.scene.ply_bytes);
        self.maybe("shipped_bytes", self.scene.shipped_bytes);
        self.value("views", self.scene.views);
        self.scores("photos", self.scene.to_photos.as_ref());
    }

    fn line(&mut self, against: &str, view: &str, metric: &str, value: &str) {
        let scene = self.scene;
        let setting = &self.setting;
        csv::line(
            self.out,
            [&scene.dataset, &scene.name, scene.method.name(), setting, against, view, metric, value],
        );
    }

    fn value(&mut self, metric: &str, value: impl ToString) {
        self.line("", "", metric, &value.to_string());
    }

    fn maybe(&mut self, metric: &str, value: Option<impl ToString>) {
        if let Some(value) = value {
            self.value(metric, value);
        }
    }

    fn scores(&mut self, against: &str, comparison: Option<&Comparison>) {
        let Some(comparison) = comparison.filter(|comparison| !comparison.views.is_empty()) else {
            return;
        };
        for metric in comparison.metrics() {
            let endless = metric == Metric::Psnr && comparison.identical;
            let mean = comparison.get(metric).and_then(|summary| summary.mean);
            if let Some(mean) = mean.or(endless.then_some(f64::INFINITY)) {
                self.line(against, "mean", metric.name(), &mean.to_string());
            }
        }
        for view in &comparison.views {
            for metric in comparison.metrics() {
                let endless = metric == Metric::Psnr && view.identical;
                if let Some(value) = view.get(metric).or(endless.then_some(f64::INFINITY)) {
                    self.line(against, &view.name, metric.name(), &value.to_string());
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::results;
    use super::*;

    #[test]
    fn one_number_a_line() {
        let csv = tidy_csv(&results());
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
        assert_eq!(tidy_csv(&Results::default()).lines().count(), 1);
    }
}
