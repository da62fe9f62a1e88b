//! The kind of a file, recognised by its first bytes and its name.

use std::fmt;

/// Extension of the files of [`Unsupported::Splat`]. Their bytes have no mark.
const SPLAT_EXTENSION: &str = ".splat";
/// Extension of the files of [`Unsupported::Ksplat`]. Their bytes have no mark.
const KSPLAT_EXTENSION: &str = ".ksplat";
/// Extension of .lexi files.
const LEXI_EXTENSION: &str = ".lexi";
/// Advice for a scene of another format, in programs that read with this crate alone.
const CONVERT: &str = "'lexisplat convert' makes a PLY of it, and the crate lexisplat-formats reads it";
/// The mark of UTF-8 that some editors put before text.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";
/// The offset of the JSON header in a safetensors file: after its length, a u64.
const JSON_OFFSET: usize = 8;

/// Returns `bytes` without the mark of UTF-8 that some editors put before text.
#[must_use]
pub fn without_byte_order_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes)
}

/// A kind of file, as far as its first bytes and its name tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FileKind {
    /// A PLY.
    Ply,
    /// A .lexi, or another safetensors file.
    Lexi,
    /// A file of a known kind that this crate does not read.
    Unsupported(Unsupported),
    /// A file without bytes.
    Empty,
    /// A file of another kind.
    Unknown,
}

/// A kind of file that users mistake for a scene that this crate reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unsupported {
    /// A file that gzip compressed, such as an SPZ before version 4.
    Gzip,
    /// A zip archive, such as a SOG.
    Zip,
    /// SPZ, version 4.
    Spz,
    /// A Python pickle.
    Pickle,
    /// The `.splat` of antimatter15's viewer, recognised by name.
    Splat,
    /// The `.ksplat` of mkkellogg's viewer, recognised by name.
    Ksplat,
    /// A PLY with `PlayCanvas`'s packed elements.
    CompressedPly,
    /// A PLY with the anchors of Scaffold-GS.
    Anchors,
    /// A PLY without opacities.
    PointCloud,
}

impl FileKind {
    /// Returns the kind of the file called `name` that begins with `bytes`.
    #[must_use]
    pub fn of(name: &str, bytes: &[u8]) -> Self {
        let bytes = without_byte_order_mark(bytes);
        let named = |extension: &str| name.to_ascii_lowercase().ends_with(extension);
        let unsupported = match bytes {
            [] => return Self::Empty,
            [b'p', b'l', b'y', b'\n' | b'\r' | b' ' | b'\t', ..] => return Self::Ply,
            [b'P', b'K', 3, 4, ..] => Unsupported::Zip,
            [b'N', b'G', b'S', b'P', ..] => Unsupported::Spz,
            // The length of the header may have any low bytes, so this test comes before those of marks of two bytes.
            bytes if bytes.get(JSON_OFFSET) == Some(&b'{') && (is_length(bytes) || named(LEXI_EXTENSION)) => {
                return Self::Lexi;
            }
            [0x1f, 0x8b, ..] => Unsupported::Gzip,
            // Protocols 2 to 5.
            [0x80, 2..=5, ..] => Unsupported::Pickle,
            _ if named(SPLAT_EXTENSION) => Unsupported::Splat,
            _ if named(KSPLAT_EXTENSION) => Unsupported::Ksplat,
            _ => return Self::Unknown,
        };
        Self::Unsupported(unsupported)
    }
}

/// Returns whether the first 8 bytes can be the length of a safetensors header: a u64 below 2^32. The first 8 bytes of a
/// .splat are two floats. They are such a length only if the second is 0.
fn is_length(bytes: &[u8]) -> bool {
    bytes.get(4..JSON_OFFSET) == Some(&[0; 4])
}

impl fmt::Display for FileKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ply => f.write_str("a PLY"),
            Self::Lexi => f.write_str("a .lexi"),
            Self::Unsupported(kind) => kind.fmt(f),
            Self::Empty => f.write_str("an empty file"),
            Self::Unknown => f.write_str("a file of unknown kind"),
        }
    }
}

impl Unsupported {
    /// Returns a description of the kind with advice, for a message.
    fn texts(self) -> [&'static str; 2] {
        match self {
            Self::Gzip => ["a gzip file (SPZ?)", CONVERT],
            Self::Zip => ["a zip archive (SOG?)", CONVERT],
            Self::Spz => ["SPZ, version 4", CONVERT],
            Self::Splat => ["a .splat file", CONVERT],
            Self::Ksplat => ["a .ksplat file", CONVERT],
            Self::Pickle => [
                "a Python pickle, which can run any code when it is read (EAGLES' point_cloud_compressed.pkl?)",
                "it is never read here: write a PLY where it was made; for EAGLES train with --save_ply, or use \
                 load_compressed_pkl and save_ply",
            ],
            Self::CompressedPly => ["a PlayCanvas compressed.ply", CONVERT],
            Self::Anchors => [
                "a Scaffold-GS anchor model",
                "its Gaussians come out of a network; export them as plain 3DGS first",
            ],
            Self::PointCloud => [
                "a point cloud, not a Gaussian scene (no opacity)",
                "pass the trained model, usually point_cloud/iteration_30000/point_cloud.ply",
            ],
        }
    }

    /// Returns advice for the user, who cannot read the file.
    #[must_use]
    pub fn advice(self) -> &'static str {
        self.texts()[1]
    }
}

impl fmt::Display for Unsupported {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.texts()[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_told_by_their_first_bytes_or_their_name() {
        let unsupported = FileKind::Unsupported;
        let cases: [(&str, &[u8], FileKind); 16] = [
            ("a", b"\xef\xbb\xbfply\nformat", FileKind::Ply),
            ("a", b"", FileKind::Empty),
            ("a", b"ply\nformat", FileKind::Ply),
            ("a.splat", b"ply\r\n", FileKind::Ply),
            ("a", b"ply", FileKind::Unknown),
            ("a", b"\x50\0\0\0\0\0\0\0{\"", FileKind::Lexi),
            // A header of 640 or 35,615 bytes is not a pickle or gzip.
            ("a", b"\x80\x02\0\0\0\0\0\0{\"", FileKind::Lexi),
            ("a", b"\x1f\x8b\0\0\0\0\0\0{\"", FileKind::Lexi),
            // The ninth byte of a .splat may be an opening brace.
            ("a", b"\x01\x02\x03\x04\x05\x06\x07\x3f{\x01\x02\x3f", FileKind::Unknown),
            ("a.lexi", b"\xff\xff\xff\xff\xff\xff\xff\xff{\"", FileKind::Lexi),
            ("a.lexi", b"\x1f\x8b\x08\0", unsupported(Unsupported::Gzip)),
            ("a.ply", b"PK\x03\x04", unsupported(Unsupported::Zip)),
            ("a.ply", b"NGSP\x04\0\0\0{", unsupported(Unsupported::Spz)),
            ("a.ply", b"\x80\x04\x95", unsupported(Unsupported::Pickle)),
            ("b/a.SPLAT", b"\0\0\0\0", unsupported(Unsupported::Splat)),
            ("a.ksplat", b"\0\x01", unsupported(Unsupported::Ksplat)),
        ];
        for (name, bytes, kind) in cases {
            assert_eq!(FileKind::of(name, bytes), kind, "{name} {bytes:?}");
        }
    }
}
