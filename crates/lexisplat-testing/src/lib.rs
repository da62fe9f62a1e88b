//! Helpers that the tests of all crates share: skipped tests, the real models, and random numbers.
//!
//! ```
//! let mut random = lexisplat_testing::Random::new(7);
//! assert!(random.below(10) < 10);
//! ```
//!
//! A test that lacks something, such as a GPU, calls [`missing`] and returns. The test then counts as passed, because Rust's test
//! harness cannot skip a test that has begun. [`missing`] therefore prints a line that the harness does not hide, and `.ci/run`
//! lists all such lines at its end. If [`REQUIRE`] names what is missing, the test fails instead.

mod listed;
mod missing;
mod random;

pub use listed::assert_every_file_is_listed;
pub use missing::{Need, REQUIRE, SKIPPED, missing, real_data, real_data_folder, repository_file};
pub use random::Random;
