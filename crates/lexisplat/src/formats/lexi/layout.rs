//! Layouts of .lexi files.

use crate::sparse::codes::ValueType;
use crate::sparse::model::named;

/// Layout of a .lexi file, by the name in its header.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Layout {
    /// Exact geometry, [`CodeLayout::Compact`] codes with f32 values.
    F32,
    /// Exact geometry, [`CodeLayout::Compact`] codes with f16 values.
    F16,
    /// Exact geometry, [`CodeLayout::Paper`] codes.
    Paper,
    /// Everything quantised and entropy-coded, geometry included ([`crate::packed`]).
    #[default]
    Packed,
}
named!(Layout, "layout", F32 => "f32", F16 => "f16", Paper => "paper", Packed => "packed");

/// The way in which the codes of an exact file are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum CodeLayout {
    /// u8 counts, u8 or u16 indices, values of their own type.
    #[default]
    Compact,
    /// Codes as the paper counts them: i32 pointers, i32 indices, f32 values.
    Paper,
}

impl Layout {
    /// Returns the type of the values of codes in files of this layout.
    #[must_use]
    pub fn values(self) -> ValueType {
        match self {
            Self::F16 | Self::Packed => ValueType::F16,
            Self::F32 | Self::Paper => ValueType::F32,
        }
    }

    /// Returns the way in which codes are stored in exact files of this layout.
    #[must_use]
    pub fn codes(self) -> CodeLayout {
        if self == Self::Paper { CodeLayout::Paper } else { CodeLayout::Compact }
    }

    /// Returns the layout of an exact file with these codes.
    #[must_use]
    pub fn of(codes: CodeLayout, values: ValueType) -> Self {
        match (codes, values) {
            (CodeLayout::Paper, _) => Self::Paper,
            (CodeLayout::Compact, ValueType::F16) => Self::F16,
            (CodeLayout::Compact, ValueType::F32) => Self::F32,
        }
    }
}
