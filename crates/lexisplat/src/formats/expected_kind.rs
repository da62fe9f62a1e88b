//! Refusal of files of another kind than the expected one.

use super::kind::FileKind;
use crate::support::error::{Error, FormatError, Result};

impl FileKind {
    /// Refuses the file called `name` if its `bytes` are of another kind than `self`. A .lexi begins with a length, so
    /// a file of unknown kind may be a damaged .lexi. It passes, and the error of its reader is better.
    pub(crate) fn expect(self, name: &str, bytes: &[u8]) -> Result<()> {
        let problem = match Self::of(name, bytes) {
            Self::Unsupported(kind) => FormatError::Unsupported { kind },
            Self::Empty => FormatError::Malformed("the file is empty".to_owned()),
            Self::Unknown if self == Self::Ply => {
                FormatError::Malformed("not a PLY file: it does not start with a line 'ply'".to_owned())
            }
            found @ (Self::Ply | Self::Lexi) if found != self => {
                FormatError::OtherKind { found, expected: self }
            }
            _ => return Ok(()),
        };
        Err(Error::format(name, problem))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readers_name_the_kind_they_were_given() {
        let said = |wanted: FileKind, bytes: &[u8]| wanted.expect("a", bytes).unwrap_err().to_string();
        assert_eq!(said(FileKind::Lexi, b"ply\nformat"), "a: this is a PLY, not a .lexi");
        assert_eq!(said(FileKind::Ply, b"\x50\0\0\0\0\0\0\0{\""), "a: this is a .lexi, not a PLY");
        assert!(said(FileKind::Lexi, b"PK\x03\x04").contains("a zip archive (SOG?), which is not supported"));
        assert!(FileKind::Lexi.expect("a", b"anything").is_ok());
    }
}
