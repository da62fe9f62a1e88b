//! Parts that the fuzz targets share: a memory bound, limits as a product sets them, mutations of .lexi files
//! whose checksums fit, and rules for everything that was read.

#[allow(dead_code, reason = "the tests of the codec use more of it")]
pub mod allocator;
pub mod container;
pub mod formats;
pub mod invariants;
pub mod made;
pub mod parts;

use lexisplat::Limits;

/// Returns the limits of a careful product for files of unknown origin.
#[must_use]
pub fn limits() -> Limits {
    let mut limits = Limits::default();
    limits.gaussians = 1 << 20;
    limits.header_bytes = 1 << 20;
    limits.properties = 512;
    limits
}

/// Makes the calling thread the only worker: no hand-over for every small loop, and results that repeat.
pub fn one_thread() {
    // An error says that there is a pool already, which is then this one.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
}
