//! Charts of lines and points. The x axis is logarithmic to base 2.

use super::drawing::{Anchor, Figure, SIZE, Shape};
use crate::numbers::number;

/// Edges of the field of the data. The legend is to the right of it.
const LEFT: f64 = 74.0;
const RIGHT: f64 = 670.0;
const TOP: f64 = 50.0;
const BOTTOM: f64 = 436.0;
/// Left edge of the legend, width of its samples, and height of its lines.
const LEGEND: f64 = 688.0;
const SAMPLE: f64 = 26.0;
const LEGEND_LINE: f64 = 21.0;
/// Sizes of text.
const TITLE_SIZE: f64 = 17.0;
const LABEL_SIZE: f64 = 15.0;
const TEXT_SIZE: f64 = 13.0;
const POINT_SIZE: f64 = 11.0;
/// Largest number of letters of a title at its full size. Longer titles are smaller.
const LONGEST_TITLE: f64 = 86.0;
/// Width of data lines, width of lines of the grid, and radius of marks.
const LINE: f64 = 2.2;
const THIN: f64 = 1.0;
const MARK: f64 = 4.6;
const BAND_OPACITY: u8 = 14;
/// Largest number of steps between the labels of the y axis.
const STEPS: f64 = 7.0;
/// Largest number of steps between labelled powers of two. A label has up to eight letters.
const MOST_POWERS: f64 = 8.0;
/// Smallest range of the y axis, for values that do not differ.
const LEAST_RANGE: f64 = 1.0;
/// Largest number that is drawn. Along x its inverse is the smallest number. Every measurement is well within these
/// limits.
const LARGEST: f64 = 1e9;
/// Colours of everything but data. The page's style sheet replaces them in its dark theme.
const INK: &str = "#1d1e22";
const SOFT: &str = "#5c5f68";
const GRID: &str = "#e4e2dc";

/// All three of these colours.
#[cfg(test)]
pub(super) const COLOURS: [&str; 3] = [INK, SOFT, GRID];

/// Dash patterns of lines.
pub(super) const SOLID: &str = "";
pub(super) const DASHED: &str = "6 5";
pub(super) const DOTTED: &str = "2 5";

/// The shape of marks at points: a regular polygon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Mark {
    pub(super) corners: u8,
    /// Direction of the first corner in degrees, clockwise from the right.
    pub(super) turn: f64,
    /// Distance of every second corner from the centre, in radii.
    pub(super) waist: f64,
}

impl Mark {
    pub(super) const fn new(corners: u8, turn: f64) -> Self {
        Self { corners, turn, waist: 1.0 }
    }

    fn at(self, [x, y]: [f64; 2], colour: &'static str) -> Shape {
        let corner = |k: u8| {
            let (sin, cos) =
                (self.turn + 360.0 * f64::from(k) / f64::from(self.corners)).to_radians().sin_cos();
            // Slim marks have a larger radius, so that all marks seem equally large.
            let radius = MARK / self.waist.sqrt() * if k % 2 == 1 { self.waist } else { 1.0 };
            [x + radius * cos, y + radius * sin]
        };
        Shape::Area { points: (0..self.corners).map(corner).collect(), colour, opacity: 100 }
    }
}

/// A point of a chart.
#[derive(Debug, Clone)]
pub(super) struct Dot {
    pub(super) x: f64,
    pub(super) y: f64,
    /// Lower and upper end of the band at this point.
    pub(super) band: [f64; 2],
    /// Text above the point.
    pub(super) label: String,
}

/// A line of a chart.
#[derive(Debug, Clone)]
pub(super) struct Series {
    /// Name in the legend.
    pub(super) name: String,
    pub(super) colour: &'static str,
    pub(super) dash: &'static str,
    pub(super) mark: Option<Mark>,
    /// Whether a band is drawn around the line.
    pub(super) has_band: bool,
    pub(super) dots: Vec<Dot>,
}

