//! Numbers that kernels and host share: written down here or in `conventions`, and put in front of every
//! kernel's text.

use std::fmt::Write as _;

use lexisplat::sh::{C0, C1, C2, C3, C4, COLOUR_OFFSET, MAX_COEFFICIENTS};

use crate::conventions::{
    ALPHA_MAX, ALPHA_MIN, ANTIALIAS_FLOOR, DILATION, EIGEN_FLOOR, NEAR_Z, POWER_SLACK, QUATERNION_FLOOR,
    RADIUS_SIGMAS, TAN_LIMIT, TILE, TRANSMITTANCE_MIN, W_EPSILON,
};
use crate::cpu::SUMS;

/// Lanes of a group, and Gaussians of a block: what every adapter offers (WebGPU's
/// `maxComputeInvocationsPerWorkgroup`).
pub(super) const GROUP: u32 = 256;
/// Groups in one dimension of a dispatch (WebGPU's `maxComputeWorkgroupsPerDimension`).
pub(super) const MAX_GROUPS: u32 = 65_535;
/// Numbers a lane adds up in a scan.
const SCAN_ITEMS: u32 = 8;
/// Numbers a group scans.
pub(super) const SCAN_BLOCK: u32 = GROUP * SCAN_ITEMS;
/// Bits of a key sorted in one pass.
pub(super) const DIGIT_BITS: u32 = 4;
/// Values of a digit.
pub(super) const DIGITS: u32 = 1 << DIGIT_BITS;
/// Keys a lane sorts. With [`GROUP`] lanes, counts fit in 16 bits.
const SORT_ITEMS: u32 = 8;
/// Keys a group sorts.
pub(super) const SORT_BLOCK: u32 = GROUP * SORT_ITEMS;
/// Splats whose moments a group sums together.
const MOMENT_SPLATS: u32 = 4;
/// Splats it reads at once. With the sums this just fits in workgroup memory.
const MOMENT_BATCH: u32 = 64;
/// Gaussians whose codes begin at a stored place.
pub(super) const COLUMN_GROUP: u32 = 16;
/// Words for them: the place, and a byte each.
pub(super) const COLUMN_WORDS: u32 = 1 + COLUMN_GROUP / 4;
/// In the byte of a Gaussian: it is stored exactly. Counts are at most 72.
pub(super) const ESCAPED: u32 = 0x80;
/// Bins for counts of nonzeros, which are at most 72: a power of two.
const COUNT_BINS: u32 = 128;
/// Texels along a side of a face of the table of atom radiance. `gpu::table` measures the error.
pub(super) const TABLE_SIDE: u32 = 32;
/// The depth key of a Gaussian at the near limit; keys are bits of z above it.
pub(super) const KEY_FIRST: u32 = NEAR_Z.to_bits();
/// Relative slack of the coarse test in `cull`, far above its rounding errors.
const CULL_SLACK: f32 = 1e-3;
/// Relative slack of an ellipse's extent when tiles are chosen, far above its rounding errors.
const REACH_SLACK: f32 = 1e-3;
/// The same in pixels.
const REACH_MARGIN: f32 = 0.05;
/// Rounds of a measurement of arithmetic.
pub(super) const MULTIPLY_ADDS: u32 = 1024;
/// Numbers beyond this count as overflown.
const FAR_LIMIT: f32 = 3e38;

/// Stands for a colour that overflows; others are not negative.
const NO_COLOUR: f32 = -1.0;

/// What the GPU counts. Places in the buffer of counters.
#[derive(Debug, Clone, Copy)]
pub(super) enum Counter {
    /// Gaussians that may be seen, of the fullest band if bands see for themselves.
    Found,
    /// Those that have slots: all, but for room.
    Slots,
    /// One more.
    SlotsAndEnd,
    /// Blocks in which they are sorted.
    SlotBlocks,
    /// Numbers in the sort's histogram.
    SlotDigits,
    /// Entries of the band's tile lists that have room.
    Entries,
    /// Blocks in which they are sorted.
    EntryBlocks,
    /// Numbers in the sort's histogram.
    EntryDigits,
    /// Entries of the fullest band, room or not.
    EntriesMost,
    /// Entries of all bands.
    EntriesAll,
}

