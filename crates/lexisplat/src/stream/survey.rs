//! Statistics of a file, a part at a time.

use std::path::Path;

use super::each_part;
use super::source_order::parts_and_source_order;
use crate::formats::lexi::LexiReader;
use crate::packed::StreamBits;
use crate::scene::source::SplatSource;
use crate::scene::stats::{Lint, Linter};
use crate::sparse::codes::SparseCodes;
use crate::support::error::Result;
use crate::support::progress::{Progress, Stage};

/// Statistics of the Gaussians and the codes of a .lexi file.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Survey {
    /// Statistics of the dense scene.
    pub lint: Lint,
    /// Number of nonzeros of all Gaussians.
    pub nonzeros: u64,
    /// Number of Gaussians whose SH-rest is stored exactly.
    pub escapes: u64,
    /// Number of Gaussians by their number of nonzeros, from 0 to the dimension. Escapes are not counted.
    pub nonzero_histogram: Vec<u64>,
    /// Number of Gaussians that use each atom.
    pub atom_usage: Vec<u64>,
    /// Number of bytes that all SH take in memory; see [`Model::resident_sh_bytes`](crate::Model::resident_sh_bytes).
    pub resident_sh_bytes: u64,
    /// Number of bits of each stream of a packed file; empty for other layouts.
    pub stream_bits: Vec<StreamBits>,
}

/// Computes [`lint`](crate::scene::stats::lint()) of a scene that is read a part at a time.
///
/// # Errors
/// As [`SplatSource::read`], and [`crate::Error::Cancelled`].
pub fn lint(source: &dyn SplatSource, progress: &dyn Progress) -> Result<Lint> {
    let mut linter = Linter::default();
    let mut splats = source.empty();
    linter.add(&splats)?;
    progress.begin(Stage::Read, source.len() as u64 * source.row_bytes());
    each_part(source, 0..source.len(), &mut splats, progress, &mut |_, splats| linter.add(splats))?;
    progress.end();
    Ok(linter.finish())
}

/// Decodes a .lexi file and computes its statistics. Temporary files, if any are needed, are in `folder`.
///
/// # Errors
/// As [`in_source_order`](super::in_source_order).
pub fn survey(lexi: &LexiReader<'_>, folder: &Path) -> Result<Survey> {
    let mut linter = Linter::default();
    linter.add(&lexi.empty())?;
    let dictionary = lexi.dictionary();
    let mut out = Survey {
        lint: Linter::default().finish(),
        nonzeros: 0,
        escapes: 0,
        nonzero_histogram: vec![0; dictionary.dim() + 1],
        atom_usage: vec![0; dictionary.len()],
        resident_sh_bytes: (dictionary.len() * dictionary.dim() * size_of::<f32>()
            + SparseCodes::checkpoint_bytes(lexi.len())) as u64,
        stream_bits: Vec::new(),
    };
    let stream_bits = parts_and_source_order(
        lexi,
        folder,
        true,
        &mut |model| {
            let codes = model.codes();
            let escapes = codes.escapes().gaussians.len() as u64;
            out.escapes += escapes;
            out.nonzeros += codes.nonzeros() as u64;
            codes.counts().iter().for_each(|&count| out.nonzero_histogram[usize::from(count)] += 1);
            out.nonzero_histogram[0] -= escapes;
            (0..codes.nonzeros()).for_each(|k| out.atom_usage[codes.indices().get(k)] += 1);
            let base = size_of_val(model.geometry().dc.as_slice());
            // A part may end between two checkpoints, so those of the whole scene are counted above.
            let checkpoints = SparseCodes::checkpoint_bytes(model.len());
            out.resident_sh_bytes += (codes.resident_bytes() - checkpoints + base) as u64;
        },
        &mut |splats| linter.add(&splats),
    )?;
    Ok(Survey { lint: linter.finish(), stream_bits, ..out })
}
