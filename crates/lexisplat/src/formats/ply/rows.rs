//! The vertex rows in the bytes after a header, a chunk at a time.

use std::borrow::Cow;
use std::ops::Range;

use super::ascii::AsciiRows;
use super::columns::Packed;
use super::header::{Element, Format, Header, Kind};
use super::layout::Layout;
use super::names::shown;
use super::scalar::Scalar;
use crate::scene::extra::with_scalar;
use crate::support::error::{Error, FormatError, Result};

/// The vertex rows of a file.
#[derive(Debug)]
pub(super) enum Rows<'a> {
    /// Binary rows.
    Binary(Packed<'a>),
    /// Lines of text. They become little-endian rows on request.
    Ascii(AsciiRows<'a>),
}

impl<'a> Rows<'a> {
    /// Finds the rows of the vertex element in `data`, which are the bytes after the header, and checks that all of
    /// them are present. Adds warnings about harmless faults to `warnings`.
    pub(super) fn locate(
        file: &'a str,
        header: &Header,
        layout: &Layout,
        data: &'a [u8],
        warnings: &mut Vec<String>,
    ) -> Result<Self> {
        let &Layout { vertex: index, row_bytes, .. } = layout;
        let big = match header.format {
            Format::Ascii => return AsciiRows::locate(file, header, index, row_bytes, data).map(Self::Ascii),
            Format::BinaryLittleEndian => false,
            Format::BinaryBigEndian => true,
        };
        let refuse = |problem| Error::format(file, problem);
        let mut start = 0;
        for element in &header.elements[..index] {
            start = skip(element, data, start, big).map_err(refuse)?;
        }
        let end = skip(&header.elements[index], data, start, big).map_err(refuse)?;
        warn_about_the_end(&header.elements[index + 1..], (data.len() - end) as u64, warnings);
        Ok(Self::Binary(Packed { bytes: &data[start..end], row_bytes, big }))
    }

    /// Returns rows `range` packed, and whether they are big-endian. In an ASCII file this is fastest if the range
    /// starts at a multiple of [`ROWS_PER_TASK`](super::columns::ROWS_PER_TASK).
    pub(super) fn packed(&self, range: Range<usize>) -> Result<(Cow<'_, [u8]>, bool)> {
        match self {
            Self::Binary(rows) => {
                let bytes = &rows.bytes[range.start * rows.row_bytes..range.end * rows.row_bytes];
                Ok((Cow::Borrowed(bytes), rows.big))
            }
            Self::Ascii(rows) => Ok((Cow::Owned(rows.pack(range)?), false)),
        }
    }
}

/// Returns the end of `element`, which starts at `start`. It must be inside `data`.
fn skip(element: &Element, data: &[u8], start: usize, big: bool) -> std::result::Result<usize, FormatError> {
    let Some(row) = element.row_bytes() else { return skip_lists(element, data, start, big) };
    let found = (data.len() - start) as u64;
    let expected = element.count.saturating_mul(row as u64);
    if expected > found {
        return Err(FormatError::Truncated {
            what: format!("element '{}' ({} rows of {row} bytes)", shown(&element.name), element.count),
            expected,
            found,
        });
    }
    // The conversion cannot fail, because the number is at most the length of a slice.
    Ok(start + usize::try_from(expected).unwrap_or(data.len() - start))
}

/// Does the same as [`skip`] for an element with lists, whose rows differ in length.
fn skip_lists(
    element: &Element,
    data: &[u8],
    start: usize,
    big: bool,
) -> std::result::Result<usize, FormatError> {
    let mut at = start;
    // The loop ends after at most `data.len()` rows, because a row with a list has at least the list's count.
    for row in 0..element.count {
        for property in &element.properties {
            let need = match property.kind {
                Kind::Scalar(ty) => Some(ty.bytes()),
                Kind::List { count, item } => data
                    .get(at..)
                    .and_then(|rest| rest.get(..count.bytes()))
                    .map(|bytes| {
                        with_scalar!(count, T => if big { T::load::<true>(bytes) } else { T::load::<false>(bytes) }.to_length())
                    })
                    .and_then(|length| length?.checked_mul(item.bytes())?.checked_add(count.bytes())),
            };
            at = need.and_then(|n| at.checked_add(n)).filter(|&end| end <= data.len()).ok_or_else(|| {
                FormatError::Malformed(format!(
                    "truncated or damaged: list '{}' in row {row} of element '{}' does not fit in the file",
                    shown(&property.name),
                    shown(&element.name)
                ))
            })?;
        }
    }
    Ok(at)
}

/// Compares the `left` bytes after the vertices with the sizes of the elements after them.
fn warn_about_the_end(after: &[Element], left: u64, warnings: &mut Vec<String>) {
    let mut needed = 0_u64;
    for element in after {
        let Some(row) = element.row_bytes() else { return };
        needed = needed.saturating_add(element.count.saturating_mul(row as u64));
        if needed > left {
            warnings
                .push(format!("the file ends inside element '{}', which is not used", shown(&element.name)));
            return;
        }
    }
    if left > needed {
        warnings.push(format!("ignored: {} bytes follow the end of the data", left - needed));
    }
}