/// A chart.
pub(super) struct Chart {
    pub(super) name: String,
    pub(super) title: String,
    pub(super) caption: String,
    pub(super) x: &'static str,
    /// Text after the numbers along x.
    pub(super) x_unit: &'static str,
    pub(super) y: String,
    /// Whether the range of values starts at 0.
    pub(super) from_zero: bool,
    pub(super) series: Vec<Series>,
}

impl Chart {
    /// Draws the chart; `None` if it has no points.
    pub(super) fn draw(self) -> Option<Figure> {
        // The axes cannot show numbers outside of these limits.
        let is_shown = |dot: &Dot| dot.x >= LARGEST.recip() && dot.x <= LARGEST && dot.y.abs() <= LARGEST;
        let mut all = self.series.clone();
        for series in &mut all {
            series.dots.retain(is_shown);
            for dot in &mut series.dots {
                let shown = |end: f64| if end.is_nan() { dot.y } else { end.clamp(-LARGEST, LARGEST) };
                dot.band = dot.band.map(shown);
            }
        }
        all.retain(|series| !series.dots.is_empty());
        let axes = Axes::new(&all, self.from_zero)?;
        let mut canvas = Canvas(Vec::new());
        self.frame(&axes, &mut canvas);
        for series in all.iter().filter(|series| series.has_band) {
            let end = |k: usize| series.dots.iter().map(move |dot| axes.place(dot.x.log2(), dot.band[k]));
            let points = end(0).chain(end(1).rev()).collect();
            canvas.0.push(Shape::Area { points, colour: series.colour, opacity: BAND_OPACITY });
        }
        let mut y = TOP + 10.0;
        for Series { name, colour, dash, mark, dots, .. } in &all {
            let mut points: Vec<[f64; 2]> = dots.iter().map(|dot| axes.place(dot.x.log2(), dot.y)).collect();
            for (dot, [x, y]) in dots.iter().zip(&points) {
                canvas.text([*x, y - 9.0], &dot.label, POINT_SIZE, Anchor::Middle, INK);
            }
            // The legend.
            canvas.text([LEGEND + SAMPLE + 8.0, y + 4.5], name, TEXT_SIZE, Anchor::Start, INK);
            let is_line = points.len() > 1 || mark.is_none();
            let sample = vec![[LEGEND, y], [LEGEND + SAMPLE, y]];
            canvas.0.extend(is_line.then_some(Shape::Line { points: sample, colour, width: LINE, dash }));
            canvas.0.push(Shape::Line { points: points.clone(), colour, width: LINE, dash });
            points.push([LEGEND + SAMPLE / 2.0, y]);
            canvas.0.extend(points.iter().filter_map(|at| Some(mark.as_ref()?.at(*at, colour))));
            y += LEGEND_LINE;
        }
        Some(Figure { name: self.name, title: self.title, caption: self.caption, shapes: canvas.0 })
    }

    /// Draws the title, the axes and the grid.
    fn frame(&self, axes: &Axes, canvas: &mut Canvas) {
        let digits = usize::from(axes.y.2 < 1.0);
        for value in ticks(axes.y) {
            let [_, y] = axes.place(axes.x.0, value);
            canvas.line([LEFT, y], [RIGHT, y], GRID);
            canvas.text([LEFT - 9.0, y + 4.5], &number(Some(value), digits), TEXT_SIZE, Anchor::End, SOFT);
        }
        for power in ticks(axes.x) {
            let [x, _] = axes.place(power, axes.y.0);
            canvas.line([x, TOP], [x, BOTTOM], GRID);
            let text = format!("{}{}", (power.exp2() * LARGEST).round() / LARGEST, self.x_unit);
            canvas.text([x, BOTTOM + 20.0], &text, TEXT_SIZE, Anchor::Middle, SOFT);
        }
        canvas.line([LEFT, TOP], [LEFT, BOTTOM], SOFT);
        canvas.line([LEFT, BOTTOM], [RIGHT, BOTTOM], SOFT);
        let title_size = TITLE_SIZE * (LONGEST_TITLE / self.title.chars().count() as f64).min(1.0);
        let (middle, centre) = ((LEFT + RIGHT) / 2.0, (TOP + BOTTOM) / 2.0);
        canvas.text([SIZE[0] / 2.0, 28.0], &self.title, title_size, Anchor::Middle, INK);
        canvas.text([middle, SIZE[1] - 18.0], self.x, LABEL_SIZE, Anchor::Middle, INK);
        canvas.text([22.0, centre], &self.y, LABEL_SIZE, Anchor::Middle, INK);
        if let Some(Shape::Text { upright, .. }) = canvas.0.last_mut() {
            *upright = true;
        }
    }
}

