//! Figures of a sweep, each as SVG and PNG.

mod chart;

use std::fmt::Write;

use chart::{Chart, DASHED, DOTTED, Key, Mark, NEUTRAL, Pairs, SOLID, Series};

use super::curve::{At, Kind, curve};
use super::grid::Grid;
use super::paper::{self, Quantity};
use super::survey::safe;
use super::{Method, Results, Setting};
use lexisplat_eval::Result;

/// A figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Name for files, without ending; safe on every system and unique among the figures of a sweep.
    pub name: String,
    /// What it shows, in a few words.
    pub title: String,
    /// How to read it.
    pub caption: String,
    /// An SVG document.
    pub svg: String,
    /// The same as the bytes of a PNG file.
    pub png: Vec<u8>,
}

const RATIO: &str = "Comp Ratio, coefficients: SH-rest / mean nonzeros (log scale)";
const PSNR: &str = "PSNR against the original, dB";

/// What ids in SVG by `kuva` start with; a number follows.
const KUVA_ID: &str = "kuva-clip-";
/// Letters of a device's name that an axis has room for. Captions have it whole.
const LONGEST_DEVICE: usize = 36;

/// Colours of Okabe and Ito (2008), which colour-blind people can tell apart, and marks for those who see none.
fn look(method: Method) -> (&'static str, Mark) {
    match method {
        Method::Gs3d => ("#0072b2", Mark::Circle),
        Method::Mcmc => ("#d55e00", Mark::Square),
        Method::PixelGs => ("#009e73", Mark::Triangle),
        Method::Eagles => ("#cc79a7", Mark::Diamond),
        Method::EaglesNoSq => ("#56b4e9", Mark::TriangleDown),
        Method::Other => ("#e69f00", Mark::Pentagon),
    }
}

/// Every colour there is in a figure: what a style sheet has to know to swap them.
#[cfg(test)]
pub(super) fn colours() -> Vec<&'static str> {
    chart::COLOURS.into_iter().chain(Method::ALL.map(|method| look(method).0)).collect()
}

/// A line of one method.
fn line(method: Method, dash: &'static str, points: Pairs) -> Series {
    let (colour, mark) = look(method);
    Series { colour, dash, mark: Some(mark), joined: true, points, band: Vec::new() }
}

/// The legend of methods that have a line.
fn methods(grid: &Grid<'_>, series: &[Series]) -> (&'static str, Vec<Key>) {
    let drawn = |&method: &Method| series.iter().any(|series| series.colour == look(method).0);
    let keys = grid.methods.iter().copied().filter(drawn).map(|method| {
        let (colour, mark) = look(method);
        Key { text: method.title().to_owned(), colour, dash: SOLID, mark: Some(mark) }
    });
    ("Method", keys.collect())
}

/// A key for every colour.
fn key(text: &str, dash: &'static str, mark: Option<Mark>) -> Key {
    Key { text: text.to_owned(), colour: NEUTRAL, dash, mark }
}

/// Points of PSNR over ratio, with lowest and highest PSNR.
fn psnr_over_ratio(points: &[At]) -> (Pairs, Pairs) {
    points
        .iter()
        .filter_map(|at| {
            let psnr = at.psnr.mean?;
            Some(((at.ratio?, psnr), (at.psnr.min.unwrap_or(psnr), at.psnr.max.unwrap_or(psnr))))
        })
        .unzip()
}

