//! The integration tests of the crate in one program, because linking it takes longer than compiling a test. Those
//! that count memory are in `bounds.rs`.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may panic")]

mod common;
mod compatibility;
mod compress;
mod lexi_golden;
#[path = "packed/main.rs"]
mod packed;
mod packed_golden;
#[path = "common/parts.rs"]
mod parts;
#[path = "ply/main.rs"]
mod ply;
mod stream;
mod stream_odd;
mod unsafe_audit;

#[test]
fn every_file_is_in_a_test_binary() {
    lexisplat_testing::assert_every_file_is_listed(
        concat!(env!("CARGO_MANIFEST_DIR"), "/tests"),
        &["all.rs", "bounds.rs"],
    );
}
