//! The method of the paper: a dictionary learned from SH-rest, sparse codes found by a pursuit.

pub(crate) mod atoms;
pub(crate) mod codes;
#[cfg(feature = "encode")]
pub(crate) mod compress;
pub(crate) mod dictionary;
#[cfg(feature = "encode")]
pub mod learn;
pub(crate) mod model;
#[cfg(feature = "encode")]
pub mod pursuit;
mod row_value;
#[cfg(feature = "encode")]
pub(crate) mod tally;