/// Every figure there is something to show in.
///
/// # Errors
/// [`Error::Parameter`](crate::Error::Parameter) if a chart cannot be drawn.
pub fn figures(results: &Results) -> Result<Vec<Figure>> {
    let grid = Grid::new(results);
    let mut figures = Vec::new();
    let charts = [psnr_ratio(&grid), fps_ratio(&grid), bytes_psnr(&grid)];
    let scenes = (0..grid.columns.len()).map(|column| scene(&grid, column));
    for chart in charts.into_iter().chain(levels(&grid)).chain(scenes) {
        figures.extend(chart.draw()?);
    }
    // Scenes' names may differ in letters alone that files cannot have.
    for i in 1..figures.len() {
        let plain = figures[i].name.clone();
        let mut copy = 2;
        while figures[..i].iter().any(|figure| figure.name.to_lowercase() == figures[i].name.to_lowercase()) {
            figures[i].name = format!("{plain}-{copy}");
            copy += 1;
        }
    }
    for figure in &mut figures {
        figure.svg = with_own_ids(&figure.svg, &figure.name);
    }
    Ok(figures)
}

/// Ids in `svg` made from the figure's name: `kuva` counts them through the whole process, so they would
/// change from run to run, and several figures share one page.
fn with_own_ids(svg: &str, name: &str) -> String {
    let plain = |b: u8| {
        if b.is_ascii_alphanumeric() || b == b'-' { char::from(b).to_string() } else { format!("_{b:02x}") }
    };
    let name: String = name.bytes().map(plain).collect();
    let mut parts = svg.split(KUVA_ID);
    let mut out = parts.next().unwrap_or_default().to_owned();
    let mut seen: Vec<&str> = Vec::new();
    for part in parts {
        let digits = part.len() - part.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        let (id, rest) = part.split_at(digits);
        let number = seen.iter().position(|other| *other == id).unwrap_or_else(|| {
            seen.push(id);
            seen.len() - 1
        });
        let _ = write!(out, "{name}-clip-{number}{rest}");
    }
    out
}

/// PSNR over ratio, a line a method, with the paper's means.
fn psnr_ratio(grid: &Grid<'_>) -> Chart {
    let mut series = Vec::new();
    for &method in &grid.methods {
        let (points, band) = psnr_over_ratio(&curve(grid, method, Kind::Tolerances, None));
        if !points.is_empty() {
            series.push(Series { band, ..line(method, SOLID, points) });
        }
    }
    let mut keys = vec![methods(grid, &series)];
    if !series.is_empty() {
        let mut of_paper = Vec::new();
        for method in [Method::Gs3d, Method::Mcmc, Method::PixelGs] {
            let mean = |quantity| paper::mean(paper::Table::Main, method, quantity).map(|mean| mean.computed);
            if let (Some(ratio), Some(psnr)) = (mean(Quantity::Ratio), mean(Quantity::Psnr)) {
                let colour = look(method).0;
                let points = vec![(ratio, psnr)];
                series.push(Series { mark: Some(Mark::Cross), joined: false, ..line(method, SOLID, points) });
                of_paper.push(Key {
                    text: method.title().to_owned(),
                    colour,
                    dash: SOLID,
                    mark: Some(Mark::Cross),
                });
            }
        }
        keys.push(("Paper, tol 0.1", of_paper));
    }
    Chart {
        name: "psnr-ratio".to_owned(),
        title: "Quality against the paper's compression ratio".to_owned(),
        caption: "Means over scenes at each tolerance; the band is from the worst to the best scene. Crosses are the paper's means \
                  over its 13 scenes at tol 0.1."
            .to_owned(),
        x: RATIO,
        x_unit: "\u{d7}",
        y: PSNR.to_owned(),
        from_zero: false,
        series,
        keys,
    }
}

/// PSNR over ratio of one scene.
fn scene(grid: &Grid<'_>, column: usize) -> Chart {
    let mut series = Vec::new();
    for &method in &grid.methods {
        let (points, band) = psnr_over_ratio(&curve(grid, method, Kind::Tolerances, Some(column)));
        if !points.is_empty() {
            series.push(Series { band, ..line(method, SOLID, points) });
        }
    }
    let keys = vec![methods(grid, &series)];
    let heading = grid.columns.get(column).cloned().unwrap_or_default();
    Chart {
        name: format!("scene-{}", safe(&heading)),
        title: format!("Quality against the paper's compression ratio: {heading}"),
        caption: format!("{heading} at each tolerance; the band is from the worst to the best view."),
        x: RATIO,
        x_unit: "\u{d7}",
        y: PSNR.to_owned(),
        from_zero: false,
        series,
        keys,
    }
}