/// Shapes in the order of drawing.
struct Canvas(Vec<Shape>);

impl Canvas {
    fn line(&mut self, from: [f64; 2], to: [f64; 2], colour: &'static str) {
        self.0.push(Shape::Line { points: vec![from, to], colour, width: THIN, dash: SOLID });
    }

    fn text(&mut self, at: [f64; 2], text: &str, size: f64, anchor: Anchor, colour: &'static str) {
        let text = text.replace(char::is_control, " ");
        self.0.push(Shape::Text { at, text, size, anchor, upright: false, colour });
    }
}

/// The ranges of the axes: the first label, the last label, and the step between labels. Along x they are powers of two.
#[derive(Clone, Copy)]
struct Axes {
    x: (f64, f64, f64),
    y: (f64, f64, f64),
}

impl Axes {
    /// Returns axes that show all of `series`; `None` if there is nothing to show.
    fn new(series: &[Series], from_zero: bool) -> Option<Self> {
        let x = range(series.iter().flat_map(|series| &series.dots).map(|dot| dot.x.log2()))?;
        let y = range(series.iter().flat_map(|series| {
            let bands = series.dots.iter().filter(|_| series.has_band).flat_map(|dot| dot.band);
            series.dots.iter().map(|dot| dot.y).chain(bands)
        }))?;
        let low = if from_zero { y.0.min(0.0) } else { y.0 };
        let step = step((y.1 - low).max(LEAST_RANGE));
        let low = (low / step).floor() * step;
        let high = ((y.1 / step).ceil() * step).max(low + step);
        Some(Self { x: powers(x), y: (low, high, step) })
    }

    /// Returns the place of a point. `x` is the exponent of a power of two.
    fn place(&self, x: f64, y: f64) -> [f64; 2] {
        let share = |value: f64, axis: (f64, f64, f64)| (value - axis.0) / (axis.1 - axis.0);
        [LEFT + share(x, self.x) * (RIGHT - LEFT), BOTTOM - share(y, self.y) * (BOTTOM - TOP)]
    }
}

/// Returns the smallest and the largest of the finite `values`.
fn range(values: impl Iterator<Item = f64> + Clone) -> Option<(f64, f64)> {
    let finite = values.filter(|value| value.is_finite());
    Some((finite.clone().reduce(f64::min)?, finite.reduce(f64::max)?))
}

/// Returns the values that have labels.
fn ticks((first, last, step): (f64, f64, f64)) -> impl Iterator<Item = f64> {
    let all = std::iter::successors(Some(first), move |value| Some(value + step));
    all.take_while(move |value| *value <= last + step / 2.0)
}

/// Returns the smallest round step that divides `spread` into at most [`STEPS`] parts.
fn step(spread: f64) -> f64 {
    let least = spread / STEPS;
    let power = 10_f64.powf(least.log10().floor());
    let rounds = [1.0, 2.0, 5.0].into_iter().map(|round| round * power);
    rounds.filter(|round| *round >= least).reduce(f64::min).unwrap_or(10.0 * power)
}

/// Returns the first and the last power of two of an axis that shows `logarithms`, and the step between two labels. The
/// step is large enough that labels do not touch.
fn powers(logarithms: (f64, f64)) -> (f64, f64, f64) {
    let first = logarithms.0.floor();
    let spread = (logarithms.1 - first).ceil().max(1.0);
    let step = (spread / MOST_POWERS).ceil();
    (first, first + (spread / step).ceil() * step, step)
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
