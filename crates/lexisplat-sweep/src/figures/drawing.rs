//! The elements of charts: lines, areas and text. They are drawn as SVG for a page.

use maud::{Markup, html};

/// The part of a text that is at the text's place: its start, its middle or its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// An element of a drawing. Places are in pixels from the left and from the top.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Shape {
    /// A line. `dash` has the lengths that are drawn and left out in turn; an empty `dash` draws the whole line.
    Line { points: Vec<[f64; 2]>, colour: &'static str, width: f64, dash: &'static str },
    /// A filled area. `opacity` is in percent.
    Area { points: Vec<[f64; 2]>, colour: &'static str, opacity: u8 },
    /// Text on one line. It runs from below to above if it is `upright`.
    Text { at: [f64; 2], text: String, size: f64, anchor: Anchor, upright: bool, colour: &'static str },
}

/// Width and height of figures in pixels.
pub(super) const SIZE: [f64; 2] = [860.0, 500.0];

/// A figure.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Figure {
    /// Name for files, without extension. It is safe on every system, and unique among the figures of a sweep.
    pub(crate) name: String,
    /// Title of the figure: its contents in a few words.
    pub(crate) title: String,
    /// Explanation of how to read the figure.
    pub(crate) caption: String,
    /// Elements in the order of drawing.
    pub(super) shapes: Vec<Shape>,
}

impl Figure {
    /// Returns the figure as an SVG element of a page, which scales with the page.
    pub(crate) fn svg(&self) -> Markup {
        let [width, height] = SIZE;
        html! {
            svg class="plot" role="img" aria-label=(self.title) viewBox={ "0 0 " (width) " " (height) } stroke-linejoin="round" {
                @for shape in &self.shapes { (shape.svg()) }
            }
        }
    }
}

impl Shape {
    fn svg(&self) -> Markup {
        let list = |points: &[[f64; 2]]| {
            let pairs = points.iter().map(|[x, y]| format!("{},{}", number(*x), number(*y)));
            pairs.collect::<Vec<_>>().join(" ")
        };
        match self {
            Self::Line { points, colour, width, dash } => html! {
                polyline points=(list(points)) fill="none" stroke=(colour) stroke-width=(number(*width))
                    stroke-dasharray=[(!dash.is_empty()).then_some(dash)] {}
            },
            Self::Area { points, colour, opacity } => html! {
                polygon points=(list(points)) fill=(colour) fill-opacity={ (opacity) "%" } {}
            },
            Self::Text { at: [x, y], text, size, anchor, upright, colour } => {
                let anchor = match anchor {
                    Anchor::Start => "start",
                    Anchor::Middle => "middle",
                    Anchor::End => "end",
                };
                let (x, y) = (number(*x), number(*y));
                html! {
                    text x=(x) y=(y) font-size=(number(*size)) text-anchor=(anchor)
                        transform=[upright.then(|| format!("rotate(-90 {x} {y})"))] fill=(colour) { (text) }
                }
            }
        }
    }
}

/// Returns a number with at most three digits after the point.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}
