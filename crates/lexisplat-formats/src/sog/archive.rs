//! The files of a SOG: members of a zip archive, or files beside `meta.json`.
//!
//! The zip reader supports what SOG needs (APPNOTE.TXT, 4.3): members that are stored or deflated, found by the central
//! directory.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Read;
use std::ops::Deref;

use flate2::bufread::DeflateDecoder;
use lexisplat::{Error, FormatError, Input, Limits, Result};

use crate::numbers::{u16_at, u32_at};
use crate::siblings::{Siblings, check_plain};
use crate::unknown::no_sog;

/// First bytes of the header of a member, of an entry of the directory, and of the end of the directory.
const LOCAL: &[u8] = b"PK\x03\x04";
const CENTRAL: &[u8] = b"PK\x01\x02";
const END: &[u8] = b"PK\x05\x06";
/// Number of bytes of each of these, before names and comments.
const LOCAL_BYTES: usize = 30;
const CENTRAL_BYTES: usize = 46;
const END_BYTES: usize = 22;
/// Largest comment at the end of an archive, in bytes.
const MOST_COMMENT: usize = u16::MAX as usize;
/// Flag of encrypted members.
const ENCRYPTED: u16 = 1;
/// Flag of names in UTF-8.
const UTF8: u16 = 0x800;
/// Compression methods.
const STORED: u16 = 0;
const DEFLATED: u16 = 8;
/// Version needed to extract stored members: 2.0.
const VERSION: u16 = 20;
/// Date of all members: 1980-01-01. It is fixed so that the bytes depend on the scene alone.
const DAY: u16 = 1 << 5 | 1;

/// A member of an archive.
#[derive(Debug, Clone, Copy)]
struct Member {
    flags: u16,
    method: u16,
    checksum: u32,
    packed: u32,
    plain: u32,
    /// Offset of the member's header.
    at: u32,
}

/// The members of an archive by name.
#[derive(Debug)]
pub(super) struct Archive<'a> {
    name: &'a str,
    bytes: &'a [u8],
    members: BTreeMap<&'a str, Member>,
}

impl<'a> Archive<'a> {
    /// Reads the directory of the archive in `bytes`, which messages call `name`.
    pub(super) fn open(name: &'a str, bytes: &'a [u8]) -> Result<Self> {
        let malformed = |text: &str| Error::malformed(name, text);
        let last = bytes.len().checked_sub(END_BYTES);
        let ends = last.into_iter().flat_map(|last| (last.saturating_sub(MOST_COMMENT)..=last).rev());
        let end = ends
            .filter_map(|at| bytes.get(at..))
            .find(|end| end.starts_with(END) && END_BYTES + usize::from(u16_at(end, 20)) == end.len());
        let end = end.ok_or_else(|| malformed("the zip archive has no end: it is cut off"))?;
        let [this_disk, first_disk, here, count] = [4, 6, 8, 10].map(|at| u16_at(end, at));
        if this_disk != 0 || first_disk != 0 || here != count {
            return Err(malformed("the zip archive has several parts"));
        }
        let (size, at) = (u32_at(end, 12), u32_at(end, 16));
        if count == u16::MAX || size == u32::MAX || at == u32::MAX {
            return Err(malformed("the zip archive has the form for more than 4 GiB, which is not read"));
        }
        let directory = bytes.get(at as usize..).and_then(|rest| rest.get(..size as usize));
        let mut rest = directory.ok_or_else(|| malformed("the zip archive's directory is outside of it"))?;
        let mut members = BTreeMap::new();
        for _ in 0..count {
            let lengths = [28, 30, 32].map(|at| usize::from(u16_at(rest, at)));
            let all = CENTRAL_BYTES + lengths.iter().sum::<usize>();
            let entry = rest.get(..all).filter(|entry| entry.starts_with(CENTRAL));
            let entry = entry.ok_or_else(|| malformed("the zip archive's directory is damaged"))?;
            rest = rest.get(all..).unwrap_or_default();
            let called = entry.get(CENTRAL_BYTES..CENTRAL_BYTES + lengths[0]).unwrap_or_default();
            let called = std::str::from_utf8(called)
                .map_err(|_| malformed("a name in the zip archive is not in UTF-8"))?;
            let member = Member {
                flags: u16_at(entry, 8),
                method: u16_at(entry, 10),
                checksum: u32_at(entry, 16),
                packed: u32_at(entry, 20),
                plain: u32_at(entry, 24),
                at: u32_at(entry, 42),
            };
            if members.insert(called, member).is_some() {
                let called = called.escape_debug();
                return Err(malformed(&format!("the zip archive has two members '{called}'")));
            }
        }
        Ok(Self { name, bytes, members })
    }

    /// Returns an error for an archive without the file `called`, which makes an archive a SOG.
    pub(super) fn expect(&self, called: &str) -> Result<()> {
        match self.members.contains_key(called) {
            true => Ok(()),
            false => Err(Error::malformed(self.name, no_sog(self.members.keys().copied()))),
        }
    }

