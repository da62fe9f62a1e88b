//! Evaluates many models at many settings, as the paper does: compresses, draws, scores and tabulates them.
//!
//! A manifest lists the models:
//!
//! ```
//! use std::path::Path;
//!
//! let text = r#"
//!     [[scene]]
//!     dataset = "Mip-NeRF 360"
//!     name = "bonsai"
//!     method = "3dgs"
//!     model = "3dgs/bonsai/point_cloud.ply"
//! "#;
//! let entries = lexisplat_sweep::parse_manifest(Path::new("scenes.toml"), text, Path::new("models"))?;
//! assert_eq!(entries[0].model, Path::new("models/3dgs/bonsai/point_cloud.ply"));
//! # Ok::<(), lexisplat_compress::Error>(())
//! ```
//!
//! Start with [`sweep`](fn@sweep), which evaluates such entries and returns [`Results`], and with [`write_report`], which writes
//! the tables, figures and the page of [`Results`]. docs/EVALUATION.md describes manifests and outputs.

mod cache;
mod compress_scene;
mod curve;
mod figures;
mod folder;
mod grid;
mod long_csv;
mod manifest;
mod measure;
mod numbers;
mod options;
mod page;
mod paper;
mod picture;
pub mod report;
mod results;
mod scene;
mod survey;
mod sweep;
mod table;
mod tables;
#[cfg(test)]
mod testing;

pub use folder::write_report;
pub use manifest::{Entry, parse_manifest, read_manifest};
pub use options::{SweepOptions, SweepProgress};
pub use picture::PictureFiles;
pub use results::{Fps, Method, Point, Results, SceneResult, Setting, Skipped};
pub use scene::{fingerprint, shown_path};
pub use sweep::sweep;

use lexisplat_eval::format::csv_cell;

use figures::Figure;

/// Returns `name`, or the first of `name-2`, `name-3` and so on that is not `taken`.
fn unique(name: &str, taken: impl Fn(&str) -> bool) -> String {
    let mut unique = name.to_owned();
    let mut copy = 2;
    while taken(&unique) {
        unique = format!("{name}-{copy}");
        copy += 1;
    }
    unique
}

/// Returns records as CSV (RFC 4180, with line feeds). A text that a spreadsheet would take for a formula gets a `'`
/// before it.
fn csv_text(records: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut writer = csv::WriterBuilder::new().flexible(true).from_writer(Vec::new());
    for record in records {
        // Writing to memory cannot fail.
        let _ = writer.write_record(record.iter().map(|cell| csv_cell(cell).into_owned()));
    }
    String::from_utf8_lossy(&writer.into_inner().unwrap_or_default()).into_owned()
}
