//! Recognises the format of a file.

use std::fmt;

use lexisplat::{FileKind, without_byte_order_mark};
use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::{compressed_ply, gltf, ksplat, splat};

/// A format of scenes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Kind {
    /// The PLY of trainers.
    Ply,
    /// This project's own format.
    Lexi,
    /// Niantic's SPZ, versions 1 to 4.
    Spz,
    /// `PlayCanvas`' SOG, version 2: a zip archive, or `meta.json` in a folder of pictures. Also streamed SOG, version 1:
    /// `lod-meta.json` in a folder with folders of SOGs.
    Sog,
    /// `PlayCanvas`' compressed PLY.
    CompressedPly,
    /// Rows of 32 bytes, the format of antimatter15's viewer.
    Splat,
    /// `.ksplat`, the format of mkkellogg's viewer, compression levels 0 to 2.
    Ksplat,
    /// glTF 2.0 with `KHR_gaussian_splatting`: a glb, or JSON with its data inside.
    Gltf,
}

impl Kind {
    /// All formats.
    pub const ALL: [Self; 8] = [
        Self::Ply,
        Self::Lexi,
        Self::Spz,
        Self::Sog,
        Self::CompressedPly,
        Self::Splat,
        Self::Ksplat,
        Self::Gltf,
    ];

    /// The formats that [`write`](fn@crate::write) writes.
    pub const WRITTEN: [Self; 6] =
        [Self::Ply, Self::Spz, Self::Sog, Self::CompressedPly, Self::Splat, Self::Gltf];

    /// Returns the format of a file with the content `bytes` and the name `name`. The name decides only if the content
    /// does not tell the format.
    #[must_use]
    pub fn of(name: &str, bytes: &[u8]) -> Option<Self> {
        // Rows of a .splat may begin with the bytes of this mark, so it is removed only for the formats that have marks.
        let rows = bytes;
        let bytes = without_byte_order_mark(bytes);
        match bytes {
            [b'N', b'G', b'S', b'P', ..] => return Some(Self::Spz),
            [b'P', b'K', 3, 4, ..] => return Some(Self::Sog),
            bytes if bytes.starts_with(gltf::MAGIC) => return Some(Self::Gltf),
            _ => {}
        }
        match FileKind::of(name, bytes) {
            FileKind::Ply if compressed_ply::is_likely(bytes) => return Some(Self::CompressedPly),
            FileKind::Ply => return Some(Self::Ply),
            FileKind::Lexi => return Some(Self::Lexi),
            FileKind::Empty => return None,
            _ => {}
        }
        if bytes.starts_with(&[0x1f, 0x8b]) {
            return Some(Self::Spz);
        }
        // Rows of a .splat may begin like JSON.
        let is_json = bytes.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{');
        let json = || of_json(bytes).or(Self::of_extension(name).filter(|kind| *kind == Self::Gltf));
        if let Some(kind) = is_json.then(json).flatten() {
            return Some(kind);
        }
        if ksplat::is_likely(rows) {
            return Some(Self::Ksplat);
        }
        if splat::is_likely(rows) {
            return Some(Self::Splat);
        }
        Self::of_extension(name).filter(|kind| matches!(kind, Self::Splat | Self::Ksplat))
    }

    /// Returns the format of files called `name`, by the extension.
    #[must_use]
    pub fn of_extension(name: &str) -> Option<Self> {
        let name = name.to_ascii_lowercase();
        // The longest extension comes first, because a compressed.ply ends with .ply too.
        let ends = [
            (".compressed.ply", Self::CompressedPly),
            (".ply", Self::Ply),
            (".lexi", Self::Lexi),
            (".spz", Self::Spz),
            (".sog", Self::Sog),
            (".splat", Self::Splat),
            (".ksplat", Self::Ksplat),
            (".glb", Self::Gltf),
            (".gltf", Self::Gltf),
        ];
        ends.into_iter().find(|(end, _)| name.ends_with(end)).map(|(_, kind)| kind)
    }

    /// Returns the extension of files of this format. It is also the name of the format in options.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::Ply => "ply",
            Self::Lexi => "lexi",
            Self::Spz => "spz",
            Self::Sog => "sog",
            Self::CompressedPly => "compressed.ply",
            Self::Splat => "splat",
            Self::Ksplat => "ksplat",
            Self::Gltf => "glb",
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ply => "PLY",
            Self::Lexi => ".lexi",
            Self::Spz => "SPZ",
            Self::Sog => "SOG",
            Self::CompressedPly => "compressed.ply",
            Self::Splat => ".splat",
            Self::Ksplat => ".ksplat",
            Self::Gltf => "glTF",
        })
    }
}

