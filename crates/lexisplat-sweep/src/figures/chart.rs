//! Charts of lines and points by `kuva`, as SVG, PNG and PDF.

use kuva::backend::svg::SvgBackend;
use kuva::plot::annotations::TextAnnotation;
use kuva::plot::legend::{LegendEntry, LegendShape};
use kuva::plot::{BandPlot, LinePlot, MarkerShape, ScatterPlot};
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;
use kuva::render::render::render_multiple;
use kuva::{RasterBackend, Theme};

use super::Figure;
use super::pdf::pdf;
use lexisplat_compress::{Error, Result};

/// Size of the whole chart in SVG pixels.
const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 500.0;
/// PNG pixels for each SVG pixel.
const PNG_SCALE: f32 = 2.0;
/// Sizes of text in SVG pixels.
const TITLE_SIZE: u32 = 17;
const LABEL_SIZE: u32 = 15;
const TEXT_SIZE: u32 = 13;
const POINT_SIZE: u32 = 11;
/// Most characters in a line of a title.
const TITLE_WRAP: usize = 78;
/// Width of lines and radius of marks, in SVG pixels.
const LINE: f64 = 2.2;
const MARK: f64 = 4.2;
const BAND_OPACITY: f64 = 0.14;
/// Most steps between the labels of the y axis.
const STEPS: f64 = 7.0;
/// Most steps between labelled powers of two. A label has up to eight characters.
const MOST_POWERS: f64 = 8.0;
/// Least range of the y axis, for values that do not differ.
const LEAST_RANGE: f64 = 1.0;
/// Largest number that is drawn. Along x its inverse is the smallest. Every measurement is well within.
const LARGEST: f64 = 1e9;
/// Colours of everything but data; the page's style sheet swaps them in its dark theme.
const INK: &str = "#1d1e22";
const SOFT: &str = "#5c5f68";
const GRID: &str = "#e4e2dc";
const PAPER: &str = "#ffffff";

/// The four colours.
#[cfg(test)]
pub(super) const COLOURS: [&str; 4] = [INK, SOFT, GRID, PAPER];

/// A dash pattern, in SVG pixels: drawn, not drawn.
pub(super) const SOLID: &str = "";
pub(super) const DASHED: &str = "6 5";
pub(super) const DOTTED: &str = "2 5";

/// The shape drawn at points.
pub(super) type Mark = MarkerShape;

/// One line of a chart.
#[derive(Debug, Clone)]
pub(super) struct Series {
    pub(super) colour: &'static str,
    pub(super) dash: &'static str,
    pub(super) mark: Option<Mark>,
    /// Whether points are joined.
    pub(super) joined: bool,
    /// Pairs of x and y.
    pub(super) points: Vec<(f64, f64)>,
    /// Lowest and highest value at each point; empty for none.
    pub(super) band: Vec<(f64, f64)>,
    /// What is written above each point; empty for nothing.
    pub(super) labels: Vec<String>,
}

impl Series {
    /// Leaves out points for which `keep` is false, with what belongs to them.
    fn retain(&mut self, keep: impl Fn(&(f64, f64)) -> bool) {
        let kept: Vec<bool> = self.points.iter().map(keep).collect();
        retain(&mut self.points, &kept);
        retain(&mut self.band, &kept);
        retain(&mut self.labels, &kept);
    }
}

/// Leaves out the values that are not `kept`, and all if there is not one for each.
fn retain<T>(values: &mut Vec<T>, kept: &[bool]) {
    if values.len() != kept.len() {
        values.clear();
    }
    let mut kept = kept.iter();
    values.retain(|_| kept.next().is_some_and(|kept| *kept));
}

