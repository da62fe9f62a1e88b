//! Evaluation of many models at many settings, as the paper has it: compressed, drawn, scored and tabulated.

mod cache;
mod compress_scene;
mod curve;
mod figures;
mod folder;
mod grid;
mod long_csv;
mod manifest;
mod markdown;
mod measure;
mod notes;
mod options;
mod page;
pub mod paper;
mod picture;
pub mod report;
mod results;
mod saturation;
mod scene;
mod survey;
mod sweep;
pub mod table;
pub mod tables;
#[cfg(test)]
mod testing;

pub use figures::{Figure, figures};
pub use folder::write_report;
pub use long_csv::long_csv;
pub use manifest::{Entry, parse_manifest, read_manifest};
pub use markdown::sweep_markdown;
pub use notes::{NOTES, Note};
pub use options::{SweepOptions, SweepProgress};
pub use page::sweep_html;
pub use picture::{Picture, PictureFiles, SweepPicture};
pub use results::{Fps, Method, Point, Results, SceneResult, Setting, Skipped};
pub use saturation::saturation;
pub use survey::survey;
pub use sweep::sweep;

/// `name`, or the first of `name-2`, `name-3` and so on that is not `taken`.
fn unique(name: &str, taken: impl Fn(&str) -> bool) -> String {
    let mut unique = name.to_owned();
    let mut copy = 2;
    while taken(&unique) {
        unique = format!("{name}-{copy}");
        copy += 1;
    }
    unique
}
