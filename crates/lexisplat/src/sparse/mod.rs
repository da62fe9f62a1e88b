//! The method of the paper: a dictionary learned from SH-rest, sparse codes found by a pursuit.

pub(crate) mod atoms;
pub(crate) mod codes;
pub(crate) mod compress;
pub(crate) mod dictionary;
pub mod learn;
pub(crate) mod model;
pub mod pursuit;
pub(crate) mod tally;
