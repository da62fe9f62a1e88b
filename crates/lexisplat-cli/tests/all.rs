//! All integration tests of the program in one test binary, because linking it takes longer than compiling a test.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod budget;
mod cli;
mod convert;
mod demo;
mod determinism;
mod eval;
mod first;
mod first_view;
mod folder;
mod gpu;
mod html;
#[cfg(target_os = "linux")]
#[path = "interruption/main.rs"]
mod interruption;
mod limits;
mod memory;
mod misuse;
mod packed;
mod printed;
mod standard_error;
#[cfg(feature = "view")]
mod view;

#[test]
fn every_file_is_in_a_test_binary() {
    lexisplat_testing::assert_every_file_is_listed(
        concat!(env!("CARGO_MANIFEST_DIR"), "/tests"),
        &["all.rs"],
    );
}
