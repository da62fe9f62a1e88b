//! The bytes of the messages that pass between steps.

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::support::crc32;
use crate::support::error::{Error, Result};

/// Bytes of the checksum at the end of a message.
pub(super) const CHECKSUM: usize = 4;
/// The version of this crate, which every message states. The bytes of another version may have another meaning, so they
/// are refused.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Returns the bytes of `message`. `kind` is the name of its type.
pub(super) fn to_bytes(kind: &str, message: &impl Serialize) -> Vec<u8> {
    let mut bytes = postcard::to_stdvec(&(kind, VERSION, message)).unwrap_or_default();
    let checksum = crc32::hash(&bytes);
    bytes.extend(checksum.to_le_bytes());
    bytes
}

/// Reads a message that [`to_bytes`] wrote with the same `kind`.
pub(super) fn from_bytes<T: DeserializeOwned>(kind: &'static str, bytes: &[u8]) -> Result<T> {
    let wrong = |found: String| Error::parameter(kind, found, format!("what lexisplat {VERSION} wrote"));
    let Some((body, checksum)) = bytes.split_last_chunk::<CHECKSUM>() else {
        return Err(wrong(format!("{} bytes", bytes.len())));
    };
    if crc32::hash(body) != u32::from_le_bytes(*checksum) {
        return Err(wrong("damaged bytes".to_owned()));
    }
    let (found, rest) = postcard::take_from_bytes::<(&str, &str)>(body).map_err(|e| wrong(e.to_string()))?;
    if found != (kind, VERSION) {
        return Err(wrong(format!("{} of version {}", found.0, found.1)));
    }
    postcard::from_bytes(rest).map_err(|e| wrong(e.to_string()))
}

/// Defines `to_bytes` and `from_bytes` for types that pass between steps.
macro_rules! messages {
    ($($type:ty => $kind:literal),* $(,)?) => {$(
        impl $type {
            /// Returns the bytes of the message, for another process of the same version of lexisplat.
            #[must_use]
            pub fn to_bytes(&self) -> Vec<u8> {
                super::message::to_bytes($kind, self)
            }

            /// Reads bytes that [`Self::to_bytes`] wrote.
            ///
            /// # Errors
            /// [`crate::Error::Parameter`] for all other bytes.
            pub fn from_bytes(bytes: &[u8]) -> crate::Result<Self> {
                super::message::from_bytes($kind, bytes)
            }
        }
    )*};
}
pub(super) use messages;
