//! Models compressed in many ways, drawn, scored and tabulated: the paper's evaluation.

mod csv;
mod grid;
mod notes;
pub mod paper;
mod results;
mod survey;
pub mod table;
pub mod tables;
#[cfg(test)]
mod testing;
mod tidy;

pub use notes::{NOTES, Note};
pub use results::{Fps, Method, Point, Results, SceneResult, Setting, Skipped};
pub use survey::survey;
pub use tidy::tidy_csv;
