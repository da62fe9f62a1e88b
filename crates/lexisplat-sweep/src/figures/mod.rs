//! Figures of a sweep, each as SVG, PNG and PDF.

mod chart;
mod pdf;

use std::fmt::Write;

use kuva::plot::legend::LegendEntry;
use lexisplat_compress::Result;
use lexisplat_eval::FrameRate;
use lexisplat_eval::format::file_name;

use chart::{Chart, DASHED, DOTTED, Legend, Mark, NEUTRAL, SOLID, Series, key};

use super::curve::{At, Kind, curve};
use super::grid::Grid;
use super::measure::Measure;
use super::paper::{self, Quantity};
use super::{Fps, Method, Results, Setting, unique};

/// A figure.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Figure {
    /// Name for files, without extension; safe on every system and unique among the figures of a sweep.
    pub(crate) name: String,
    /// What the figure shows, in a few words.
    pub(crate) title: String,
    /// How to read it.
    pub(crate) caption: String,
    /// An SVG document.
    pub(crate) svg: String,
    /// The same picture as a PNG file.
    pub(crate) png: Vec<u8>,
    /// The same as a PDF of one page.
    pub(crate) pdf: Vec<u8>,
}

/// Start of the ids in SVG by `kuva`; a number follows.
const KUVA_ID: &str = "kuva-clip-";
/// Most characters of a device's name on an axis. Captions have the whole name.
const LONGEST_DEVICE: usize = 36;
/// Explains the numbers at points, for captions.
const TOLERANCES: &str = "Numbers at points are tolerances.";
const PSNR: &str = "PSNR against the original, dB";

/// The colour and mark of a method: colours of Okabe and Ito (2008), which colour-blind people can tell apart.
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

/// The dashes, mark and name of a kind of settings.
fn kind_look(kind: Kind) -> (&'static str, Mark, &'static str) {
    match kind {
        Kind::Tolerances => (SOLID, Mark::Circle, "tolerances"),
        Kind::Caps => (DOTTED, Mark::Triangle, "capped nonzeros"),
        Kind::Presets => (DASHED, Mark::Square, "packed presets"),
    }
}

/// Every colour in a figure. The page's style sheet swaps them in its dark theme.
#[cfg(test)]
pub(super) fn colours() -> Vec<&'static str> {
    chart::COLOURS.into_iter().chain(Method::ALL.map(|method| look(method).0)).collect()
}

/// A line of one method.
fn line(method: Method, dash: &'static str, points: Vec<(f64, f64)>) -> Series {
    let (colour, mark) = look(method);
    Series { colour, dash, mark: Some(mark), joined: true, points, band: Vec::new(), labels: Vec::new() }
}

/// What is written at the point of a setting: a tolerance is a number alone.
fn point_label(setting: Setting) -> String {
    match setting {
        Setting::Tolerance(tolerance) => tolerance.to_string(),
        other => other.label(),
    }
}

/// A point, its band and its label.
type Labelled = ((f64, f64), (f64, f64), String);

/// A line of one method with the bands and labels of its points.
fn labelled(method: Method, dash: &'static str, of: impl Iterator<Item = Labelled>) -> Series {
    let mut series = line(method, dash, Vec::new());
    for (point, band, label) in of {
        series.points.push(point);
        series.band.push(band);
        series.labels.push(label);
    }
    series
}

/// PSNR over ratio. The band is from the lowest to the highest PSNR.
fn psnr_line(method: Method, dash: &'static str, points: &[At<'_>]) -> Series {
    let point = |at: &At<'_>| {
        let psnr = at.psnr();
        let mean = psnr.mean?;
        let band = (psnr.min.unwrap_or(mean), psnr.max.unwrap_or(mean));
        Some(((at.ratio()?, mean), band, point_label(at.setting)))
    };
    labelled(method, dash, points.iter().filter_map(point))
}

/// The legend of methods that have a line.
fn method_keys(grid: &Grid<'_>, series: &[Series], with_marks: bool) -> Legend {
    let drawn =
        |method: &&Method| series.iter().any(|s| s.colour == look(**method).0 && !s.points.is_empty());
    let keys = grid.methods.iter().filter(drawn).map(|&method| {
        let (colour, mark) = look(method);
        key(method.title(), colour, SOLID, with_marks.then_some(mark))
    });
    ("Method", keys.collect())
}

/// A key for lines of every colour.
fn dash_key(text: &str, dash: &'static str) -> LegendEntry {
    key(text, NEUTRAL, dash, None)
}