/// Number of counters.
pub(super) const COUNTERS: usize = 16;

/// Dispatches whose sizes the GPU works out. Places in the buffer of their arguments.
#[derive(Debug, Clone, Copy)]
pub(super) enum Dispatch {
    /// Lanes for every slot and one more.
    SlotsAndEnd,
    /// Groups that sort slots.
    SlotBlocks,
    /// Groups that scan that sort's histogram.
    SlotDigits,
    /// Groups that scan numbers of slots.
    SlotScan,
    /// Lanes for every entry.
    Entries,
    /// Groups that sort entries.
    EntryBlocks,
    /// Groups that scan that sort's histogram.
    EntryDigits,
    /// Lanes for the slots of the first chunk; those of the others follow.
    Chunks,
}

/// Declarations of everything above and of the conventions, in WGSL.
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
        // And a maximum.
        ("MOMENTS", sums + 1),
        ("MOMENT_SPLATS", MOMENT_SPLATS),
        ("MOMENT_BATCH", MOMENT_BATCH),
        ("KEY_FIRST", KEY_FIRST),
        ("KEY_LAST", u32::MAX),
        ("NO_SLOT", u32::MAX),
        ("MAX_BASIS", basis),
        ("MULTIPLY_ADDS", MULTIPLY_ADDS),
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

/// Coefficients of three channels in three vectors of four floats.
const QUAD: usize = 4;

/// Vectors of four floats that hold `coefficients` of three channels each.
pub(super) fn vectors(coefficients: usize) -> usize {
    3 * coefficients.div_ceil(QUAD)
}

/// Statements that read `coefficients` of three channels from vectors of four floats, and do `each` with
/// them. `load` makes an expression from a vector's place; `each` a statement from a coefficient's number
/// and expression.
fn for_each_coefficient(
    coefficients: usize,
    load: impl Fn(usize) -> String,
    each: impl Fn(usize, &str) -> String,
) -> String {
    let mut out = String::new();
    for group in 0..coefficients.div_ceil(QUAD) {
        let [a, b, c] = [3 * group, 3 * group + 1, 3 * group + 2];
        for v in [a, b, c] {
            // Writing to a String does not fail.
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

/// Statements that add the products of a dense row with the basis to `rest`, and read `dc`.
pub(super) fn dense_terms(per_channel: usize, load: impl Fn(usize) -> String) -> String {
    for_each_coefficient(per_channel + 1, load, |k, coefficient| match k {
        0 => format!("let dc = {coefficient};"),
        _ => format!("rest += b[{}] * {coefficient};", k - 1),
    })
}

/// Statements that add the products of the atom at `atoms[at]` with the basis to `sum`.
pub(super) fn atom_terms(per_channel: usize) -> String {
    if per_channel == 0 {
        // The array is bound all the same, so the kernel must name it.
        return "_ = atoms[at];".to_owned();
    }
    let load = |v: usize| format!("atoms[at + {v}u]");
    for_each_coefficient(per_channel, load, |k, coefficient| format!("sum += b[{k}] * {coefficient};"))
}

/// The same for the atom whose floats begin at `atoms_here[at]`.
pub(super) fn shared_atom_terms(per_channel: usize) -> String {
    let mut out = String::new();
    for k in 0..per_channel {
        let [r, g, b] = [3 * k, 3 * k + 1, 3 * k + 2].map(|c| format!("atoms_here[at + {c}u]"));
        let _ = writeln!(out, "sum += b[{k}] * vec3<f32>({r}, {g}, {b});");
    }
    out
}
