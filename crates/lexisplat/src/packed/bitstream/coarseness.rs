//! The coarseness of values while refinements are missing.

/// Largest number of refinements.
pub(in crate::packed) const MAX_REFINEMENTS: usize = 2;
/// Number of bits that codes of rotations lack, by the number of missing refinements.
pub(in crate::packed) const DROPPED: [u32; MAX_REFINEMENTS + 1] = [0, 2, 3];
/// Ratio of steps before and after one refinement.
pub(in crate::packed) const FACTOR: i32 = 3;

/// The refinements of a chunk.
#[derive(Debug, Clone, Copy)]
pub(in crate::packed) struct Refinements {
    /// How many refinements the layer of the chunk has.
    pub(in crate::packed) all: usize,
    /// How many of them are missing.
    pub(in crate::packed) missing: usize,
}

/// Returns the ratio of coarse steps to the finest ones, if `missing` refinements are missing.
pub(in crate::packed) fn factor(missing: usize) -> i32 {
    FACTOR.pow(missing as u32)
}

/// Returns the number of bits that a code of `bits` bits lacks, if `missing` refinements are missing. At least one bit
/// stays, so that every Gaussian takes bits.
#[inline(always)]
pub(in crate::packed) fn dropped(bits: u32, missing: usize) -> u32 {
    DROPPED[missing].min(bits.saturating_sub(1))
}