    /// Returns the content of the member `called`.
    fn get(&self, called: &str, limits: &Limits) -> Result<Content<'a>> {
        let malformed = |text: &str| Error::malformed(self.name, format!("member '{called}' {text}"));
        let member = self.members.get(called).ok_or_else(|| malformed("is missing from the zip archive"))?;
        let header = self.bytes.get(member.at as usize..).filter(|rest| rest.starts_with(LOCAL));
        let header = header.ok_or_else(|| malformed("is not where the directory says"))?;
        let start = LOCAL_BYTES + usize::from(u16_at(header, 26)) + usize::from(u16_at(header, 28));
        let packed = header.get(start..).and_then(|rest| rest.get(..member.packed as usize));
        let packed = packed.ok_or_else(|| malformed("is cut off"))?;
        // Only the bytes of this member count for the limit, not those of other members.
        let plain = usize::try_from(member.plain).unwrap_or(usize::MAX);
        limits.check_arrays(self.name, packed.len() as u64, plain, 1)?;
        if member.flags & ENCRYPTED != 0 {
            return Err(malformed("is encrypted"));
        }
        let content = match member.method {
            STORED => Cow::Borrowed(packed),
            DEFLATED => {
                let mut content = Vec::new();
                DeflateDecoder::new(packed)
                    .take(u64::from(member.plain).saturating_add(1))
                    .read_to_end(&mut content)
                    .map_err(|error| malformed(&format!("is damaged: {error}")))?;
                Cow::Owned(content)
            }
            other => return Err(malformed(&format!("is packed by method {other}, and 0 and 8 are read"))),
        };
        if content.len() != plain {
            return Err(malformed(&format!("has not the {plain} bytes that the directory says")));
        }
        if crc32fast::hash(&content) != member.checksum {
            return Err(Error::format(self.name, FormatError::Checksum { covered: called.to_owned() }));
        }
        Ok(Content::Member(content, packed.len() as u64))
    }
}

/// The files of a SOG.
#[derive(Debug)]
pub(super) enum Files<'a> {
    /// An archive.
    Archive(Archive<'a>),
    /// Files beside the file that messages call by the first value, in the folder of the last value. A folder's name ends
    /// with `/`; an empty name is the folder of the file.
    Beside(&'a str, Siblings<'a>, String),
}

/// The bytes of a file of a SOG.
#[derive(Debug)]
pub(super) enum Content<'a> {
    /// The content of a member of an archive, and the number of bytes that it takes in the archive.
    Member(Cow<'a, [u8]>, u64),
    File(Input),
}

impl Deref for Content<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Member(bytes, _) => bytes,
            Self::File(bytes) => bytes,
        }
    }
}

impl Content<'_> {
    /// Returns the number of bytes that the content takes in its archive or file.
    pub(super) fn stored(&self) -> u64 {
        match self {
            Self::Member(_, packed) => *packed,
            Self::File(bytes) => bytes.len() as u64,
        }
    }
}

impl<'a> Files<'a> {
    /// Returns the content of the file `called`.
    pub(super) fn get(&self, called: &str, limits: &Limits) -> Result<Content<'a>> {
        match self {
            Self::Archive(archive) => {
                check_plain(archive.name, called)?;
                archive.get(called, limits)
            }
            Self::Beside(name, siblings, folder) => {
                check_plain(name, called)?;
                Ok(Content::File(siblings.read_below(name, &format!("{folder}{called}"), limits)?))
            }
        }
    }
}

/// Returns a zip archive of `members`, which are stored without compression.
///
/// # Errors
/// [`Error::Limit`] for more than 4 GiB.
pub(super) fn write(members: &[(&str, Vec<u8>)]) -> Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(members.iter().map(|(_, content)| content.len() + 200).sum());
    let mut directory = Vec::new();
    for (name, content) in members {
        let at = short(bytes.len())?;
        let mut record = Vec::new();
        for value in [VERSION, UTF8, STORED, 0, DAY] {
            record.extend(value.to_le_bytes());
        }
        let size = short(content.len())?;
        for value in [crc32fast::hash(content), size, size] {
            record.extend(value.to_le_bytes());
        }
        // The length of the name, and the length of the extra field, which is 0.
        record.extend(short(name.len())?.to_le_bytes());
        bytes.extend(LOCAL);
        bytes.extend(&record);
        bytes.extend(name.as_bytes());
        bytes.extend(content);
        directory.extend(CENTRAL);
        directory.extend(VERSION.to_le_bytes());
        directory.extend(&record);
        // No comment, the first disk, and no attributes.
        directory.extend([0; 10]);
        directory.extend(at.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let (at, size) = (short(bytes.len())?, short(directory.len())?);
    let count = short(members.len())?.to_le_bytes();
    bytes.extend(directory);
    bytes.extend(END);
    bytes.extend([0; 4]);
    bytes.extend([count[0], count[1], count[0], count[1]]);
    bytes.extend(size.to_le_bytes());
    bytes.extend(at.to_le_bytes());
    bytes.extend([0; 2]);
    Ok(bytes)
}

/// Returns a size or an offset in 32 bits.
fn short(size: usize) -> Result<u32> {
    let limit = u64::from(u32::MAX);
    u32::try_from(size).map_err(|_| {
        let what = "bytes of a zip archive".to_owned();
        Error::Limit { what, found: size as u64, limit, name: None }
    })
}
