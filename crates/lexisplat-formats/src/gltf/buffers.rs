//! The bytes of buffers: the BIN chunk of a glb, and data in base64. No other file is opened.

use std::borrow::Cow;

use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use lexisplat::{Error, FormatError, Result};

use super::document::{BufferView, Document};

/// Base64 with or without padding at its end, because writers differ.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);
/// Largest number of characters of an address in a message.
const SHOWN: usize = 64;

/// The buffers of a file that are used by some bufferViews.
#[derive(Debug)]
pub(super) struct Buffers<'a> {
    bytes: Vec<Option<Cow<'a, [u8]>>>,
}

/// A range of bytes in a buffer, which exists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) buffer: usize,
    pub(super) start: usize,
    pub(super) length: usize,
}

impl<'a> Buffers<'a> {
    /// Loads the buffers that the bufferViews `buffer_views` use.
    ///
    /// # Errors
    /// [`Error::Format`] for a buffer outside of the file, or of another length than stated.
    pub(super) fn load(
        name: &str,
        document: &Document<'_>,
        bin: Option<&'a [u8]>,
        buffer_views: impl Iterator<Item = usize>,
    ) -> Result<Self> {
        let mut bytes: Vec<_> = document.buffers.iter().map(|_| None).collect();
        for buffer_view in buffer_views {
            let index = buffer_view_of(name, document, buffer_view)?.buffer;
            match bytes.get_mut(index) {
                None => return Err(missing(name, "buffer", index)),
                Some(Some(_)) => {}
                Some(slot) => *slot = Some(load(name, document, bin, index)?),
            }
        }
        Ok(Self { bytes })
    }

    /// Returns the bytes of bufferView `buffer_view`, and its stride.
    ///
    /// # Errors
    /// [`Error::Format`] if the bytes are not all in the buffer.
    pub(super) fn buffer_view(
        &self,
        name: &str,
        document: &Document<'_>,
        buffer_view: usize,
    ) -> Result<(Span, Option<u64>)> {
        let entry = buffer_view_of(name, document, buffer_view)?;
        let Some(Some(bytes)) = self.bytes.get(entry.buffer) else {
            return Err(missing(name, "buffer", entry.buffer));
        };
        let end = entry.byte_offset.saturating_add(entry.byte_length);
        let (Ok(start), Ok(end)) = (usize::try_from(entry.byte_offset), usize::try_from(end)) else {
            return Err(Error::malformed(name, format!("bufferView {buffer_view} ends at byte {end}")));
        };
        if end > bytes.len() {
            let text = format!(
                "bufferView {buffer_view} ends at byte {end}, and buffer {} has {}",
                entry.buffer,
                bytes.len()
            );
            return Err(Error::malformed(name, text));
        }
        Ok((Span { buffer: entry.buffer, start, length: end - start }, entry.byte_stride))
    }

    /// Returns the bytes of `span`, which must come from [`Self::buffer_view`].
    pub(super) fn get(&self, span: Span) -> &[u8] {
        let bytes = self.bytes.get(span.buffer).and_then(Option::as_deref).unwrap_or_default();
        bytes.get(span.start..).and_then(|rest| rest.get(..span.length)).unwrap_or_default()
    }
}

/// Returns the error for `what` number `index`, which is referenced but does not exist.
pub(super) fn missing(name: &str, what: &str, index: usize) -> Error {
    Error::malformed(name, format!("{what} {index} does not exist"))
}

fn buffer_view_of<'d>(name: &str, document: &'d Document<'_>, buffer_view: usize) -> Result<&'d BufferView> {
    document.buffer_views.get(buffer_view).ok_or_else(|| missing(name, "bufferView", buffer_view))
}

/// Returns the bytes of buffer `index`, which must exist.
fn load<'a>(
    name: &str,
    document: &Document<'_>,
    bin: Option<&'a [u8]>,
    index: usize,
) -> Result<Cow<'a, [u8]>> {
    let entry = document.buffers.get(index).ok_or_else(|| missing(name, "buffer", index))?;
    let bytes = match (&entry.uri, bin) {
        (Some(uri), _) => Cow::Owned(decode(name, index, uri)?),
        (None, Some(bin)) if index == 0 => Cow::Borrowed(bin),
        (None, _) => {
            let text = format!("buffer {index} has neither a uri nor a BIN chunk");
            return Err(Error::malformed(name, text));
        }
    };
    if (bytes.len() as u64) < entry.byte_length {
        let (expected, found) = (entry.byte_length, bytes.len() as u64);
        let what = format!("buffer {index}");
        return Err(Error::format(name, FormatError::Truncated { what, expected, found }));
    }
    Ok(bytes)
}

/// Returns the bytes in the data URI `uri` (RFC 2397).
fn decode(name: &str, index: usize, uri: &str) -> Result<Vec<u8>> {
    let scheme = uri.get(..5).filter(|scheme| scheme.eq_ignore_ascii_case("data:"));
    if scheme.is_none() {
        let shown: String = uri.chars().take(SHOWN).collect();
        let text = format!(
            "buffer {index} is in the file '{}' beside it, which is not opened: pack the glTF as one .glb",
            shown.escape_debug()
        );
        return Err(Error::malformed(name, text));
    }
    let data = uri.split_once(',').filter(|(head, _)| head.ends_with(";base64")).map(|(_, data)| data);
    let Some(data) = data else {
        return Err(Error::malformed(name, format!("the data of buffer {index} are not in base64")));
    };
    BASE64
        .decode(data)
        .map_err(|error| Error::malformed(name, format!("the base64 of buffer {index}: {error}")))
}
