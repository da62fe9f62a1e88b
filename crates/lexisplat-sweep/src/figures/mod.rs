//! Figures of a sweep, as SVG for the page and as PDF for papers.

mod chart;
mod drawing;
mod pdf;

use lexisplat_eval::FrameRate;
use lexisplat_eval::format::file_name;
use lexisplat_eval::metrics::Metric;

use chart::{Chart, DASHED, DOTTED, Dot, Mark, SOLID, Series};

pub(crate) use drawing::Figure;

use super::curve::{At, Kind, curve};
use super::grid::Grid;
use super::measure::Measure;
use super::{Fps, Method, Results, Setting, paper, unique};

/// Largest number of characters of a device's name on an axis. Captions have the whole name.
const LONGEST_DEVICE: usize = 36;
/// Explanation of the numbers at points, for captions.
const TOLERANCES: &str =
    "Numbers at points are tolerances. Capped: at most so many nonzeros a Gaussian, without a tolerance.";
/// Texts of axes that several charts share.
const PSNR: &str = "PSNR against the original, dB";
const RATIO: &str = "Comp Ratio, coefficients: SH-rest / mean nonzeros (log scale)";
/// Sign after ratios.
const TIMES: &str = "\u{d7}";
/// Mark of the paper's numbers.
const STAR: Mark = Mark { waist: 0.35, ..Mark::new(8, 45.0) };

/// Returns the colour and the mark of a method. The colours are those of Okabe and Ito (2008), which colour-blind people
/// can distinguish.
fn look(method: Method) -> (&'static str, Mark) {
    match method {
        Method::Gs3d => ("#0072b2", CIRCLE),
        Method::Mcmc => ("#d55e00", SQUARE),
        Method::PixelGs => ("#009e73", TRIANGLE),
        Method::Eagles => ("#cc79a7", Mark::new(4, 0.0)),
        Method::EaglesNoSq => ("#56b4e9", Mark::new(3, 90.0)),
        Method::Other => ("#e69f00", Mark::new(5, -90.0)),
    }
}

const CIRCLE: Mark = Mark::new(24, 0.0);
const SQUARE: Mark = Mark::new(4, 45.0);
const TRIANGLE: Mark = Mark::new(3, -90.0);

/// Returns the dashes and the mark of a kind of settings, and the text after the method's name in a legend.
fn kind_look(kind: Kind) -> (&'static str, Mark, &'static str) {
    match kind {
        Kind::Tolerances => (SOLID, CIRCLE, ""),
        Kind::Caps => (DOTTED, TRIANGLE, ", capped"),
        Kind::Presets => (DASHED, SQUARE, ", packed"),
    }
}

/// Returns every colour in a figure. The page's style sheet replaces them in its dark theme.
#[cfg(test)]
pub(super) fn colours() -> Vec<&'static str> {
    chart::COLOURS.into_iter().chain(Method::ALL.map(|method| look(method).0)).collect()
}