/// FPS over ratio for the given kinds of settings, dense ones dashed.
fn fps_series(grid: &Grid<'_>, kinds: &[(Kind, &'static str)]) -> Vec<Series> {
    let mut series = Vec::new();
    for &method in &grid.methods {
        for &(kind, dash) in kinds {
            let points = curve(grid, method, kind, None);
            let sparse: Vec<_> = points.iter().filter_map(|at| Some((at.ratio?, at.fps?))).collect();
            if sparse.is_empty() {
                continue;
            }
            series.push(line(method, dash, sparse));
            if kind == Kind::Tolerances {
                let dense = points.iter().filter_map(|at| Some((at.ratio?, at.fps_dense?))).collect();
                series.push(Series { mark: None, ..line(method, DASHED, dense) });
            }
        }
    }
    series
}

/// What FPS were measured on, for an axis.
fn fps_label(grid: &Grid<'_>) -> String {
    let device = grid.device();
    if device.chars().count() > LONGEST_DEVICE {
        "Frames a second".to_owned()
    } else {
        format!("Frames a second ({device})")
    }
}

fn fps_ratio(grid: &Grid<'_>) -> Chart {
    let series = fps_series(grid, &[(Kind::Tolerances, SOLID)]);
    let keys = vec![
        methods(grid, &series),
        ("Drawn from", vec![key("codes", SOLID, None), key("dense SH", DASHED, None)]),
    ];
    Chart {
        name: "fps-ratio".to_owned(),
        title: "Speed against the paper's compression ratio".to_owned(),
        caption: format!(
            "Means over scenes at each tolerance, drawn on {}. Dashed: the original from dense SH, measured beside it.",
            grid.device()
        ),
        x: RATIO,
        x_unit: "\u{d7}",
        y: fps_label(grid),
        from_zero: true,
        series,
        keys,
    }
}

/// How kinds of settings look where they stand side by side.
fn kind_look(kind: Kind) -> (&'static str, Mark, &'static str) {
    match kind {
        Kind::Tolerances => (SOLID, Mark::Circle, "tolerances"),
        Kind::Caps => (DOTTED, Mark::Triangle, "capped nonzeros"),
        Kind::Presets => (DASHED, Mark::Square, "packed presets"),
    }
}

fn bytes_psnr(grid: &Grid<'_>) -> Chart {
    let mut series = Vec::new();
    let mut kinds = Vec::new();
    for kind in Kind::ALL {
        let (dash, mark, name) = kind_look(kind);
        let before = series.len();
        for &method in &grid.methods {
            let points: Vec<_> = curve(grid, method, kind, None)
                .iter()
                .filter_map(|at| Some((at.bytes_each?, at.psnr.mean?)))
                .collect();
            if !points.is_empty() {
                series.push(Series { mark: Some(mark), ..line(method, dash, points) });
            }
        }
        if series.len() > before {
            kinds.push(key(name, dash, Some(mark)));
        }
    }
    let (title, methods) = methods(grid, &series);
    let methods = methods.into_iter().map(|key| Key { mark: None, ..key }).collect();
    Chart {
        name: "bytes-psnr".to_owned(),
        title: "Quality against real size".to_owned(),
        caption: "Whole files, every byte counted, over Gaussians; means over scenes. Tolerances and capped nonzeros keep all but SH \
                  exact; packed presets quantise everything."
            .to_owned(),
        x: "Bytes a Gaussian, whole file (log scale)",
        x_unit: "",
        y: PSNR.to_owned(),
        from_zero: false,
        series,
        keys: vec![(title, methods), ("Settings", kinds)],
    }
}

