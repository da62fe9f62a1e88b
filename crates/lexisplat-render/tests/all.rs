//! All integration tests of the crate in one program, because linking it takes longer than compiling a test.

#![expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::unwrap_used,
    reason = "tests: small numbers, and failing is their way to tell"
)]

#[cfg(feature = "gpu")]
mod adapter;
mod common;
#[cfg(feature = "gpu")]
mod cpu_parts;
#[cfg(feature = "gpu")]
mod gpu_broken;
#[cfg(feature = "gpu")]
mod gpu_parts;
#[cfg(feature = "gpu")]
mod gpu_pictures;
#[cfg(feature = "gpu")]
mod gpu_sensitivity;
#[cfg(feature = "gpu")]
mod gpu_sparse;
mod gradient;
mod made;
#[expect(clippy::cast_sign_loss, reason = "pixels are not negative")]
mod naive;
mod photos;
mod sensitivity;
mod sparse;
#[cfg(feature = "gpu")]
mod squared_error;
mod twin;
#[cfg(feature = "gpu")]
mod twins;
mod views;

#[test]
fn every_file_is_in_a_test_binary() {
    lexisplat_testing::assert_every_file_is_listed(
        concat!(env!("CARGO_MANIFEST_DIR"), "/tests"),
        &["all.rs"],
    );
}
