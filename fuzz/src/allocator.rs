//! A bound on what a reader may allocate, by the allocator that the tests count with.

#[path = "../../crates/lexisplat/tests/common/allocator.rs"]
mod counting;

/// What `work` returns.
///
/// # Panics
/// If it held more than `per_byte` bytes for each of `input`, and `base`, at any time.
pub fn bounded<T>(input: &[u8], per_byte: usize, base: usize, work: impl FnOnce() -> T) -> T {
    let (result, used) = counting::counted(work);
    let allowed = input.len() * per_byte + base;
    assert!(used <= allowed, "{used} bytes allocated for an input of {}, {allowed} allowed", input.len());
    result
}
