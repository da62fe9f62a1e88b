//! Codec for trained 3D Gaussian Splatting scenes.
//!
//! placeholder

mod codes;
mod compress;
mod dictionary;
mod error;
mod input;
pub mod learn;
pub mod lexi;
mod limits;
mod model;
pub mod output;
mod parallel;
pub mod ply;
mod progress;
pub mod pursuit;
mod rng;
pub mod sample;
pub mod sh;
mod splats;
pub mod stats;
mod stopwatch;

pub use codes::{Column, Escapes, Indices, Row, SparseCodes, Values, reconstruct};
pub use compress::{CompressOptions, CompressReport, DEFAULT_TOLERANCE, compress};
pub use dictionary::Dictionary;
pub use error::{Error, FormatError, Result};
pub use limits::{Limits, MAX_ATOMS};
pub use model::{Layout, Model, Pursuit, Record};
pub use progress::{Progress, Silent, Stage};
pub use sh::ShDegree;
pub use splats::{Extra, ExtraValues, Geometry, SceneMeta, Splats};
