//! Results in the layout of the 3DGS compression survey (`w-m/3dgs-compression-survey`): one CSV for each scene, with
//! values against photos.

use lexisplat_eval::Comparison;
use lexisplat_eval::format::file_name;
use lexisplat_eval::metrics::Metric;

use super::{Results, SceneResult, csv_text, unique};

/// Header of the survey's CSV files.
const HEADER: [&str; 6] = ["Submethod", "PSNR", "SSIM", "LPIPS", "Size [Bytes]", "#Gaussians"];
/// Folder for scenes without a data set.
const NO_DATASET: &str = "other";

/// Returns the files of the survey's layout: relative paths and contents. Scenes without photos are left out. The LPIPS
/// column is that of the 3DGS repository, as in the survey; it is empty if that was not measured. The PSNR of identical
/// pictures is `inf`.
pub(crate) fn survey(results: &Results) -> Vec<(String, String)> {
    let mut files: Vec<(String, &SceneResult, Vec<Vec<String>>)> = Vec::new();
    for scene in &results.scenes {
        let lines = lines(scene);
        if lines.is_empty() {
            continue;
        }
        let key = |scene: &SceneResult| (scene.dataset.to_lowercase(), scene.name.to_lowercase());
        if let Some((_, _, content)) = files.iter_mut().find(|(_, other, _)| key(other) == key(scene)) {
            content.extend(lines);
            continue;
        }
        let dataset =
            if scene.dataset.is_empty() { NO_DATASET.to_owned() } else { file_name(&scene.dataset) };
        // Names that differ only in letters that paths cannot have must not overwrite each other.
        let stem = unique(&format!("results/{dataset}/{}", file_name(&scene.name)), |stem| {
            files.iter().any(|(other, ..)| other.to_lowercase() == stem.to_lowercase())
        });
        files.push((stem, scene, [vec![HEADER.map(str::to_owned).into()], lines].concat()));
    }
    files.into_iter().map(|(stem, _, content)| (format!("{stem}.csv"), csv_text(content))).collect()
}

fn lines(scene: &SceneResult) -> Vec<Vec<String>> {
    let line = |submethod: String, comparison: Option<&Comparison>, size: u64| {
        let comparison = comparison.filter(|comparison| !comparison.views.is_empty())?;
        let text = |metric| comparison.get(metric)?.mean.map(|value| value.to_string());
        let psnr = text(Metric::Psnr).unwrap_or_else(|| "inf".to_owned());
        let [ssim, lpips] =
            [Metric::Ssim, Metric::LpipsVggInria].map(|metric| text(metric).unwrap_or_default());
        Some(vec![submethod, psnr, ssim, lpips, size.to_string(), scene.gaussians.to_string()])
    };
    let method = scene.method.name();
    let shipped = scene.shipped_bytes.unwrap_or(scene.ply_bytes);
    let original = line(method.to_owned(), scene.to_photos.as_ref(), shipped);
    let points = scene.points.iter().filter_map(|point| {
        let name = format!("lexisplat {method} {}", point.setting.label());
        line(name, point.to_photos.as_ref(), point.file_bytes)
    });
    original.into_iter().chain(points).collect()
}

#[cfg(test)]
mod tests {
    use super::super::Method;
    use super::super::testing::{comparison, results, scene};
    use super::*;

    #[test]
    fn files_by_hand() {
        let files = survey(&results());
        let paths: Vec<&str> = files.iter().map(|file| file.0.as_str()).collect();
        // Garden has no photos.
        assert_eq!(
            paths,
            [
                "results/Mip-NeRF_360/bonsai.csv",
                "results/other/Bonsai.csv",
                "results/a_b__c_____/a_b__c_____.csv"
            ]
        );
        assert_eq!(
            files[0].1,
            "Submethod,PSNR,SSIM,LPIPS,Size [Bytes],#Gaussians\n\
             3dgs,32,0.9,0.25,250000,1000\n\
             lexisplat 3dgs tol 0.1,31.75,0.9,0.25,100000,1000\n\
             eagles,31,0.9,0.25,50000,1000\n\
             eagles-no-sq,31.5,0.9,0.25,250000,1000\n"
        );
    }

    #[test]
    fn paths_stay_where_they_belong_and_apart() {
        let mut results = Results::default();
        for name in ["../..", "..", "a/b", "a\\b", "A b", ""] {
            let mut scene = scene("..", name, Method::Gs3d);
            scene.to_photos = Some(comparison(None));
            results.scenes.push(scene);
        }
        let paths: Vec<String> = survey(&results).into_iter().map(|file| file.0).collect();
        assert_eq!(
            paths,
            [
                "results/_/.._...csv",
                "results/_/_.csv",
                "results/_/a_b.csv",
                "results/_/a_b-2.csv",
                "results/_/A_b-3.csv",
                "results/_/_-2.csv"
            ]
        );
        assert!(survey(&results)[0].1.contains("3dgs,inf,1,0,"));
    }

    #[test]
    fn lpips_of_another_kind_does_not_stand_in() {
        let mut results = Results::default();
        let mut scene = scene("d", "s", Method::Gs3d);
        let mut scores = comparison(Some(30.0));
        let value = scores.more.remove(&Metric::LpipsVggInria).unwrap();
        scores.more.insert(Metric::LpipsVgg, value);
        scene.to_photos = Some(scores);
        results.scenes.push(scene);
        assert!(survey(&results)[0].1.ends_with("\n3dgs,30,0.9,,250000,1000\n"));
    }
}
