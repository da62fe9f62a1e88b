//! Numbers that kernels and host share. They are defined here or in `conventions`, and are inserted before the text of
//! every kernel.

use std::fmt::Write as _;

use lexisplat::sh::{C0, C1, C2, C3, C4, COLOUR_OFFSET, MAX_COEFFICIENTS};

use crate::conventions::{
    ALPHA_MAX, ALPHA_MIN, ANTIALIAS_FLOOR, DILATION, EIGEN_FLOOR, NEAR_Z, POWER_SLACK, QUATERNION_FLOOR,
    RADIUS_SIGMAS, TAN_LIMIT, TILE, TRANSMITTANCE_MIN, W_EPSILON,
};
use crate::cpu::SUMS;

/// Number of lanes of a workgroup, and of Gaussians of a block. Every adapter supports as many (WebGPU's
/// `maxComputeInvocationsPerWorkgroup`).
pub(super) const GROUP: u32 = 256;
/// Largest number of workgroups in one dimension of a dispatch (WebGPU's `maxComputeWorkgroupsPerDimension`).
pub(super) const MAX_GROUPS: u32 = 65_535;
/// Number of values that a lane adds up in a scan.
const SCAN_ITEMS: u32 = 8;
/// Number of values that a workgroup scans.
pub(super) const SCAN_BLOCK: u32 = GROUP * SCAN_ITEMS;
/// Number of bits of a key that one pass sorts by.
pub(super) const DIGIT_BITS: u32 = 4;
/// Number of values of a digit.
pub(super) const DIGITS: u32 = 1 << DIGIT_BITS;
/// Number of keys that a lane sorts. With [`GROUP`] lanes counts fit in 16 bits.
const SORT_ITEMS: u32 = 8;
/// Number of keys that a workgroup sorts.
pub(super) const SORT_BLOCK: u32 = GROUP * SORT_ITEMS;
/// Number of splats whose moments a workgroup sums together.
const MOMENT_SPLATS: u32 = 4;
/// Number of splats that a workgroup reads at once to sum moments. With the sums they just fit in workgroup memory.
const MOMENT_BATCH: u32 = 64;
/// Number of Gaussians whose codes share one stored offset.
pub(super) const COLUMN_GROUP: u32 = 16;
/// Number of words for such a group: the offset, and a byte for each Gaussian.
pub(super) const COLUMN_WORDS: u32 = 1 + COLUMN_GROUP / 4;
/// Value of the byte of a Gaussian that is stored exactly. Other bytes are counts, which are at most 72.
pub(super) const ESCAPED: u32 = 0x80;
/// Number of bins for counts of nonzeros: a power of two above the largest count, 72.
const COUNT_BINS: u32 = 128;
/// Number of texels along a side of a face of the table of atom radiance. Tests of `gpu::radiance_table` measure the
/// error.
pub(super) const TABLE_SIDE: u32 = 32;
/// Relative slack of the coarse test in `cull`, far above its rounding errors.
const CULL_SLACK: f32 = 1e-3;
/// Relative slack of an ellipse's extent in the choice of tiles, far above its rounding errors.
const REACH_SLACK: f32 = 1e-3;
/// Absolute slack of an ellipse's extent in the choice of tiles, in pixels.
const REACH_MARGIN: f32 = 0.05;
/// Number of pixels that a lane compares.
pub(super) const ERROR_PIXELS: u32 = 16;
/// Number of rounds in one measurement of arithmetic.
pub(super) const MULTIPLY_ADDS: u32 = 1024;
/// Largest number that does not count as an overflow.
const FAR_LIMIT: f32 = 3e38;

/// Value of a colour that overflows. Other colours are not negative.
const NO_COLOUR: f32 = -1.0;

/// Numbers that the GPU counts. Their values are indices in the buffer of counters.
#[derive(Debug, Clone, Copy)]
pub(super) enum Counter {
    /// Number of Gaussians that may be visible. If each band searches for its own Gaussians: that number in the fullest
    /// band.
    Found,
    /// Number of Gaussians that have slots, at most what the buffers hold.
    Slots,
    /// The number [`Self::Slots`] plus one.
    SlotsAndEnd,
    /// Number of blocks in which slots are sorted.
    SlotBlocks,
    /// Number of values in the histogram of the sort of slots.
    SlotDigits,
    /// Number of entries in the tile lists of the band, at most what the buffers hold.
    Entries,
    /// Number of blocks in which entries are sorted.
    EntryBlocks,
    /// Number of values in the histogram of the sort of entries.
    EntryDigits,
    /// Number of entries of the fullest band, which may be more than the buffers hold.
    EntriesMost,
    /// Number of entries of all bands together.
    EntriesAll,
}

