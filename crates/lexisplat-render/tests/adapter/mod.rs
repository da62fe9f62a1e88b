//! The GPU that tests draw with.
#![allow(dead_code, reason = "each test file uses a part")]

use std::sync::OnceLock;

use lexisplat_render::Device;
use lexisplat_render::gpu::Gpu;
use lexisplat_testing::{Need, missing};

/// The machine's best adapter, open once for all tests. `None`, and the running test is skipped, if there is none.
///
/// # Panics
/// If it is required and there is none.
pub(crate) fn gpu() -> Option<Gpu> {
    static GPU: OnceLock<Result<Gpu, String>> = OnceLock::new();
    let gpu = GPU.get_or_init(|| best().map_err(|error| error.to_string()));
    found(gpu.clone())
}

/// Opens the machine's best adapter.
pub(crate) fn best() -> lexisplat_render::Result<Gpu> {
    // It gives `None` for the processor only.
    Device::Gpu.open_gpu().map(Option::unwrap)
}

/// The adapter that was opened. `None`, and the running test is skipped, if there is none.
///
/// # Panics
/// As [`gpu`].
pub(crate) fn opened(gpu: lexisplat_render::Result<Gpu>) -> Option<Gpu> {
    found(gpu.map_err(|error| error.to_string()))
}

fn found(gpu: Result<Gpu, String>) -> Option<Gpu> {
    gpu.inspect_err(|error| missing(Need::Gpu, error)).ok()
}
