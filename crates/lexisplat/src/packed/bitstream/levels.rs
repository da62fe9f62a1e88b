//! Refinements: how many there are, and what values lack without them.

/// Largest number of refinements.
pub(in crate::packed) const MAX_LEVELS: usize = 2;
/// Number of bits that codes of rotations lack, by the number of missing refinements.
pub(in crate::packed) const DROPPED: [u32; MAX_LEVELS + 1] = [0, 2, 3];
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

/// Returns the ratio of coarse steps to the finest ones, if `levels` refinements are missing.
pub(in crate::packed) fn factor(levels: usize) -> i32 {
    FACTOR.pow(levels as u32)
}

/// Returns the number of bits that a code of `bits` bits lacks, if `levels` refinements are missing. At least one bit
/// stays, so that every Gaussian takes bits.
#[inline(always)]
pub(in crate::packed) fn dropped(bits: u32, levels: usize) -> u32 {
    DROPPED[levels].min(bits.saturating_sub(1))
}