/// PSNR and FPS as far as settings go. Nothing without capped nonzeros and tolerances beyond the paper's.
fn levels(grid: &Grid<'_>) -> Vec<Chart> {
    let far = grid.settings.iter().any(|setting| match setting {
        Setting::Tolerance(tolerance) => *tolerance > paper::TOLERANCES[3],
        Setting::MaxNonzeros(_) => true,
        Setting::Preset(_) => false,
    });
    if !far {
        return Vec::new();
    }
    let mut series = Vec::new();
    let mut floors: Vec<(Method, f64)> = Vec::new();
    for &method in &grid.methods {
        for kind in [Kind::Tolerances, Kind::Caps] {
            let points = curve(grid, method, kind, None);
            let (over_ratio, _) = psnr_over_ratio(&points);
            if !over_ratio.is_empty() {
                series.push(line(method, kind_look(kind).0, over_ratio));
            }
            let dropped = points.iter().find(|at| at.setting == Setting::MaxNonzeros(0));
            floors.extend(dropped.and_then(|at| at.psnr.mean).map(|psnr| (method, psnr)));
        }
    }
    let ratios: Vec<f64> = series.iter().flat_map(|series| &series.points).map(|point| point.0).collect();
    let ends = [f64::min, f64::max].map(|pick| ratios.iter().copied().reduce(pick).unwrap_or(1.0));
    for &(method, psnr) in &floors {
        let points = ends.map(|ratio| (ratio, psnr)).into();
        series.push(Series { mark: None, ..line(method, DASHED, points) });
    }
    let kinds = |caps: bool| {
        let mut keys = vec![key("tolerances", SOLID, None)];
        if caps {
            keys.push(key("capped nonzeros", DOTTED, None));
        }
        keys
    };
    let has_caps = grid.settings.iter().any(|s| matches!(s, Setting::MaxNonzeros(most) if *most > 0));
    let mut quality_keys = kinds(has_caps);
    if !floors.is_empty() {
        quality_keys.push(key("no SH at all", DASHED, None));
    }
    let mut speed_keys = kinds(has_caps);
    speed_keys.push(key("dense SH", DASHED, None));
    let quality = Chart {
        name: "levels-psnr".to_owned(),
        title: "Does quality level off?".to_owned(),
        caption: "Means over scenes, as far as the settings go: down to one nonzero a Gaussian and to none, where measured.".to_owned(),
        x: RATIO,
        x_unit: "\u{d7}",
        y: PSNR.to_owned(),
        from_zero: false,
        keys: vec![methods(grid, &series), ("Settings", quality_keys)],
        series,
    };
    let series = fps_series(grid, &[(Kind::Tolerances, SOLID), (Kind::Caps, DOTTED)]);
    let speed = Chart {
        name: "levels-fps".to_owned(),
        title: "Does speed level off?".to_owned(),
        caption: format!(
            "Means over scenes, drawn on {}. Dashed: the original from dense SH.",
            grid.device()
        ),
        x: RATIO,
        x_unit: "\u{d7}",
        y: fps_label(grid),
        from_zero: true,
        keys: vec![methods(grid, &series), ("Settings", speed_keys)],
        series,
    };
    vec![quality, speed]
}

#[cfg(test)]
mod tests {
    use super::super::testing::{ODD, results};
    use super::*;
    use crate::report::testing::check_nesting;