/// Number of words of the buffer of counters.
pub(super) const COUNTERS: usize = 16;

/// Dispatches whose sizes the GPU computes. Their values are indices in the buffer of their arguments.
#[derive(Debug, Clone, Copy)]
pub(super) enum Dispatch {
    /// A lane for each slot, and one more lane.
    SlotsAndEnd,
    /// Groups that sort slots.
    SlotBlocks,
    /// Groups that scan the histogram of the sort of slots.
    SlotDigits,
    /// Groups that scan one number for each slot.
    SlotScan,
    /// A lane for each entry.
    Entries,
    /// Groups that sort entries.
    EntryBlocks,
    /// Groups that scan the histogram of the sort of entries.
    EntryDigits,
    /// A lane for each slot of the first chunk. The dispatches of the other chunks follow.
    Chunks,
}

/// Returns WGSL declarations of all numbers above and of the conventions.
pub(super) fn declarations() -> String {
    let mut out = String::new();
    let mut line = |text: String| {
        out.push_str(&text);
        out.push('\n');
    };
    let tile = u32::try_from(TILE).unwrap_or(u32::MAX);
    let basis = u32::try_from(MAX_COEFFICIENTS - 1).unwrap_or(u32::MAX);
    let sums = u32::try_from(SUMS).unwrap_or(u32::MAX);
    let segments = GROUP / (DIGITS / 2);
    for (name, value) in [
        ("GROUP", GROUP),
        ("MAX_GROUPS", MAX_GROUPS),
        ("MASK_WORDS", GROUP / u32::BITS),
        ("TILE", tile),
        ("SCAN_ITEMS", SCAN_ITEMS),
        ("SCAN_BLOCK", SCAN_BLOCK),
        ("DIGITS", DIGITS),
        ("DIGIT_PAIRS", DIGITS / 2),
        ("SEGMENTS", segments),
        ("SEGMENT", GROUP / segments),
        ("SORT_ITEMS", SORT_ITEMS),
        ("SORT_BLOCK", SORT_BLOCK),
        ("COLUMN_GROUP", COLUMN_GROUP),
        ("COLUMN_WORDS", COLUMN_WORDS),
        ("ESCAPED", ESCAPED),
        ("COUNT_BINS", COUNT_BINS),
        ("TABLE_SIDE", TABLE_SIDE),
        ("MOMENT_SUMS", sums),
        // The number of sums, and one for the maximum.
        ("MOMENTS", sums + 1),
        ("MOMENT_SPLATS", MOMENT_SPLATS),
        ("MOMENT_BATCH", MOMENT_BATCH),
        ("KEY_LAST", u32::MAX),
        ("NO_SLOT", u32::MAX),
        ("MAX_BASIS", basis),
        ("MULTIPLY_ADDS", MULTIPLY_ADDS),
        ("ERROR_PIXELS", ERROR_PIXELS),
        ("COUNTER_FOUND", Counter::Found as u32),
        ("COUNTER_SLOTS", Counter::Slots as u32),
        ("COUNTER_SLOTS_AND_END", Counter::SlotsAndEnd as u32),
        ("COUNTER_SLOT_BLOCKS", Counter::SlotBlocks as u32),
        ("COUNTER_SLOT_DIGITS", Counter::SlotDigits as u32),
        ("COUNTER_ENTRIES", Counter::Entries as u32),
        ("COUNTER_ENTRY_BLOCKS", Counter::EntryBlocks as u32),
        ("COUNTER_ENTRY_DIGITS", Counter::EntryDigits as u32),
        ("COUNTER_ENTRIES_MOST", Counter::EntriesMost as u32),
        ("COUNTER_ENTRIES_ALL", Counter::EntriesAll as u32),
        ("DISPATCH_SLOTS_AND_END", Dispatch::SlotsAndEnd as u32),
        ("DISPATCH_SLOT_BLOCKS", Dispatch::SlotBlocks as u32),
        ("DISPATCH_SLOT_DIGITS", Dispatch::SlotDigits as u32),
        ("DISPATCH_SLOT_SCAN", Dispatch::SlotScan as u32),
        ("DISPATCH_ENTRIES", Dispatch::Entries as u32),
        ("DISPATCH_ENTRY_BLOCKS", Dispatch::EntryBlocks as u32),
        ("DISPATCH_ENTRY_DIGITS", Dispatch::EntryDigits as u32),
        ("DISPATCH_CHUNKS", Dispatch::Chunks as u32),
    ] {
        line(format!("const {name}: u32 = {value}u;"));
    }
    for (name, value) in [
        ("NEAR_Z", NEAR_Z),
        ("W_EPSILON", W_EPSILON),
        ("TAN_LIMIT", TAN_LIMIT),
        ("DILATION", DILATION),
        ("EIGEN_FLOOR", EIGEN_FLOOR),
        ("RADIUS_SIGMAS", RADIUS_SIGMAS),
        ("ALPHA_MAX", ALPHA_MAX),
        ("ALPHA_MIN", ALPHA_MIN),
        ("TRANSMITTANCE_MIN", TRANSMITTANCE_MIN),
        ("ANTIALIAS_FLOOR", ANTIALIAS_FLOOR),
        ("QUATERNION_FLOOR", QUATERNION_FLOOR),
        ("POWER_SLACK", POWER_SLACK),
        ("CULL_SLACK", CULL_SLACK),
        ("REACH_SLACK", REACH_SLACK),
        ("REACH_MARGIN", REACH_MARGIN),
        ("FAR_LIMIT", FAR_LIMIT),
        ("NO_COLOUR", NO_COLOUR),
        ("COLOUR_OFFSET", COLOUR_OFFSET),
        ("SH_C0", C0),
        ("SH_C1", C1),
    ] {
        line(format!("const {name}: f32 = {value:?}f;"));
    }
    for (name, values) in [("SH_C2", &C2[..]), ("SH_C3", &C3[..]), ("SH_C4", &C4[..])] {
        for (k, value) in values.iter().enumerate() {
            line(format!("const {name}_{k}: f32 = {value:?}f;"));
        }
    }
    out
}

