//! A bound on what a reader may allocate, by the allocator that the tests count with.

#[path = "../../crates/lexisplat/tests/common/allocator.rs"]
mod counting;

/// Bytes that a packed file is allowed for each of its bytes, as derived in `crates/lexisplat/tests/packed_mutation/main.rs`.
pub const PACKED_PER_BYTE: usize = 542;
/// Tables and dictionary of a packed file, and what is rounded up: as there.
pub const PACKED_HEAD: usize =
    (58 * 24 * (4 << 10) + 3 * 24 * (16 << 10)) * 2 + 61 * 24 * (256 * 16 + 64) + (64 << 10);

/// Returns the result of `work`.
///
/// # Panics
/// If it held more than `per_byte` bytes for each of `input`, and `base`, at any time.
pub fn bounded<T>(input: &[u8], per_byte: usize, base: usize, work: impl FnOnce() -> T) -> T {
    let (result, used) = counting::counted(work);
    let allowed = input.len() * per_byte + base;
    assert!(used <= allowed, "{used} bytes allocated for an input of {}, {allowed} allowed", input.len());
    result
}