/// Every figure that has something to show.
///
/// # Errors
/// [`Error::Parameter`](lexisplat_compress::Error::Parameter) if a chart cannot be drawn.
pub(crate) fn figures(results: &Results) -> Result<Vec<Figure>> {
    let grid = Grid::new(results);
    let charts = [quality(&grid, None), speed(&grid), bytes(&grid)];
    let scenes = (0..grid.headings.len()).map(|column| quality(&grid, Some(column)));
    let mut figures: Vec<Figure> = Vec::new();
    for chart in charts.into_iter().chain(saturation(&grid).into_iter().flatten()).chain(scenes) {
        let Some(mut figure) = chart.draw()? else { continue };
        figure.caption = format!("{} {}", figure.caption, results.how()).trim_end().to_owned();
        // Scenes' names may differ only in letters that file names cannot have.
        figure.name = unique(&figure.name, |name| {
            figures.iter().any(|other| other.name.to_lowercase() == name.to_lowercase())
        });
        figure.svg = with_own_ids(&figure.svg, &figure.name);
        figures.push(figure);
    }
    Ok(figures)
}

/// `svg` with ids made from the figure's name. `kuva` counts ids through the whole process, so they would change
/// from run to run, and several figures share one page.
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

/// PSNR over ratio: over all scenes with the paper's means, or of one scene.
fn quality(grid: &Grid<'_>, column: Option<usize>) -> Chart {
    let lines = grid.methods.iter();
    let lines = lines.map(|&method| psnr_line(method, SOLID, &curve(grid, method, Kind::Tolerances, column)));
    let mut series: Vec<Series> = lines.filter(|line| !line.points.is_empty()).collect();
    let mut legends = vec![method_keys(grid, &series, true)];
    let title = "Quality against the paper's compression ratio";
    if let Some(column) = column {
        let heading = &grid.headings[column];
        return Chart {
            name: format!("scene-{}", file_name(heading)),
            title: format!("{title}: {heading}"),
            caption: format!(
                "{heading} at each tolerance; the band is from the worst to the best view. {TOLERANCES}"
            ),
            ..Chart::over_ratio(PSNR, series, legends)
        };
    }
    if !series.is_empty() {
        let mut keys = Vec::new();
        for method in [Method::Gs3d, Method::Mcmc, Method::PixelGs] {
            let mean = |quantity| paper::mean(paper::Experiment::Main, method, quantity);
            if let Some(point) = mean(Quantity::Ratio).zip(mean(Quantity::Psnr)) {
                let mark = Some(Mark::Cross);
                let labels = vec![paper::TOLERANCE.to_string()];
                series.push(Series { mark, joined: false, labels, ..line(method, SOLID, vec![point]) });
                keys.push(key(method.title(), look(method).0, SOLID, mark));
            }
        }
        legends.push(("Paper, tol 0.1", keys));
    }
    Chart {
        name: "psnr-ratio".to_owned(),
        title: title.to_owned(),
        caption: format!(
            "Means over scenes at each tolerance; the band is from the worst to the best scene. {TOLERANCES} Crosses are the \
             paper's means over its 13 scenes at tol 0.1."
        ),
        ..Chart::over_ratio(PSNR, series, legends)
    }
}

/// FPS over ratio for kinds of settings. The original's are dashed.
fn fps_lines(grid: &Grid<'_>, kinds: &[Kind]) -> Vec<Series> {
    let mut series = Vec::new();
    for &method in &grid.methods {
        for &kind in kinds {
            let points = curve(grid, method, kind, None);
            let over_ratio = |measure: Measure, rate: fn(&Fps) -> FrameRate| {
                let point = move |at: &At<'_>| {
                    let point = at.ratio().zip(at.mean(measure))?;
                    Some((point, at.rounds(rate).unwrap_or((point.1, point.1)), point_label(at.setting)))
                };
                points.iter().filter_map(point)
            };
            let codes = over_ratio(Measure::SparseFps, |fps| fps.sparse);
            series.push(labelled(method, kind_look(kind).0, codes));
            if kind == Kind::Tolerances {
                let dense = labelled(method, DASHED, over_ratio(Measure::DenseFps, |fps| fps.dense));
                series.push(Series { mark: None, labels: Vec::new(), ..dense });
            }
        }
    }
    series
}

/// A chart of FPS, its axis named for the device that they were measured on.
fn fps_chart(grid: &Grid<'_>, kinds: &[Kind], legend: Legend) -> Chart {
    let series = fps_lines(grid, kinds);
    let device = grid.device();
    let axis = match device.chars().count() {
        ..=LONGEST_DEVICE => format!("Frames a second ({device})"),
        _ => "Frames a second".to_owned(),
    };
    let legends = vec![method_keys(grid, &series, true), legend];
    Chart { from_zero: true, ..Chart::over_ratio(&axis, series, legends) }
}

fn speed(grid: &Grid<'_>) -> Chart {
    let keys = vec![dash_key("codes", SOLID), dash_key("dense SH", DASHED)];
    Chart {
        name: "fps-ratio".to_owned(),
        title: "Speed against the paper's compression ratio".to_owned(),
        caption: format!(
            "Means over scenes at each tolerance, drawn on {}. Dashed: the original from dense SH, drawn in turn with the \
             codes. {TOLERANCES} Bands are from the slowest to the fastest round through all views.",
            grid.device()
        ),
        ..fps_chart(grid, &[Kind::Tolerances], ("Drawn from", keys))
    }
}