/// Names in a JSON file that tell its format.
#[derive(Deserialize)]
struct Marks {
    asset: Option<IgnoredAny>,
    means: Option<IgnoredAny>,
    filenames: Option<IgnoredAny>,
    tree: Option<IgnoredAny>,
    quats: Option<IgnoredAny>,
}

/// Returns the format of a JSON file.
fn of_json(bytes: &[u8]) -> Option<Kind> {
    let marks: Marks = serde_json::from_slice(bytes).ok()?;
    let is_sog = marks.means.is_some() && marks.quats.is_some();
    let is_streamed_sog = marks.filenames.is_some() && marks.tree.is_some();
    // Both have an `asset` too, so they are tested first.
    if is_sog || is_streamed_sog {
        return Some(Kind::Sog);
    }
    marks.asset.map(|_| Kind::Gltf)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_told_by_their_bytes() {
        let cases: [(&str, &[u8], Option<Kind>); 18] = [
            ("a.spz", b"", None),
            ("a.spz", b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n", Some(Kind::Ply)),
            (
                "a.ply",
                b"ply\nformat binary_little_endian 1.0\nelement chunk 0\nelement vertex 0\nend_header\n",
                Some(Kind::CompressedPly),
            ),
            ("a", b"NGSP\x04\0\0\0{", Some(Kind::Spz)),
            ("a", b"\x1f\x8b\x08\0", Some(Kind::Spz)),
            ("a", b"PK\x03\x04", Some(Kind::Sog)),
            ("a", b"\x50\0\0\0\0\0\0\0{\"", Some(Kind::Lexi)),
            // The low byte of a length may be an opening brace.
            ("a", b"glTF\x02\0\0\0{\0\0\0", Some(Kind::Gltf)),
            ("a", b" {\"asset\":{}}", Some(Kind::Gltf)),
            ("a", b"{\"means\":{},\"quats\":{}}", Some(Kind::Sog)),
            ("a", b"{\"asset\":{},\"means\":{},\"quats\":{}}", Some(Kind::Sog)),
            ("a", b"{\"asset\":{},\"filenames\":[],\"tree\":{}}", Some(Kind::Sog)),
            ("a", b"\xef\xbb\xbf{\"asset\":{}}", Some(Kind::Gltf)),
            ("a", b"\xef\xbb\xbfply\nformat ascii 1.0\n", Some(Kind::Ply)),
            ("a", b"{\"other\":{}}", None),
            ("a.SPLAT", &[0; 32], Some(Kind::Splat)),
            ("a.ksplat", &[0; 7], Some(Kind::Ksplat)),
            ("a", b"anything", None),
        ];
        for (name, bytes, kind) in cases {
            assert_eq!(Kind::of(name, bytes), kind, "{name} {bytes:?}");
        }
    }

    #[test]
    fn extensions_name_their_formats() {
        for kind in Kind::ALL {
            assert_eq!(Kind::of_extension(&format!("a.{}", kind.extension())), Some(kind));
        }
        assert_eq!(Kind::of_extension("b/A.COMPRESSED.PLY"), Some(Kind::CompressedPly));
        assert_eq!(Kind::of_extension("a.txt"), None);
    }
}
