//! The header of an SPZ, and the lengths of its parts.

use lexisplat::{Error, FormatError, Result, ShDegree};

use crate::numbers::u32_at;

/// First bytes of a header, in all versions.
const MAGIC: &[u8; 4] = b"NGSP";
/// Number of bytes of a header of versions 1 to 3, which is inside gzip (`LegacyPackedGaussiansHeader`).
pub(super) const OLD_BYTES: usize = 16;
/// Number of bytes of a header of version 4 (`NgspFileHeader`).
pub(super) const BYTES: usize = 32;
/// First version that is not inside gzip.
pub(super) const FIRST_ZSTD: u32 = 4;
/// Newest version.
pub(super) const NEWEST: u32 = 4;
/// First version whose rotations are the smallest three of four components (`MIN_SMALLEST_THREE_QUATERNIONS_VERSION`).
const FIRST_SMALLEST_THREE: u32 = 3;
/// Flag of scenes that were trained with anti-aliasing.
const ANTIALIASED: u8 = 1;
/// Flag of files with records of extensions.
const EXTENSIONS: u8 = 2;
/// Largest number of bits of the fraction of a position, which has 24 bits in all.
const MOST_FRACTION: u8 = 24;
/// Number of streams of values.
pub(super) const STREAMS: usize = 6;
/// Names of the streams, in the order of the file.
pub(super) const NAMES: [&str; STREAMS] = ["positions", "alphas", "colors", "scales", "rotations", "sh"];

/// A header of any version (nianticlabs/spz, `load-spz.cc`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) version: u32,
    /// Number of Gaussians.
    pub(super) count: u32,
    pub(super) degree: ShDegree,
    /// Number of bits of the fraction of a position.
    pub(super) fraction: u8,
    pub(super) antialiased: bool,
    pub(super) has_extensions: bool,
    /// Number of streams that are not empty, and the offset of their table; only in version 4.
    pub(super) table: Option<(usize, usize)>,
}

impl Header {
    /// Parses the header in `bytes` of the file called `name`: 16 bytes that were inside gzip, or 32 bytes.
    pub(super) fn parse(name: &str, bytes: &[u8]) -> Result<Self> {
        let malformed = |text: String| Error::malformed(name, text);
        let gzipped = bytes.len() == OLD_BYTES;
        if !gzipped && bytes.len() < BYTES || !bytes.starts_with(MAGIC) {
            return Err(malformed("the header of an SPZ is missing".to_owned()));
        }
        let version = u32_at(bytes, 4);
        let versions = if gzipped { 1..=FIRST_ZSTD - 1 } else { FIRST_ZSTD..=NEWEST };
        if version > NEWEST {
            let problem = FormatError::Version { found: version.into(), supported: NEWEST.into() };
            return Err(Error::format(name, problem));
        }
        if !versions.contains(&version) {
            let wrapping = if gzipped { "inside gzip" } else { "outside of gzip" };
            return Err(malformed(format!("SPZ version {version} {wrapping}")));
        }
        let [degree, fraction, flags, streams] = [bytes[12], bytes[13], bytes[14], bytes[15]];
        let degree =
            ShDegree::new(degree).map_err(|_| malformed(format!("shDegree is {degree}, at most 4")))?;
        if fraction > MOST_FRACTION {
            return Err(malformed(format!("fractionalBits is {fraction}, at most {MOST_FRACTION}")));
        }
        Ok(Self {
            version,
            count: u32_at(bytes, 8),
            degree,
            fraction,
            antialiased: flags & ANTIALIASED != 0,
            has_extensions: flags & EXTENSIONS != 0,
            table: (!gzipped).then(|| (usize::from(streams), u32_at(bytes, 16) as usize)),
        })
    }

    /// Returns the header as bytes.
    pub(super) fn to_bytes(self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(self.version.to_le_bytes());
        bytes.extend(self.count.to_le_bytes());
        let flags = u8::from(self.antialiased) * ANTIALIASED;
        // There are at most 6 streams.
        let streams = self.table.map_or(0, |(streams, _)| streams.to_le_bytes()[0]);
        bytes.extend([self.degree.get(), self.fraction, flags, streams]);
        if self.table.is_some() {
            // No extensions are written, so the table follows the header.
            bytes.extend((BYTES as u64).to_le_bytes());
            bytes.resize(BYTES, 0);
        }
        bytes
    }

    /// Returns the number of bytes of a Gaussian in each stream.
    pub(super) fn widths(self) -> [usize; STREAMS] {
        let position = if self.version == 1 { 3 * 2 } else { 3 * 3 };
        [position, 1, 3, 3, if self.has_smallest_three() { 4 } else { 3 }, self.degree.rest()]
    }

    /// Returns whether rotations are the smallest three components. Otherwise they are the first three.
    pub(super) fn has_smallest_three(self) -> bool {
        self.version >= FIRST_SMALLEST_THREE
    }
}