fn bytes(grid: &Grid<'_>) -> Chart {
    let mut series = Vec::new();
    let mut keys = Vec::new();
    for kind in Kind::ALL {
        let (dash, mark, name) = kind_look(kind);
        let before = series.len();
        for &method in &grid.methods {
            let points = curve(grid, method, kind, None);
            let point = |at: &At<'_>| {
                let (bytes, psnr) = at.mean(Measure::BytesEach).zip(at.psnr().mean)?;
                Some(((bytes, psnr), (psnr, psnr), point_label(at.setting)))
            };
            let line = labelled(method, dash, points.iter().filter_map(point));
            series.push(Series { mark: Some(mark), band: Vec::new(), ..line });
        }
        if series[before..].iter().any(|line| !line.points.is_empty()) {
            keys.push(key(name, NEUTRAL, dash, Some(mark)));
        }
    }
    let legends = vec![method_keys(grid, &series, false), ("Settings", keys)];
    Chart {
        name: "bytes-psnr".to_owned(),
        title: "Quality against real size".to_owned(),
        caption: format!(
            "Whole files, every byte counted, over Gaussians; means over scenes. {TOLERANCES} Tolerances and capped nonzeros keep \
             all but SH exact; packed presets quantise everything."
        ),
        x: "Bytes a Gaussian, whole file (log scale)",
        x_unit: "",
        ..Chart::over_ratio(PSNR, series, legends)
    }
}

/// PSNR and FPS as far as the settings go. `None` without capped nonzeros and tolerances beyond the paper's.
fn saturation(grid: &Grid<'_>) -> Option<[Chart; 2]> {
    let is_far = |setting: &Setting| match setting {
        Setting::Tolerance(tolerance) => *tolerance > paper::TOLERANCES[3],
        Setting::MaxNonzeros(_) => true,
        Setting::Preset(_) => false,
    };
    if !grid.settings.iter().any(is_far) {
        return None;
    }
    let mut series = Vec::new();
    let mut floors: Vec<(Method, f64)> = Vec::new();
    for &method in &grid.methods {
        for kind in [Kind::Tolerances, Kind::Caps] {
            let points = curve(grid, method, kind, None);
            series.push(Series { band: Vec::new(), ..psnr_line(method, kind_look(kind).0, &points) });
            let without_sh = points.iter().find(|at| at.setting == Setting::MaxNonzeros(0));
            floors.extend(without_sh.and_then(|at| Some((method, at.psnr().mean?))));
        }
    }
    let ratios: Vec<f64> = series.iter().flat_map(|line| &line.points).map(|point| point.0).collect();
    let ends = [f64::min, f64::max].map(|pick| ratios.iter().copied().reduce(pick).unwrap_or(1.0));
    for &(method, psnr) in &floors {
        let points = ends.map(|ratio| (ratio, psnr)).into();
        series.push(Series { mark: None, ..line(method, DASHED, points) });
    }
    let keys = |dashed: Option<&str>| {
        let has_caps = grid.settings.iter().any(|s| matches!(s, Setting::MaxNonzeros(most) if *most > 0));
        let caps = has_caps.then(|| dash_key("capped nonzeros", DOTTED));
        let dashed = dashed.map(|text| dash_key(text, DASHED));
        ("Settings", [Some(dash_key("tolerances", SOLID)), caps, dashed].into_iter().flatten().collect())
    };
    let no_sh = (!floors.is_empty()).then_some("no SH at all");
    let legends = vec![method_keys(grid, &series, true), keys(no_sh)];
    let quality = Chart {
        name: "levels-psnr".to_owned(),
        title: "Does quality level off?".to_owned(),
        caption: format!(
            "Means over scenes, as far as the settings go: down to one nonzero a Gaussian and to none, where measured. {TOLERANCES}"
        ),
        ..Chart::over_ratio(PSNR, series, legends)
    };
    let speed = Chart {
        name: "levels-fps".to_owned(),
        title: "Does speed level off?".to_owned(),
        caption: format!(
            "Means over scenes, drawn on {}. Dashed: the original from dense SH, drawn in turn with the codes. {TOLERANCES} Bands \
             are from the slowest to the fastest round through all views.",
            grid.device()
        ),
        ..fps_chart(grid, &[Kind::Tolerances, Kind::Caps], keys(Some("dense SH")))
    };
    Some([quality, speed])
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
            assert!(figure.pdf.starts_with(b"%PDF-1.4") && figure.pdf.ends_with(b"%%EOF\n"));
            assert!(figure.caption.ends_with("Pursuit: OMP, the paper\u{2019}s (ours is OLS). Layout: f16."));
            assert!(!figure.svg.contains(">-0<") && !figure.svg.contains("-0.0<"), "{}", figure.name);
            // Every chart names its points, and no group of it is moved, which the PDF could not show.
            assert!(
                figure.svg.contains(">0.1</text>") && !figure.svg.contains("<g transform"),
                "{}",
                figure.name
            );
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
        let escaped = maud::html! { (ODD) }.into_string().replace('\'', "&apos;");
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
                point.fps = Some(super::super::testing::fps(odd, odd));
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
