//! What the tests of all crates share: how a test says that it cannot run, the real models, random numbers.
//!
//! A test that lacks something calls [`missing`] and returns. The test then counts as passed, because Rust's test
//! harness cannot skip a test that has begun. [`missing`] therefore prints a line that the harness does not hide, and
//! `.ci/run` lists all such lines at its end. Where [`REQUIRE`] names what is missing, the test fails instead.

mod listed;
mod missing;
mod random;

pub use listed::assert_every_file_is_listed;
pub use missing::{Need, REQUIRE, SKIPPED, missing, real_data, real_data_folder, repository_file};
pub use random::Random;
