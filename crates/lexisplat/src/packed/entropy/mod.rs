//! Entropy coding: rANS in lanes for symbols with tables of probabilities, and adaptive bits for data that a file has once.

#![expect(clippy::cast_possible_truncation, reason = "states, words and frequencies are within limits")]
#![expect(
    clippy::needless_range_loop,
    reason = "loops over lanes are written out, since iterators over several arrays do not become vector code"
)]

pub(in crate::packed) mod adaptive_bits;
#[cfg(feature = "fuzzing")]
pub mod fuzzing;
pub(in crate::packed) mod lanes;
pub(in crate::packed) mod log_probabilities;
pub(in crate::packed) mod rans_decoder;
pub(in crate::packed) mod rans_encoder;
pub(in crate::packed) mod rans_state;
#[cfg(any(test, feature = "fuzzing"))]
pub(in crate::packed) mod script;
pub(in crate::packed) mod shifts;
pub(in crate::packed) mod symbols;
pub(in crate::packed) mod tables;
