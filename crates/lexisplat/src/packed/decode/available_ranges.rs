//! The ranges of packed data that a decoder has.

/// The available data of a packed scene.
#[derive(Clone, Copy)]
pub(crate) enum Data<'d> {
    /// All data, or their first bytes.
    First(&'d [u8]),
    /// Some of the ranges.
    Ranges(&'d dyn AvailableRanges),
}

/// A set of verified ranges of packed data. A range is identified by its start in the data.
pub(crate) trait AvailableRanges: Sync {
    /// Returns the bytes of the range that starts at `start`, if they are still held.
    fn bytes(&self, start: u64) -> Option<&[u8]>;

    /// Returns whether the range that starts at `start` came. Its bytes may no longer be held.
    fn came(&self, start: u64) -> bool;
}

impl<'d> Data<'d> {
    /// Returns the bytes of a range, if all of them are held.
    pub(in crate::packed) fn range(self, start: u64, length: u32) -> Option<&'d [u8]> {
        match self {
            Self::First(data) => {
                let end = start.checked_add(length.into())?;
                data.get(usize::try_from(start).ok()?..usize::try_from(end).ok()?)
            }
            Self::Ranges(held) => held.bytes(start).filter(|bytes| bytes.len() == length as usize),
        }
    }

    /// Returns whether a range is there, or was there.
    pub(in crate::packed) fn came(self, start: u64, length: u32) -> bool {
        match self {
            Self::First(data) => start.saturating_add(length.into()) <= data.len() as u64,
            Self::Ranges(held) => held.came(start),
        }
    }

    /// Returns whether the checksums of ranges were verified already.
    pub(in crate::packed) fn is_verified(self) -> bool {
        matches!(self, Self::Ranges(_))
    }
}

/// Options of decoding a chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct DecodeOptions {
    /// Largest number of SH parts that are decoded.
    pub(crate) sh_parts: usize,
    /// Whether the checksums of integers are verified.
    pub(crate) verify: bool,
}

impl Default for DecodeOptions {
    fn default() -> Self {
        Self { sh_parts: usize::MAX, verify: false }
    }
}
