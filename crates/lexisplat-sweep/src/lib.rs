//! Models compressed in many ways, drawn, scored and tabulated: the paper's evaluation.

mod csv;
mod curve;
mod figures;
mod folder;
mod grid;
mod kept;
mod level;
mod manifest;
mod notes;
mod options;
mod page;
pub mod paper;
mod readme;
pub mod report;
mod results;
mod run;
mod runner;
mod squeeze;
mod survey;
pub mod table;
pub mod tables;
#[cfg(test)]
mod testing;
mod tidy;

pub use figures::{Figure, figures};
pub use folder::write_report;
pub use level::level_off;
pub use manifest::{Entry, parse_manifest, read_manifest};
pub use notes::{NOTES, Note};
pub use options::{SweepOptions, Watch};
pub use page::{SweepPicture, sweep_html};
pub use readme::sweep_markdown;
pub use results::{Fps, Method, Point, Results, SceneResult, Setting, Skipped};
pub use run::{Saved, sweep};
pub use survey::survey;
pub use tidy::tidy_csv;
