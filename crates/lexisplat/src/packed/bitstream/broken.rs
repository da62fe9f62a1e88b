//! Rules of docs/FORMAT.md that the bytes of a packed file can break.

/// A broken rule of a chunk, in words that follow the name of its range.
///
/// Decoders of all vector widths return it, so it is small.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::packed) struct Broken(pub(in crate::packed) &'static str);

/// A broken rule of the head, with the name of the field and its value.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub(in crate::packed) struct BrokenHead(pub(in crate::packed) String);

/// Returns an error with `message` unless `holds` is true.
pub(in crate::packed) fn must(holds: bool, message: impl FnOnce() -> String) -> Result<(), BrokenHead> {
    if holds { Ok(()) } else { Err(BrokenHead(message())) }
}
