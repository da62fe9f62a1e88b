//! The bytes of packed data that are there, and what is made of them.

/// The data of a packed scene, as far as it is there.
#[derive(Clone, Copy)]
pub(crate) enum Data<'d> {
    /// All of it, or a first part.
    First(&'d [u8]),
    /// Some ranges.
    Ranges(&'d dyn AvailableRanges),
}

/// Ranges of packed data that are there, whose checksums hold. They are told apart by where they start in the data.
pub(crate) trait AvailableRanges: Sync {
    /// The bytes of the range, if they are held.
    fn bytes(&self, start: u64) -> Option<&[u8]>;

    /// Whether the range was there, held or not.
    fn came(&self, start: u64) -> bool;
}

impl<'d> Data<'d> {
    /// The bytes of a range, if all of them are held.
    pub(in crate::packed) fn range(self, start: u64, length: u32) -> Option<&'d [u8]> {
        match self {
            Self::First(data) => {
                let end = start.checked_add(length.into())?;
                data.get(usize::try_from(start).ok()?..usize::try_from(end).ok()?)
            }
            Self::Ranges(held) => held.bytes(start).filter(|bytes| bytes.len() == length as usize),
        }
    }

    /// Whether a range is there or was.
    pub(in crate::packed) fn came(self, start: u64, length: u32) -> bool {
        match self {
            Self::First(data) => start.saturating_add(length.into()) <= data.len() as u64,
            Self::Ranges(held) => held.came(start),
        }
    }

    /// Whether the checksums of ranges are known to hold.
    pub(in crate::packed) fn is_verified(self) -> bool {
        matches!(self, Self::Ranges(_))
    }
}

/// What is made of a chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct DecodeOptions {
    /// Parts of nonzeros that are decoded, at most.
    pub(crate) sh_parts: usize,
    /// Whether the checksums of integers are verified.
    pub(crate) verify: bool,
}

impl Default for DecodeOptions {
    fn default() -> Self {
        Self { sh_parts: usize::MAX, verify: false }
    }
}
