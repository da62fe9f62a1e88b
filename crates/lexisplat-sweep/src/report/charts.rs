//! Charts as inline SVG. Colours are classes of the page's style sheet, so they follow its theme.

use std::fmt::Write;

use super::text;

/// Width of a chart in its own units; the page scales it.
const WIDTH: f64 = 720.0;
/// Height of one bar of [`bars`].
const BAR: f64 = 46.0;
/// Space above a bar for its label.
const LABEL: f64 = 22.0;
/// Narrowest part of a bar that still gets its share written on it.
const NAMED: f64 = 44.0;
/// Height of the columns of [`histogram`].
const COLUMNS: f64 = 150.0;

/// One group of bytes in a file.
pub(super) struct Part {
    /// Name for people.
    pub(super) name: &'static str,
    /// Class of its colour.
    pub(super) class: &'static str,
    pub(super) before: u64,
    pub(super) after: u64,
}

/// Two stacked bars on one scale.
pub(super) fn bars(parts: &[Part], before: (&str, u64), after: (&str, u64)) -> String {
    let height = 2.0 * (BAR + LABEL) + 14.0;
    let longest = before.1.max(after.1).max(1) as f64;
    let mut svg = format!(
        "<svg viewBox=\"0 0 {WIDTH} {height}\" role=\"img\" aria-label=\"Bytes by attribute: {} {}, {} {}\">",
        before.0,
        text::bytes(before.1),
        after.0,
        text::bytes(after.1)
    );
    for (row, (name, total)) in [before, after].into_iter().enumerate() {
        let y = row as f64 * (BAR + LABEL + 14.0);
        let _ = write!(
            svg,
            "<text x=\"0\" y=\"{:.0}\" class=\"label\">{}, {}</text>",
            y + LABEL - 7.0,
            text::escape(name),
            text::bytes(total)
        );
        let mut x = 0.0;
        for part in parts {
            let bytes = if row == 0 { part.before } else { part.after };
            if bytes == 0 {
                continue;
            }
            let width = bytes as f64 / longest * WIDTH;
            let _ = write!(
                svg,
                "<g class=\"{}\"><title>{}: {}</title><rect x=\"{x:.2}\" y=\"{:.0}\" width=\"{:.2}\" height=\"{BAR}\"/>",
                part.class,
                part.name,
                text::bytes(bytes),
                y + LABEL,
                (width - 1.0).max(0.5)
            );
            if width >= NAMED {
                let share = bytes as f64 / total.max(1) as f64 * 100.0;
                let _ = write!(
                    svg,
                    "<text x=\"{:.1}\" y=\"{:.0}\">{share:.0}%</text>",
                    x + width / 2.0,
                    y + LABEL + BAR / 2.0 + 5.0
                );
            }
            svg.push_str("</g>");
            x += width;
        }
    }
    svg.push_str("</svg>");
    svg
}

/// Columns for `counts[k]`, how many Gaussians have `k` nonzeros, with a line at `mean`.
pub(super) fn histogram(counts: &[u64], mean: f64) -> String {
    let used = counts.iter().rposition(|&n| n > 0).map_or(1, |last| last + 1);
    let tallest = counts.iter().copied().max().unwrap_or(0).max(1) as f64;
    let total = counts.iter().sum::<u64>().max(1) as f64;
    let step = WIDTH / used as f64;
    let floor = COLUMNS + 18.0;
    let mut svg = format!(
        "<svg viewBox=\"0 0 {WIDTH} {}\" role=\"img\" aria-label=\"How many Gaussians need how many atoms; {mean:.2} in the mean\">",
        floor + 24.0
    );
    for (k, &n) in counts[..used.min(counts.len())].iter().enumerate() {
        let height = n as f64 / tallest * COLUMNS;
        let x = k as f64 * step;
        let _ = write!(
            svg,
            "<g class=\"g-codes\"><title>{k} atoms: {} Gaussians ({:.1}%)</title><rect x=\"{x:.2}\" y=\"{:.2}\" width=\"{:.2}\" height=\"{height:.2}\" rx=\"1.5\"/></g>",
            text::count(n),
            n as f64 / total * 100.0,
            floor - height,
            (step - 2.0).max(1.0)
        );
        if k.is_multiple_of(5) {
            let _ = write!(
                svg,
                "<text class=\"tick\" x=\"{:.1}\" y=\"{:.0}\">{k}</text>",
                x + step / 2.0,
                floor + 18.0
            );
        }
    }
    let x = (mean + 0.5) * step;
    // The text goes to the side that has room.
    let (anchor, shift) = if x > WIDTH / 2.0 { ("end", -6.0) } else { ("start", 6.0) };
    let _ = write!(
        svg,
        "<line class=\"mean\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"4\" y2=\"{floor}\"/><text class=\"label\" text-anchor=\"{anchor}\" x=\"{:.1}\" y=\"14\">mean {mean:.2}</text></svg>",
        x + shift
    );
    svg
}
