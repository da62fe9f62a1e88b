//! Finds the vertex rows in the bytes after a header and hands them out a chunk at a time.

use std::borrow::Cow;
use std::ops::Range;

use super::ascii::AsciiRows;
use super::columns::{Packed, Scalar};
use super::header::{Element, Format, Header, Kind, ScalarType};
use super::layout::vertex_index;
use super::names::shown;
use crate::support::error::{Error, FormatError, Result};

/// Rows in one unit of work: at 248 bytes a row the chunk stays in a core's second-level cache while
/// one run of columns after another is copied out of it.
pub(super) const CHUNK_ROWS: usize = 1024;

/// The vertex rows of a file.
#[derive(Debug)]
pub(super) enum Rows<'a> {
    /// As they lie in the file.
    Binary(Packed<'a>),
    /// Turned into little-endian rows when asked for.
    Ascii(AsciiRows<'a>),
}

impl<'a> Rows<'a> {
    /// Finds the rows of the vertex element, and checks that all of them are there.
    ///
    /// `data` is what follows the header. Oddities that do no harm are added to `warnings`.
    pub(super) fn locate(
        file: &'a str,
        header: &Header,
        row_bytes: usize,
        data: &'a [u8],
        warnings: &mut Vec<String>,
    ) -> Result<Self> {
        let Some(index) = vertex_index(header) else {
            return Err(Error::malformed(file, "no element 'vertex'"));
        };
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

    /// Rows `range` packed. Of an ASCII file quickest from a multiple of [`CHUNK_ROWS`] on.
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

/// Where `element`, which starts at `start`, ends; an error if that is not inside `data`.
fn skip(element: &Element, data: &[u8], start: usize, big: bool) -> std::result::Result<usize, FormatError> {
    let Some(row) = element.row_bytes() else { return walk(element, data, start, big) };
    let found = (data.len() - start) as u64;
    let expected = element.count.saturating_mul(row as u64);
    if expected > found {
        return Err(FormatError::Truncated {
            what: format!("element '{}' ({} rows of {row} bytes)", shown(&element.name), element.count),
            expected,
            found,
        });
    }
    // Fits: it is at most the length of a slice.
    Ok(start + usize::try_from(expected).unwrap_or(data.len() - start))
}

/// [`skip`] for an element with lists, row by row.
fn walk(element: &Element, data: &[u8], start: usize, big: bool) -> std::result::Result<usize, FormatError> {
    let mut at = start;
    // Ends after at most `data.len()` rows: a row with a list has at least the list's count.
    for row in 0..element.count {
        for property in &element.properties {
            let need = match property.kind {
                Kind::Scalar(ty) => Some(ty.bytes()),
                Kind::List { count, item } => data
                    .get(at..)
                    .and_then(|rest| rest.get(..count.bytes()))
                    .map(|bytes| list_length(bytes, count, big))
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

/// A list's length; `None` if negative.
fn list_length(bytes: &[u8], ty: ScalarType, big: bool) -> Option<usize> {
    fn load<T: Scalar>(bytes: &[u8], big: bool) -> T {
        if big { T::load::<true>(bytes) } else { T::load::<false>(bytes) }
    }
    match ty {
        ScalarType::I8 => usize::try_from(load::<i8>(bytes, big)).ok(),
        ScalarType::U8 => Some(usize::from(load::<u8>(bytes, big))),
        ScalarType::I16 => usize::try_from(load::<i16>(bytes, big)).ok(),
        ScalarType::U16 => Some(usize::from(load::<u16>(bytes, big))),
        ScalarType::I32 => usize::try_from(load::<i32>(bytes, big)).ok(),
        ScalarType::U32 => usize::try_from(load::<u32>(bytes, big)).ok(),
        // The header refuses these.
        ScalarType::F32 | ScalarType::F64 => None,
    }
}

/// Compares the `left` bytes after the vertices with what the elements after them need.
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
        warnings.push(format!("ignored: {}", FormatError::TrailingBytes { extra: left - needed }));
    }
}
