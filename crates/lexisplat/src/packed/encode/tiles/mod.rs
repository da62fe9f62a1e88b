//! Packing of scenes in parts that need not be in one process: the steps, and what passes from one to the next.
//!
//! A scene is one or more tiles, each a [`SplatSource`](crate::SplatSource). Tiles may overlap. The Gaussians of all tiles are
//! divided into *buckets* along the Morton curve, of about [`BUCKET`] each, so the file is about the same however the scene is cut
//! into tiles. Each bucket is looked at and coded on its own.
//!
//! | step | of each | takes | gives |
//! |---|---|---|---|
//! | [`Survey::of`] | block of [`BLOCK`] rows of a tile | the rows | number, bounds, some positions |
//! | [`Plan::new`] | scene | all surveys | the grid, and where buckets end |
//! | [`Plan::runs`] | block | the rows | which of them each bucket reads |
//! | [`Bucket::look`] | bucket | its Gaussians and their sensitivity | [`LookStatistics`], and [`Looked`] |
//! | [`Steps::new`] | scene | all statistics | steps of values |
//! | [`Sample::add`] | bucket of a group | its Gaussians, [`Looked`] | some of them, which stay where they are |
//! | [`Sample::statistics`] | group | the sample | [`SampleStatistics`] |
//! | [`Coding::new`] | scene | all statistics | the dictionary, and all else that buckets are coded with |
//! | [`Coding::code`] | bucket | its Gaussians, [`Looked`] | [`Counts`], and [`Coded`] |
//! | [`Tables::new`] | scene | all counts | one set of tables |
//! | [`Coded::with_tables`] | bucket | the tables | [`Coded`] with these tables |
//! | [`Assembly`] | file | all of these | the file |
//!
//! Statistics are sums. They are added in the order of blocks, buckets and groups, whoever found them first, so one process, many
//! threads and many machines make the same bytes. What passes between steps has `to_bytes` and `from_bytes`.
//! [`stream::pack`](crate::stream::pack) does all of it in one process.

mod assembly;
mod bucket;
mod coding;
mod look;
mod message;
mod plan;
mod sample;
mod steps;
mod survey;
#[cfg(test)]
mod tests;

pub use assembly::Assembly;
pub use bucket::{Bucket, BucketReader};
pub use coding::{Coded, Coding, Counts, Tables};
pub(crate) use look::SHOWN;
pub use look::{LookStatistics, Looked};
pub use plan::Plan;
pub use sample::{Sample, SampleStatistics};
pub use steps::Steps;
pub use survey::{BLOCK, Survey};

/// Approximate number of Gaussians of a bucket. Memory of a step that takes one is about 600 MB at SH degree 3.
pub const BUCKET: usize = 262_144;
