//! Results in the layout of the 3DGS compression survey (`w-m/3dgs-compression-survey`): one CSV a scene,
//! values against photos.

use super::csv;
use super::{Results, SceneResult};
use lexisplat_eval::Comparison;
use lexisplat_eval::metrics::Metric;

/// The survey's header.
const HEADER: [&str; 6] = ["Submethod", "PSNR", "SSIM", "LPIPS", "Size [Bytes]", "#Gaussians"];
/// Letters of a name that a path keeps: file systems take 255 bytes, and something may be added.
const LONGEST_NAME: usize = 60;
/// Folder of scenes without a data set.
const NO_DATASET: &str = "other";

/// Files of the survey's layout: path relative to where they are kept, and content. Scenes without photos are
/// left out. The LPIPS column is the 3DGS repository's, as the survey's numbers are; empty where it was not
/// measured. A PSNR of identical pictures is `inf`.
#[must_use]
pub fn survey(results: &Results) -> Vec<(String, String)> {
    let mut files: Vec<(String, &SceneResult, String)> = Vec::new();
    for scene in &results.scenes {
        let lines = lines(scene);
        if lines.is_empty() {
            continue;
        }
        let same = |other: &SceneResult| {
            other.dataset.to_lowercase() == scene.dataset.to_lowercase()
                && other.name.to_lowercase() == scene.name.to_lowercase()
        };
        if let Some((_, _, content)) = files.iter_mut().find(|(_, other, _)| same(other)) {
            content.push_str(&lines);
            continue;
        }
        let dataset = if scene.dataset.is_empty() { NO_DATASET.to_owned() } else { safe(&scene.dataset) };
        let stem = format!("results/{dataset}/{}", safe(&scene.name));
        let mut path = format!("{stem}.csv");
        let mut copy = 2;
        // Names that differ in letters that paths cannot have must not overwrite each other.
        while files.iter().any(|(other, _, _)| other.to_lowercase() == path.to_lowercase()) {
            path = format!("{stem}-{copy}.csv");
            copy += 1;
        }
        let mut content = String::new();
        csv::line(&mut content, HEADER);
        files.push((path, scene, content + &lines));
    }
    files.into_iter().map(|(path, _, content)| (path, content)).collect()
}

/// `name` as one part of a path, on every system.
pub(super) fn safe(name: &str) -> String {
    let kept = |c: char| if c.is_alphanumeric() || matches!(c, '-' | '_' | '.') { c } else { '_' };
    let name: String = name.trim().chars().take(LONGEST_NAME).map(kept).collect();
    if name.chars().all(|c| c == '.') { "_".to_owned() } else { name }
}

fn lines(scene: &SceneResult) -> String {
    let mut out = String::new();
    let mut add = |submethod: &str, comparison: &Comparison, size: u64| {
        if comparison.views.is_empty() {
            return;
        }
        let psnr = match comparison.psnr.mean {
            Some(psnr) => psnr.to_string(),
            None => "inf".to_owned(),
        };
        let text = |metric| {
            let mean = comparison.get(metric).and_then(|summary| summary.mean);
            mean.map_or_else(String::new, |value| value.to_string())
        };
        let (ssim, lpips) = (text(Metric::Ssim), text(Metric::LpipsVggInria));
        let (size, gaussians) = (size.to_string(), scene.gaussians.to_string());
        csv::line(&mut out, [submethod, &psnr, &ssim, &lpips, &size, &gaussians]);
    };
    if let Some(comparison) = &scene.to_photos {
        add(scene.method.name(), comparison, scene.shipped_bytes.unwrap_or(scene.ply_bytes));
    }
    for point in &scene.points {
        if let Some(comparison) = &point.to_photos {
            let name = format!("lexisplat {} {}", scene.method.name(), point.setting.label());
            add(&name, comparison, point.file_bytes);
        }
    }
    out
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
        assert_eq!(safe(&"\u{1d4a}".repeat(300)).chars().count(), LONGEST_NAME);
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
