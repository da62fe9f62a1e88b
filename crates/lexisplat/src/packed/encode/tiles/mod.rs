//! Packing of a scene in steps that separate processes can take, and the messages that pass between the steps.
//!
//! A scene is one or more tiles, each a [`SplatSource`](crate::SplatSource). Tiles may overlap. The Gaussians of all tiles
//! are divided into *buckets* along the Morton curve, of about [`BUCKET`] Gaussians each. So the file is about the same
//! however the scene is cut into tiles. Each bucket is measured and coded on its own.
//!
//! | step | runs once for each | takes | gives |
//! |---|---|---|---|
//! | [`Survey::of`] | block of [`BLOCK`] rows of a tile | the rows | number, bounds, some positions |
//! | [`Plan::new`] | scene | all surveys | the grid, and the ends of buckets |
//! | [`Plan::runs`] | block | the rows | the rows that each bucket reads |
//! | [`Bucket::look`] | bucket | its Gaussians and their sensitivity | [`LookStatistics`], and [`Looked`] |
//! | [`Steps::new`] | scene | all [`LookStatistics`] | steps of values |
//! | [`Sample::add`] | bucket of a group | its Gaussians, [`Looked`] | a sample, which stays in the process |
//! | [`Sample::statistics`] | group | the sample | [`SampleStatistics`] |
//! | [`Coding::new`] | scene | all [`SampleStatistics`] | the dictionary, and all other parameters of the coding of buckets |
//! | [`Coding::code`] | bucket | its Gaussians, [`Looked`] | [`Counts`], and [`Coded`] |
//! | [`Tables::new`] | scene | all [`Counts`] | one set of tables |
//! | [`Coded::with_tables`] | bucket | the tables | [`Coded`] with these tables |
//! | [`Assembly`] | file | all of these | the file |
//!
//! Statistics are sums. They are added in the order of blocks, buckets and groups, which need not be the order in which
//! they were computed. So one process, many threads and many machines make the same bytes. Every type that passes between
//! steps has `to_bytes` and `from_bytes`. [`stream::pack`](crate::stream::pack) takes all steps in one process.

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

pub use assembly::{Assembly, PackedFile};
pub use bucket::{Bucket, BucketReader};
pub use coding::{Coded, Coding, Counts, Tables};
#[cfg(test)]
pub(crate) use look::SHOWN;
pub use look::{LookStatistics, Looked};
pub use plan::Plan;
pub use sample::{Sample, SampleStatistics};
pub use steps::Steps;
pub(in crate::packed) use survey::surveyed;
pub use survey::{BLOCK, Survey};

/// Approximate number of Gaussians of a bucket. A step that takes one bucket needs about 600 MB of memory at SH degree 3.
pub const BUCKET: usize = 262_144;
