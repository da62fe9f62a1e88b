//! Models compressed in many ways, drawn, scored and tabulated: the paper's evaluation.

mod results;

pub use results::{Fps, Method, Point, Results, SceneResult, Setting, Skipped};
