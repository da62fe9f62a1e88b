//! Prints scores as a table of text.

use std::fmt::Write as _;

use anyhow::Result;
use lexisplat_eval::metrics::Metric;
use lexisplat_eval::{Comparison, Summary, format};

/// Width of the narrowest column of names, in characters.
const LEAST_NAME: usize = 8;

/// A table with a line for each view, then a line each for the mean, the minimum and the maximum.
pub(super) struct ScoreTable<'a, F> {
    comparison: &'a Comparison,
    /// Metrics, each with the width of its column.
    columns: Vec<(Metric, usize)>,
    name_width: usize,
    /// Returns the text of a score. Identical pictures have no PSNR.
    cell: F,
}

impl<'a, F: Fn(Metric, Option<f64>) -> String> ScoreTable<'a, F> {
    pub(super) fn new(comparison: &'a Comparison, width: impl Fn(Metric) -> usize, cell: F) -> Self {
        let columns = comparison.metrics().map(|metric| (metric, width(metric))).collect();
        let names = comparison.views.iter().map(|view| view.name.chars().count());
        Self { comparison, columns, name_width: names.max().unwrap_or(0).max(LEAST_NAME), cell }
    }

    fn line(
        &self,
        out: &mut String,
        (name, size): (&str, &str),
        cell: impl Fn(Metric) -> String,
    ) -> Result<()> {
        write!(out, "{name:<name_width$}  {size:>11}", name_width = self.name_width)?;
        for &(metric, width) in &self.columns {
            write!(out, "  {:>width$}", cell(metric))?;
        }
        Ok(writeln!(out)?)
    }

    /// Writes the headings and a line for each view.
    pub(super) fn views(&self, out: &mut String) -> Result<()> {
        self.line(out, ("view", "size"), |metric| metric.title().to_owned())?;
        for view in &self.comparison.views {
            let size = format!("{}x{}", view.width, view.height);
            let name = format::escape(&view.name);
            self.line(out, (&name, &size), |metric| (self.cell)(metric, view.get(metric)))?;
        }
        Ok(())
    }

    /// Writes a line for each part of the summary.
    pub(super) fn summary(&self, out: &mut String) -> Result<()> {
        for (name, part) in Summary::STATISTICS {
            let value = |metric| self.comparison.get(metric).as_ref().and_then(part);
            self.line(out, (name, ""), |metric| (self.cell)(metric, value(metric)))?;
        }
        Ok(())
    }
}
