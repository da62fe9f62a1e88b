//! Numbers of all lanes side by side.

/// Largest number of lanes: runs of Gaussians of a chunk that are coded side by side, each with a state of its own. A
/// symbol of a lane depends on the one before it, so only many lanes keep a CPU busy. Two vector registers of 256 bits hold
/// a number of each lane.
pub(in crate::packed) const LANES: usize = 16;

/// One number of each lane. Numbers of lanes that are not in use have no meaning.
pub(in crate::packed) type Lanes<T = i32> = [T; LANES];

/// Returns `of(l)` for each lane `l`. This function is always inlined into vector code; the methods of arrays are not.
#[inline(always)]
pub(in crate::packed) fn each<T: Copy + Default>(of: impl Fn(usize) -> T) -> Lanes<T> {
    let mut out = [T::default(); LANES];
    for (l, out) in out.iter_mut().enumerate() {
        *out = of(l);
    }
    out
}

/// Returns whether `lane` is in `set`.
#[inline(always)]
pub(in crate::packed) fn has(set: u32, lane: usize) -> bool {
    set & 1 << lane != 0
}
