//! Histograms in the output of `info`.

use std::fmt::Write as _;

use anyhow::Result;
use lexisplat_eval::format;

/// Width of the longest bar of a histogram, in characters.
const BAR: usize = 40;

/// Writes a bar for each label. Its length is in proportion to its count.
pub(super) fn bars(out: &mut String, labels: &[String], counts: &[u64]) -> Result<()> {
    let most = counts.iter().copied().max().unwrap_or(0).max(1);
    for (label, &count) in labels.iter().zip(counts) {
        let length = (u128::from(count) * BAR as u128).div_ceil(u128::from(most));
        let length = usize::try_from(length).unwrap_or(BAR);
        writeln!(out, "  {label:>12} {:>10} {}", format::count(count), "#".repeat(length))?;
    }
    Ok(())
}
