//! Models compressed in many ways, drawn, scored and tabulated: the paper's evaluation.

mod csv;
mod curve;
mod figures;
mod grid;
mod level;
mod notes;
mod page;
pub mod paper;
mod readme;
mod results;
mod survey;
pub mod table;
pub mod tables;
#[cfg(test)]
mod testing;
mod tidy;

pub use figures::{Figure, figures};
pub use level::level_off;
pub use notes::{NOTES, Note};
pub use page::{SweepPicture, sweep_html};
pub use readme::sweep_markdown;
pub use results::{Fps, Method, Point, Results, SceneResult, Setting, Skipped};
pub use survey::survey;
pub use tidy::tidy_csv;