/// A group of a legend: title and entries.
pub(super) type Legend = (&'static str, Vec<LegendEntry>);

/// One entry of a legend, shown with a mark, or else with a line.
pub(super) fn key(text: &str, colour: &str, dash: &str, mark: Option<Mark>) -> LegendEntry {
    LegendEntry {
        label: literal(text),
        color: colour.to_owned(),
        shape: mark.map_or(LegendShape::Line, LegendShape::Marker),
        dasharray: (!dash.is_empty()).then(|| dash.to_owned()),
    }
}

/// Colour of entries that explain a dash or mark of every colour.
pub(super) const NEUTRAL: &str = SOFT;

/// A chart with a logarithmic axis to base 2 along x.
pub(super) struct Chart {
    pub(super) name: String,
    pub(super) title: String,
    pub(super) caption: String,
    pub(super) x: &'static str,
    /// Written after the numbers along x.
    pub(super) x_unit: &'static str,
    pub(super) y: String,
    /// Whether the range of values starts at 0.
    pub(super) from_zero: bool,
    pub(super) series: Vec<Series>,
    pub(super) legends: Vec<Legend>,
}

/// `text` with what `kuva` takes for mathematics escaped.
fn literal(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect::<String>().replace('$', "\\$")
}

/// The least and the greatest of `values` that are finite.
fn range(values: impl Iterator<Item = f64> + Clone) -> Option<(f64, f64)> {
    let finite = values.filter(|value| value.is_finite());
    Some((finite.clone().reduce(f64::min)?, finite.reduce(f64::max)?))
}

/// The smallest round step that divides `spread` into at most [`STEPS`] parts.
fn step(spread: f64) -> f64 {
    let least = spread / STEPS;
    let power = 10_f64.powf(least.log10().floor());
    let rounds = [1.0, 2.0, 5.0].into_iter().map(|round| round * power);
    rounds.filter(|round| *round >= least).reduce(f64::min).unwrap_or(10.0 * power)
}

/// The first and the last power of two of an axis that shows `logarithms`, and the powers between two labels: enough
/// that labels do not touch.
fn powers(logarithms: (f64, f64)) -> (f64, f64, f64) {
    let first = logarithms.0.floor();
    let spread = (logarithms.1 - first).ceil().max(1.0);
    let step = (spread / MOST_POWERS).ceil();
    (first, first + (spread / step).ceil() * step, step)
}

impl Chart {
    /// A chart without a name over the paper's compression ratio.
    pub(super) fn over_ratio(y: &str, series: Vec<Series>, legends: Vec<Legend>) -> Self {
        Self {
            name: String::new(),
            title: String::new(),
            caption: String::new(),
            x: "Comp Ratio, coefficients: SH-rest / mean nonzeros (log scale)",
            x_unit: "\u{d7}",
            y: y.to_owned(),
            from_zero: false,
            series,
            legends,
        }
    }

    /// Draws the chart. `None` if it has no points.
    pub(super) fn draw(mut self) -> Result<Option<Figure>> {
        for series in &mut self.series {
            // The axis cannot show other numbers.
            series.retain(|&(x, y)| x >= LARGEST.recip() && x <= LARGEST && y.abs() <= LARGEST);
            for band in &mut series.band {
                *band = (band.0.max(-LARGEST), band.1.min(LARGEST));
            }
        }
        self.series.retain(|series| !series.points.is_empty());
        let points = || self.series.iter().flat_map(|series| &series.points);
        let values = self.series.iter().flat_map(|series| {
            let bands = series.band.iter().flat_map(|band| [band.0, band.1]);
            series.points.iter().map(|point| point.1).chain(bands)
        });
        let (Some(x), Some(y)) = (range(points().map(|point| point.0.log2())), range(values.clone())) else {
            return Ok(None);
        };
        let mut layout = self.layout(x, y);
        for series in &self.series {
            for ((x, y), label) in series.points.iter().zip(&series.labels) {
                let text = TextAnnotation::new(literal(label), x.log2(), *y).with_font_size(POINT_SIZE);
                layout = layout.with_annotation(text);
            }
        }
        let mut plots: Vec<Plot> = Vec::new();
        let bands = self.series.iter().filter(|series| !series.band.is_empty());
        plots.extend(bands.map(|series| {
            let x = series.points.iter().map(|point| point.0.log2());
            let (low, high): (Vec<f64>, Vec<f64>) = series.band.iter().copied().unzip();
            BandPlot::new(x, low, high).with_color(series.colour).with_opacity(BAND_OPACITY).into()
        }));
        for series in &self.series {
            let points: Vec<(f64, f64)> = series.points.iter().map(|&(x, y)| (x.log2(), y)).collect();
            if series.joined {
                let mut line = LinePlot::new()
                    .with_data(points.clone())
                    .with_color(series.colour)
                    .with_stroke_width(LINE);
                if !series.dash.is_empty() {
                    line = line.with_line_style(kuva::plot::LineStyle::Custom(series.dash.to_owned()));
                }
                plots.push(line.into());
            }
            if let Some(mark) = series.mark {
                let marks = ScatterPlot::new().with_data(points).with_color(series.colour);
                plots.push(marks.with_size(MARK).with_marker(mark).into());
            }
        }
        let scene = render_multiple(plots, layout);
        let png = RasterBackend::new().with_scale(PNG_SCALE).render_scene(&scene).map_err(|why| {
            Error::parameter("figure", &self.name, format!("a chart that can be drawn: {why}"))
        })?;
        let svg = SvgBackend::new().render_scene(&scene);
        // With a view box the picture scales to the width of the page.
        let view_box = format!("<svg viewBox=\"0 0 {} {}\" ", scene.width, scene.height);
        let svg = svg.replacen("<svg ", &view_box, 1);
        let pdf = pdf(&scene);
        Ok(Some(Figure { name: self.name, title: self.title, caption: self.caption, svg, png, pdf }))
    }

    fn layout(&self, x: (f64, f64), y: (f64, f64)) -> Layout {
        let theme = Theme {
            background: PAPER.into(),
            axis_color: SOFT.into(),
            grid_color: GRID.into(),
            tick_color: SOFT.into(),
            text_color: INK.into(),
            legend_bg: PAPER.into(),
            legend_border: GRID.into(),
            ..Theme::light()
        };
        let unit = self.x_unit;
        let ticks = TickFormat::Custom(std::sync::Arc::new(move |power: f64| {
            let value = power.exp2();
            if value < 1.0 { format!("{value}{unit}") } else { format!("{value:.0}{unit}") }
        }));
        let low = if self.from_zero { y.0.min(0.0) } else { y.0 };
        let step = step((y.1 - low).max(LEAST_RANGE));
        let low = (low / step).floor() * step;
        let high = ((y.1 / step).ceil() * step).max(low + step);
        // Both ends are whole powers of two, so that the axis has at least two labels.
        let (first, last, powers) = powers(x);
        let mut layout = Layout::new((first, last), (low, high))
            .with_width(WIDTH)
            .with_height(HEIGHT)
            .with_theme(theme)
            .with_title(literal(&self.title))
            .with_title_wrap(TITLE_WRAP)
            .with_title_size(TITLE_SIZE)
            .with_label_size(LABEL_SIZE)
            .with_tick_size(TEXT_SIZE)
            .with_body_size(TEXT_SIZE)
            .with_x_label(literal(self.x))
            .with_y_label(literal(&self.y))
            .with_x_axis_min(first)
            .with_x_axis_max(last)
            .with_x_tick_step(powers)
            .with_y_axis_min(low)
            .with_y_axis_max(high)
            .with_y_tick_step(step)
            .with_x_tick_format(ticks)
            .with_legend_box(false);
        for (title, keys) in self.legends.iter().filter(|legend| !legend.1.is_empty()) {
            layout = layout.with_legend_group(*title, keys.clone());
        }
        layout
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_two_leave_room_for_their_texts() {
        for (logarithms, expected) in [
            ((1.2, 3.5), (1.0, 4.0, 1.0)),
            ((2.0, 2.0), (2.0, 3.0, 1.0)),
            ((0.0, 8.0), (0.0, 8.0, 1.0)),
            ((1.0, 16.7), (1.0, 17.0, 2.0)),
            ((1.0, 18.0), (1.0, 19.0, 3.0)),
        ] {
            assert_eq!(powers(logarithms), expected, "{logarithms:?}");
        }
    }

    #[test]
    fn steps_are_round() {
        for (spread, expected) in
            [(1.0, 0.2), (7.0, 1.0), (7.1, 2.0), (30.0, 5.0), (40.0, 10.0), (700.0, 100.0)]
        {
            assert!((step(spread) - expected).abs() < 1e-9, "{spread}: {}", step(spread));
        }
    }
}