/// Returns a line of one method through a kind of settings. `dot` returns x, y and the ends of the band of a setting.
fn line(
    grid: &Grid<'_>,
    method: Method,
    kind: Kind,
    column: Option<usize>,
    dot: impl Fn(&At<'_>) -> Option<[f64; 4]>,
) -> Series {
    let (colour, mark) = look(method);
    let (dash, _, kind_name) = kind_look(kind);
    let name = format!("{}{kind_name}", method.title());
    let dots = curve(grid, method, kind, column).into_iter().filter_map(|at| {
        let [x, y, low, high] = dot(&at)?;
        // The label of a tolerance is its number alone.
        let label = match at.setting {
            Setting::Tolerance(tolerance) => tolerance.to_string(),
            other => other.label(),
        };
        Some(Dot { x, y, band: [low, high], label })
    });
    let has_band = kind == Kind::Tolerances;
    Series { name, colour, dash, mark: Some(mark), has_band, dots: dots.collect() }
}

/// Returns every figure that has something to show.
pub(crate) fn figures(results: &Results) -> Vec<Figure> {
    let grid = Grid::new(results);
    let scenes = (0..grid.headings.len()).map(|column| quality(&grid, Some(column)));
    let mut figures: Vec<Figure> = Vec::new();
    for chart in [quality(&grid, None), speed(&grid), bytes(&grid)].into_iter().chain(scenes) {
        let Some(mut figure) = chart.draw() else { continue };
        figure.caption = format!("{} {}", figure.caption, results.how()).trim_end().to_owned();
        // The names of scenes may differ only in letters that file names cannot have.
        figure.name = unique(&figure.name, |name| {
            figures.iter().any(|other| other.name.to_lowercase() == name.to_lowercase())
        });
        figures.push(figure);
    }
    figures
}

/// Returns a chart of PSNR over ratio along tolerances and capped nonzeros: over all scenes with the paper's means, or of
/// one scene.
fn quality(grid: &Grid<'_>, column: Option<usize>) -> Chart {
    let kinds = [Kind::Tolerances, Kind::Caps];
    let mut series = Vec::new();
    for &method in &grid.methods {
        series.extend(kinds.map(|kind| {
            line(grid, method, kind, column, |at| {
                let psnr = at.psnr();
                let mean = psnr.mean?;
                Some([at.ratio()?, mean, psnr.min.unwrap_or(mean), psnr.max.unwrap_or(mean)])
            })
        }));
    }
    let title = "Quality against the paper's compression ratio";
    let (name, title, of) = match column {
        Some(column) => {
            let heading = &grid.headings[column];
            let of = format!("{heading} at each setting; bands are from the worst to the best view.");
            (format!("scene-{}", file_name(heading)), format!("{title}: {heading}"), of)
        }
        None => {
            let is_empty = series.iter().all(|line| line.dots.is_empty());
            for method in Method::ALL.into_iter().filter(|_| !is_empty) {
                let mean = |measure| paper::mean(measure, method);
                let Some((x, y)) =
                    mean(Measure::CoefficientRatio).zip(mean(Measure::ToOriginal(Metric::Psnr)))
                else {
                    continue;
                };
                let (colour, mark) = (look(method).0, Some(STAR));
                let dot = Dot { x, y, band: [y; 2], label: paper::TOLERANCE.to_string() };
                let name = format!("{}, paper", method.title());
                series.push(Series { name, colour, dash: SOLID, mark, has_band: false, dots: vec![dot] });
            }
            let of = "Means over scenes at each setting; bands are from the worst to the best scene. Stars are the paper's \
                      means over its 13 scenes at tol 0.1.";
            ("psnr-ratio".to_owned(), title.to_owned(), of.to_owned())
        }
    };
    let caption = format!("{of} {TOLERANCES}");
    Chart { name, title, caption, x: RATIO, x_unit: TIMES, y: PSNR.to_owned(), from_zero: false, series }
}

/// Returns a chart of frames per second over ratio. The frame rates of the original are dashed.
fn speed(grid: &Grid<'_>) -> Chart {
    let kinds = [Kind::Tolerances, Kind::Caps];
    let mut series = Vec::new();
    for &method in &grid.methods {
        let of = |kind, measure: Measure, rate: fn(&Fps) -> FrameRate| {
            line(grid, method, kind, None, move |at| {
                let (ratio, mean) = at.ratio().zip(at.mean(measure))?;
                let (least, most) = at.rounds(rate).unwrap_or((mean, mean));
                Some([ratio, mean, least, most])
            })
        };
        series.extend(kinds.map(|kind| of(kind, Measure::SparseFps, |fps| fps.sparse)));
        let mut dense = of(Kind::Tolerances, Measure::DenseFps, |fps| fps.dense);
        dense.dots.iter_mut().for_each(|dot| dot.label.clear());
        let name = format!("{}, dense SH", method.title());
        series.push(Series { name, mark: None, dash: DASHED, ..dense });
    }
    let device = grid.device();
    let is_short = device.chars().count() <= LONGEST_DEVICE;
    Chart {
        name: "fps-ratio".to_owned(),
        title: "Speed against the paper's compression ratio".to_owned(),
        caption: format!(
            "Means over scenes at each setting, drawn on {device}. Dashed: the original from dense SH, drawn in turn with the \
             codes. {TOLERANCES} Bands are from the slowest to the fastest round through all views."
        ),
        x: RATIO,
        x_unit: TIMES,
        y: if is_short { format!("Frames a second ({device})") } else { "Frames a second".to_owned() },
        from_zero: true,
        series,
    }
}

/// Returns a chart of PSNR over the bytes of whole files.
fn bytes(grid: &Grid<'_>) -> Chart {
    let mut series = Vec::new();
    for kind in Kind::ALL {
        for &method in &grid.methods {
            let line = line(grid, method, kind, None, |at| {
                let (bytes, psnr) = at.mean(Measure::BytesEach).zip(at.psnr().mean)?;
                Some([bytes, psnr, psnr, psnr])
            });
            series.push(Series { mark: Some(kind_look(kind).1), has_band: false, ..line });
        }
    }
    Chart {
        name: "bytes-psnr".to_owned(),
        title: "Quality against real size".to_owned(),
        caption: format!(
            "Whole files, every byte counted, over Gaussians; means over scenes. {TOLERANCES} Tolerances and capped nonzeros keep \
             all but SH exact; packed presets quantise everything."
        ),
        x: "Bytes a Gaussian, whole file (log scale)",
        x_unit: "",
        y: PSNR.to_owned(),
        from_zero: false,
        series,
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{ODD, fps, results};
    use super::*;
    use crate::report::testing::check_nesting;

    #[test]
    fn figures_are_well_formed_and_hold_every_series() {
        let figures = figures(&results());
        let names: Vec<&str> = figures.iter().map(|figure| figure.name.as_str()).collect();
        // Garden's pictures are identical: a scene without a number.
        assert_eq!(names, ["psnr-ratio", "fps-ratio", "bytes-psnr", "scene-bonsai", "scene-a_b__c_____"]);
        let svgs: Vec<String> = figures.iter().map(|figure| figure.svg().into_string()).collect();
        for (figure, svg) in figures.iter().zip(&svgs) {
            check_nesting(svg);
            assert!(svg.contains(" viewBox=\"0 0 860 500\""), "{}", &svg[..80]);
            assert!(!svg.contains("NaN") && !svg.contains(">inf"), "{}", figure.name);
            let pdf = figure.pdf();
            assert!(pdf.starts_with(b"%PDF-1.4") && pdf.ends_with(b"%%EOF\n"));
            assert!(!String::from_utf8_lossy(&pdf).contains("NaN"), "{}", figure.name);
            assert!(figure.caption.ends_with("Pursuit: OMP, the paper\u{2019}s (ours is OLS). Layout: f16."));
            assert!(!svg.contains(">-0<") && !svg.contains("-0.0<"), "{}", figure.name);
            // Every chart names its points.
            assert!(svg.contains(">0.1</text>"), "{}", figure.name);
            for method in ["3DGS", "MCMC"] {
                let colour = look(if method == "MCMC" { Method::Mcmc } else { Method::Gs3d }).0;
                let there = svg.contains(&format!(">{method}</text>"));
                // The odd scene has MCMC alone.
                assert_eq!(
                    there,
                    !(figure.name.starts_with("scene-a") && method == "3DGS"),
                    "{}",
                    figure.name
                );
                assert_eq!(svg.contains(colour), there, "{} {method}", figure.name);
            }
        }
        let has = |figure: usize, text: &str| svgs[figure].contains(&format!(">{text}</text>"));
        assert!(has(2, "3DGS, packed") && has(2, "3DGS, capped") && has(0, "3DGS, capped"));
        assert!(has(1, "MCMC, dense SH") && has(1, "Frames a second (CPU)") && has(0, "PixelGS, paper"));
        let escaped = maud::html! { (ODD) }.into_string();
        assert!(svgs[4].contains(&escaped), "{}", svgs[4]);
    }

    #[test]
    fn figures_are_the_same_each_time() {
        assert!(figures(&results()) == figures(&results()));
        assert!(figures(&Results::default()).is_empty());
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
                point.fps = Some(fps(odd, odd));
            }
        }
        for figure in figures(&results) {
            let svg = figure.svg().into_string();
            assert!(!svg.contains("NaN") && !svg.contains("inf\""), "{}", figure.name);
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
        let names: Vec<String> = figures(&results).into_iter().map(|figure| figure.name).collect();
        assert_eq!(names, ["psnr-ratio", "fps-ratio", "bytes-psnr", "scene-a_b", "scene-A_b-2"]);
    }
}