/// Number of coefficients of three channels each that three vectors of four floats hold.
const QUAD: usize = 4;

/// Returns the number of vectors of four floats that hold `coefficients` of three channels each.
pub(super) fn vectors(coefficients: usize) -> usize {
    3 * coefficients.div_ceil(QUAD)
}

/// Returns statements that read `coefficients` coefficients of three channels from vectors of four floats. `load` makes
/// an expression from the index of a vector. `each` makes a statement from the number and the expression of a
/// coefficient.
fn for_each_coefficient(
    coefficients: usize,
    load: impl Fn(usize) -> String,
    each: impl Fn(usize, &str) -> String,
) -> String {
    let mut out = String::new();
    for group in 0..coefficients.div_ceil(QUAD) {
        let [a, b, c] = [3 * group, 3 * group + 1, 3 * group + 2];
        for v in [a, b, c] {
            // Writing to a `String` does not fail.
            let _ = writeln!(out, "let v{v} = {};", load(v));
        }
        let expressions = [
            format!("v{a}.xyz"),
            format!("vec3<f32>(v{a}.w, v{b}.xy)"),
            format!("vec3<f32>(v{b}.zw, v{c}.x)"),
            format!("v{c}.yzw"),
        ];
        for (expression, k) in expressions.iter().zip(QUAD * group..coefficients) {
            let _ = writeln!(out, "{}", each(k, expression));
        }
    }
    out
}

/// Returns statements that read `dc` from a dense row, and add the products of the other coefficients with the basis to
/// `rest`.
pub(super) fn dense_terms(per_channel: usize, load: impl Fn(usize) -> String) -> String {
    for_each_coefficient(per_channel + 1, load, |k, coefficient| match k {
        0 => format!("let dc = {coefficient};"),
        _ => format!("rest += b[{}] * {coefficient};", k - 1),
    })
}

/// Returns statements that add the products of the atom at `atoms[at]` with the basis to `sum`.
pub(super) fn atom_terms(per_channel: usize) -> String {
    if per_channel == 0 {
        // The array is bound at degree 0 too, and a kernel must use everything that is bound.
        return "_ = atoms[at];".to_owned();
    }
    let load = |v: usize| format!("atoms[at + {v}u]");
    for_each_coefficient(per_channel, load, |k, coefficient| format!("sum += b[{k}] * {coefficient};"))
}

/// Returns the statements of [`atom_terms`] for a row whose floats are read by `load`.
pub(super) fn float_terms(per_channel: usize, load: impl Fn(usize) -> String) -> String {
    let mut out = String::new();
    for k in 0..per_channel {
        let [r, g, b] = [3 * k, 3 * k + 1, 3 * k + 2].map(&load);
        let _ = writeln!(out, "sum += b[{k}] * vec3<f32>({r}, {g}, {b});");
    }
    out
}
