//! The GPU that tests draw with.

use std::sync::OnceLock;

use lexisplat_render::gpu::{Gpu, GpuChoice};

/// Set where GPU tests may not be skipped.
const REQUIRE: &str = "LEXISPLAT_REQUIRE_GPU";

/// The machine's best adapter, open once for all tests; none where there is none, unless it is required.
///
/// # Panics
/// If it is required and there is none.
pub(crate) fn gpu() -> Option<Gpu> {
    static GPU: OnceLock<Option<Gpu>> = OnceLock::new();
    GPU.get_or_init(|| opened(Gpu::open(GpuChoice::Best))).clone()
}

/// What was opened, if anything.
///
/// # Panics
/// As [`gpu`].
pub(crate) fn opened(gpu: lexisplat_render::Result<Gpu>) -> Option<Gpu> {
    match gpu {
        Ok(gpu) => Some(gpu),
        Err(error) if std::env::var_os(REQUIRE).is_some() => {
            panic!("{REQUIRE} is set, but {error}")
        }
        Err(error) => {
            eprintln!("skipped: {error}");
            None
        }
    }
}