    #[test]
    fn figures_are_well_formed_and_hold_every_series() {
        let figures = figures(&results()).unwrap();
        let names: Vec<&str> = figures.iter().map(|figure| figure.name.as_str()).collect();
        // Garden's pictures are identical: a scene without a number.
        assert_eq!(
            names,
            [
                "psnr-ratio",
                "fps-ratio",
                "bytes-psnr",
                "levels-psnr",
                "levels-fps",
                "scene-bonsai",
                "scene-a_b__c_____"
            ]
        );
        for figure in &figures {
            check_nesting(&figure.svg);
            assert!(figure.svg.starts_with("<svg viewBox=\"0 0 860 "), "{}", &figure.svg[..80]);
            assert!(!figure.svg.contains("NaN") && !figure.svg.contains(">inf"), "{}", figure.name);
            let (width, height) =
                image::load_from_memory(&figure.png).map(|p| (p.width(), p.height())).unwrap();
            assert!(width == 1720 && height >= 1000, "{width} {height}");
            for method in ["3DGS", "MCMC"] {
                let colour = look(if method == "MCMC" { Method::Mcmc } else { Method::Gs3d }).0;
                let there = figure.svg.contains(&format!(">{method}</text>"));
                // The odd scene has MCMC alone.
                assert_eq!(
                    there,
                    !(figure.name.starts_with("scene-a") && method == "3DGS"),
                    "{}",
                    figure.name
                );
                assert_eq!(figure.svg.contains(colour), there, "{} {method}", figure.name);
            }
        }
        let text = |name: &str, text: &str| {
            figures
                .iter()
                .find(|figure| figure.name == name)
                .unwrap()
                .svg
                .contains(&format!(">{text}</text>"))
        };
        assert!(text("bytes-psnr", "packed presets") && text("bytes-psnr", "capped nonzeros"));
        assert!(text("levels-psnr", "no SH at all") && text("fps-ratio", "dense SH"));
        assert!(text("fps-ratio", "Frames a second (CPU)"));
        let escaped = crate::report::text::escape(ODD).replace("&#39;", "&apos;");
        assert!(figures[6].svg.contains(&escaped), "{}", figures[6].svg);
    }

    #[test]
    fn figures_are_the_same_each_time_and_share_no_ids() {
        let (first, second) = (figures(&results()).unwrap(), figures(&results()).unwrap());
        assert!(first == second);
        let ids: Vec<&str> = first
            .iter()
            .flat_map(|figure| figure.svg.split(" id=\"").skip(1).filter_map(|rest| rest.split('"').next()))
            .collect();
        let distinct: std::collections::HashSet<&str> = ids.iter().copied().collect();
        assert!(!ids.is_empty() && distinct.len() == ids.len(), "{ids:?}");
        assert_eq!(
            with_own_ids("<a id=\"kuva-clip-12\"/>(#kuva-clip-12)(#kuva-clip-1)", "a b"),
            "<a id=\"a_20b-clip-0\"/>(#a_20b-clip-0)(#a_20b-clip-1)"
        );
    }

    #[test]
    fn nothing_gives_no_figures() {
        assert!(figures(&Results::default()).unwrap().is_empty());
    }

    #[test]
    fn numbers_that_are_no_measurements_are_left_out() {
        let mut results = results();
        for (k, scene) in results.scenes.iter_mut().enumerate() {
            for point in &mut scene.points {
                let odd = [f64::MAX, f64::NAN, f64::INFINITY, 0.0, -1.0, f64::MIN_POSITIVE][k];
                point.coefficient_ratio = Some(odd);
                point.to_original.psnr.mean = Some(odd);
                point.to_original.psnr.max = Some(odd);
                point.fps = Some(super::super::Fps { dense: odd, sparse: odd });
            }
        }
        for figure in figures(&results).unwrap() {
            assert!(!figure.svg.contains("NaN") && !figure.svg.contains("inf\""), "{}", figure.name);
        }
    }

    #[test]
    fn one_point_and_names_alike_are_drawn() {
        let mut results = results();
        results.scenes.truncate(1);
        results.scenes[0].points.truncate(1);
        let mut copy = results.scenes[0].clone();
        results.scenes[0].name = "a/b".to_owned();
        copy.name = "A:b".to_owned();
        results.scenes.push(copy);
        let names: Vec<String> = figures(&results).unwrap().into_iter().map(|figure| figure.name).collect();
        assert_eq!(names, ["psnr-ratio", "fps-ratio", "bytes-psnr", "scene-a_b", "scene-A_b-2"]);
    }
}
