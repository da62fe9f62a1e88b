//! Options of reading a PLY.

use crate::support::builder::builder_methods;
use crate::support::limits::Limits;

/// Options of reading a PLY.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ReadOptions {
    /// Whether to leave out Gaussians with NaN or infinite values instead of refusing the file. Default `false`.
    pub drop_invalid: bool,
    /// Whether to leave out the properties that 3DGS does not define. Default `false`.
    pub drop_extras: bool,
    /// The limits on a file.
    pub limits: Limits,
}

impl ReadOptions {
    builder_methods!(
        with_drop_invalid(drop_invalid: bool),
        with_drop_extras(drop_extras: bool),
        with_limits(limits: Limits),
    );
}
