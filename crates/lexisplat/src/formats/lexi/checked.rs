//! A safetensors file whose checksums hold, and its tensors.

use std::ops::Range;

use safetensors::Dtype;

use super::header::{Header, TensorInfo};
use super::json::{self, Json};
use super::schema::{
    DICTIONARY_FORMAT, IGNORED_PREFIX, LENGTH_BYTES, MAX_VERSION, PACKED_VERSION, VERSION, key, tensor,
};
use crate::formats::kind::FileKind;
use crate::support::crc32;
use crate::support::error::{Error, FormatError, Result};
use crate::support::limits::Limits;
use crate::support::parallel::map_chunks;

/// The bytes of a file, borrowed or owned.
pub(super) type FileBytes<'a> = Box<dyn AsRef<[u8]> + Send + Sync + 'a>;

/// A safetensors file whose header is parsed and whose checksums hold.
pub(super) struct Checked<'a> {
    /// Name of the file, as the caller gave it.
    pub(super) file: String,
    bytes: FileBytes<'a>,
    /// Position at which the data of tensors start.
    data_start: usize,
    header: Header,
    /// Length of the file according to its header.
    pub(super) file_bytes: u64,
}

/// The bytes of a file that must be there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Extent {
    /// All bytes of the file.
    Whole,
    /// A first part of the file, without its last bytes. The file must be packed.
    First,
}

impl std::fmt::Debug for Checked<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Checked")
            .field("file", &self.file)
            .field("header", &self.header)
            .finish_non_exhaustive()
    }
}

impl<'a> Checked<'a> {
    /// Parses `shared` and verifies everything that does not depend on the meaning of tensors. The value of the metadata
    /// key `format` must be one of `formats`.
    pub(super) fn open(
        file: String,
        shared: FileBytes<'a>,
        formats: &[&str],
        extent: Extent,
        limits: &Limits,
    ) -> Result<Self> {
        let bytes: &[u8] = (*shared).as_ref();
        FileKind::Lexi.expect(&file, bytes)?;
        let truncated = |what: &str, expected: u64| {
            let (what, found) = (what.to_owned(), bytes.len() as u64);
            Error::format(file.as_str(), FormatError::Truncated { what, expected, found })
        };
        let end = header_end(&file, bytes, limits)?;
        let text = usize::try_from(end).ok().and_then(|end| bytes.get(..end));
        let text = text.ok_or_else(|| truncated("the header", end))?;
        let header = read_header(&file, text)?;
        let file_bytes = end.saturating_add(header.data_bytes() as u64);
        let there = bytes.len() as u64;
        if there > file_bytes || (extent == Extent::Whole && there < file_bytes) {
            let text = format!("truncated or too long: {there} bytes do not match the header");
            return Err(Error::malformed(file, text));
        }
        let header_checksum = crc32::hash(text);
        let data_start = text.len();
        let checked = Self { file, bytes: shared, data_start, header, file_bytes };
        let format = |problem| Error::format(&checked.file, problem);
        let malformed = |text: String| checked.malformed(text);

        let found = checked.text(key::FORMAT)?;
        if !formats.contains(&found) {
            let wanted = formats.join("' or '");
            let text = format!("metadata 'format' is '{found}', not '{wanted}': not this kind of file");
            return Err(malformed(text));
        }
        let version: u64 = checked.number(key::VERSION)?;
        if version > MAX_VERSION {
            return Err(format(FormatError::Version { found: version, supported: MAX_VERSION }));
        }
        if ![VERSION, PACKED_VERSION].contains(&version) {
            let text = format!(
                "metadata 'version' is {version}, which this build does not read: versions {VERSION} and \
                 {PACKED_VERSION} are supported"
            );
            return Err(malformed(text));
        }
        if found == DICTIONARY_FORMAT && version != VERSION {
            return Err(malformed(format!(
                "metadata 'version' is {version}, and a dictionary's is {VERSION}"
            )));
        }
        if extent == Extent::First && version != PACKED_VERSION {
            let text = format!(
                "version {version} of the format is only read whole; what is written as version \
                 {PACKED_VERSION}, the layout 'packed', can be read from its first bytes"
            );
            return Err(malformed(text));
        }
        let (stored, expected) = match version {
            PACKED_VERSION if checked.has(tensor::HEAD) => {
                let (sum, head) = checked.sealed_head()?;
                let mut crc = crc32::Hasher::new_with_initial_len(header_checksum, data_start as u64);
                crc.update(head);
                (vec![sum], crc.finalize())
            }
            _ => (checked.values::<u32>(tensor::HEADER_CHECKSUM, Dtype::U32, &[1])?, header_checksum),
        };
        if stored != [expected] {
            return Err(format(FormatError::Checksum { covered: "header".to_owned() }));
        }
        checked.verify_tensors()?;
        Ok(checked)
    }

    fn verify_tensors(&self) -> Result<()> {
        // The ranges of packed data have checksums of their own, so each range can be checked alone.
        let (packed, elsewhere): (bool, &[&str]) = match self.is_packed() && self.has(tensor::HEAD) {
            true => (true, &[tensor::HEAD, tensor::DATA]),
            false => (false, &[tensor::HEADER_CHECKSUM]),
        };
        let sums = match packed && !self.has_text(key::CHECKSUMS) {
            true => Json::Object(Vec::new()),
            false => self.json(key::CHECKSUMS, |sums| {
                sums.members()?.iter().all(|(_, sum)| sum.text().is_some()).then(|| sums.clone())
            })?,
        };
        let mut names: Vec<&str> = self.names().filter(|name| !elsewhere.contains(name)).collect();
        let mut summed = sums.members().unwrap_or_default().iter().map(|(name, _)| name.as_str());
        if let Some(name) = summed.find(|name| names.binary_search(name).is_err()) {
            let why = match elsewhere.contains(&name) {
                true => "whose checksum is elsewhere",
                false => "which is no tensor",
            };
            return Err(self.malformed(format!("metadata 'checksums' names '{name}', {why}")));
        }
        // The sums of all tensors must be listed, also in a first part of a file.
        let listed = |name: &str| sums.get(name).and_then(Json::text).unwrap_or_default();
        if let Some(name) = names.iter().find(|name| !is_sum(listed(name))) {
            let text =
                format!("metadata 'checksums' lacks tensor '{name}', or has no 8 digits 0-9 or a-f of it");
            return Err(self.malformed(text));
        }
        names.retain(|name| self.is_there(name));
        let found = map_chunks(names.len(), 1, |range| {
            let name = names[range.start];
            self.tensor(name).map(|t| format!("{:08x}", crc32::hash(t.data)))
        });
        for (name, sum) in names.iter().zip(found) {
            if sum.ok().as_deref() != Some(listed(name)) {
                return Err(Error::format(&self.file, FormatError::Checksum { covered: (*name).to_owned() }));
            }
        }
        Ok(())
    }

    /// Returns the checksum of the header and of the head of a packed file, and the bytes of the head.
    pub(super) fn sealed_head(&self) -> Result<(u32, &[u8])> {
        let len = self.list_len(tensor::HEAD)?;
        let bytes = self.data(tensor::HEAD, Dtype::U8, &[len])?;
        let (sum, head) = bytes
            .split_first_chunk()
            .ok_or_else(|| self.malformed("tensor 'packed.head' is shorter than its checksum"))?;
        Ok((u32::from_le_bytes(*sum), head))
    }

    pub(super) fn malformed(&self, text: impl Into<String>) -> Error {
        Error::malformed(&self.file, text)
    }

    /// Returns whether all bytes of the file are there.
    pub(super) fn is_whole(&self) -> bool {
        self.bytes().len() as u64 == self.file_bytes
    }

    /// Returns whether all bytes of the tensor `name` are there.
    fn is_there(&self, name: &str) -> bool {
        self.header
            .info(name)
            .is_some_and(|tensor| tensor.data_offsets.end <= self.bytes().len() - self.data_start)
    }

    /// Returns the position at which the tensor `name` starts in the file, its length, and its first bytes, as many as are
    /// there.
    pub(super) fn first_of(&self, name: &str) -> Option<(u64, u64, &[u8])> {
        let Range { start, end } = self.header.info(name)?.data_offsets;
        let at = |offset: usize| self.data_start.saturating_add(offset);
        let there = |offset: usize| at(offset).min(self.bytes().len());
        Some((at(start) as u64, (end - start) as u64, self.bytes().get(there(start)..there(end))?))
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.header.info(name).is_some()
    }

    /// Returns the metadata entry `key`.
    pub(super) fn text(&self, key: &str) -> Result<&str> {
        self.header.text(key).ok_or_else(|| self.malformed(format!("metadata '{key}' is missing")))
    }

    /// Returns the metadata entry `key` as a number, or as `true` or `false`.
    pub(super) fn number<T: std::str::FromStr>(&self, key: &str) -> Result<T> {
        let text = self.text(key)?;
        text.parse().ok().filter(|_| is_value(text)).ok_or_else(|| self.wrong_value(key, text))
    }

    #[cold]
    fn wrong_value(&self, key: &str, text: &str) -> Error {
        self.malformed(format!("metadata '{key}' is '{text}'"))
    }

    /// Returns the metadata entry `key` as a number, or as `true` or `false`; `None` if it is missing.
    pub(super) fn optional<T: std::str::FromStr>(&self, key: &str) -> Result<Option<T>> {
        self.has_text(key).then(|| self.number(key)).transpose()
    }

    /// Returns whether the file is packed. In packed files, many metadata entries may be missing.
    pub(super) fn is_packed(&self) -> bool {
        self.number::<u64>(key::VERSION).is_ok_and(|version| version == PACKED_VERSION)
    }

    /// Returns the metadata entry `key` as a number, or as `true` or `false`. In packed files, a missing entry has its
    /// default.
    pub(super) fn number_or_default<T: std::str::FromStr + Default>(&self, key: &str) -> Result<T> {
        match self.is_packed() {
            true => Ok(self.optional(key)?.unwrap_or_default()),
            false => self.number(key),
        }
    }

    /// Returns whether there is a metadata entry `key`.
    pub(super) fn has_text(&self, key: &str) -> bool {
        self.header.text(key).is_some()
    }

    /// Returns the result of `take` for the JSON in the metadata entry `key`. If `take` returns `None`, the entry is
    /// malformed.
    pub(super) fn json<T>(&self, key: &str, take: impl FnOnce(&Json) -> Option<T>) -> Result<T> {
        let parsed = Json::parse(self.text(key)?.as_bytes());
        let taken =
            parsed.and_then(|json| take(&json).ok_or_else(|| "a member is not what it should be".to_owned()));
        taken.map_err(|error| self.malformed(format!("metadata '{key}': {error}")))
    }

    /// Returns the names of all tensors, sorted.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.header.names()
    }

    /// Returns the names of all tensors, in the order in which the tensors lie.
    pub(super) fn names_by_offset(&self) -> Vec<&str> {
        self.header.by_offset().into_iter().map(|(name, _)| name.as_str()).collect()
    }

    /// Returns all bytes of the file that are there.
    pub(super) fn bytes(&self) -> &[u8] {
        (*self.bytes).as_ref()
    }

    pub(super) fn tensor(&self, name: &str) -> Result<StoredTensor<'_>> {
        let missing = || self.malformed(format!("tensor '{name}' is missing"));
        let TensorInfo { dtype, shape, data_offsets: Range { start, end } } =
            self.header.info(name).ok_or_else(missing)?;
        let (start, end) = (self.data_start.saturating_add(*start), self.data_start.saturating_add(*end));
        let data = self.bytes().get(start..end).ok_or_else(|| {
            let (what, found) = (format!("tensor '{name}'"), self.bytes().len() as u64);
            Error::format(&self.file, FormatError::Truncated { what, expected: end as u64, found })
        })?;
        Ok(StoredTensor { dtype: *dtype, shape, data })
    }

    /// Refuses the tensor `name` unless it is a list of bytes. The header alone says so, so the bytes need not be there.
    pub(super) fn must_be_bytes(&self, name: &str) -> Result<()> {
        match self.header.info(name) {
            Some(TensorInfo { dtype: Dtype::U8, shape, .. }) if shape.len() == 1 => Ok(()),
            Some(_) => Err(self.malformed(format!("tensor '{name}' is not U8 of one dimension"))),
            None => Err(self.malformed(format!("tensor '{name}' is missing"))),
        }
    }

    /// Returns the length of the tensor `name`, which must have one dimension.
    pub(super) fn list_len(&self, name: &str) -> Result<usize> {
        match self.tensor(name)?.shape {
            [len] => Ok(*len),
            shape => Err(self.malformed(format!("tensor '{name}' has shape {shape:?}"))),
        }
    }

    /// Refuses tensors that are neither `known` nor to be ignored. `whose` ends the message.
    pub(super) fn refuse_unknown(&self, known: impl Fn(&str) -> bool, whose: &str) -> Result<()> {
        let summed = !self.is_packed();
        let ignored =
            |name: &str| (summed && name == tensor::HEADER_CHECKSUM) || name.starts_with(IGNORED_PREFIX);
        match self.names().find(|name| !ignored(name) && !known(name)) {
            Some(name) => Err(self.malformed(format!("tensor '{name}' is not known {whose}"))),
            None => Ok(()),
        }
    }

    /// Returns the bytes of the tensor `name`, which must have this type and shape.
    pub(super) fn data(&self, name: &str, dtype: Dtype, shape: &[usize]) -> Result<&[u8]> {
        let found = self.tensor(name)?;
        if found.dtype != dtype || found.shape != shape {
            let text = format!(
                "tensor '{name}' is {:?} {:?}, expected {dtype:?} {shape:?}",
                found.dtype, found.shape
            );
            return Err(self.malformed(text));
        }
        Ok(found.data)
    }

    /// Returns a copy of the tensor `name`, which must have this type and shape.
    pub(super) fn values<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(
        &self,
        name: &str,
        dtype: Dtype,
        shape: &[usize],
    ) -> Result<Vec<T>> {
        Ok(bytemuck::allocation::pod_collect_to_vec(self.data(name, dtype, shape)?))
    }

    /// Returns a copy of rows `range` of the tensor `name`, which must have this type and shape.
    pub(super) fn rows<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(
        &self,
        name: &str,
        dtype: Dtype,
        shape: &[usize],
        range: &Range<usize>,
    ) -> Result<Vec<T>> {
        let row = shape.iter().skip(1).product::<usize>() * (dtype.bitsize() / 8);
        let data = self.data(name, dtype, shape)?.get(range.start * row..range.end * row);
        let data = data.ok_or_else(|| self.malformed(format!("tensor '{name}' is too short")))?;
        Ok(bytemuck::allocation::pod_collect_to_vec(data))
    }
}

/// Returns whether `text` is a checksum as metadata list it: eight hexadecimal digits in lower case.
fn is_sum(text: &str) -> bool {
    text.len() == 8 && text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
}

/// Returns whether `text` is a number as JSON writes it, or `true` or `false`.
fn is_value(text: &str) -> bool {
    json::is_number(text) || matches!(text, "true" | "false")
}

/// Returns the position at which the header ends, in a file that begins with `bytes`. The length before the header gives
/// it.
pub(super) fn header_end(file: &str, bytes: &[u8], limits: &Limits) -> Result<u64> {
    let length = bytes.first_chunk::<LENGTH_BYTES>().ok_or_else(|| {
        let (what, found) = ("the header's length".to_owned(), bytes.len() as u64);
        Error::format(file, FormatError::Truncated { what, expected: LENGTH_BYTES as u64, found })
    })?;
    let length = u64::from_le_bytes(*length);
    limits.check_header(file, length)?;
    Ok(length.saturating_add(LENGTH_BYTES as u64))
}

/// Returns the position at which the last tensor ends that is needed before any data, in a file whose header ends at
/// `header_end`.
pub(super) fn start_end(file: &str, bytes: &[u8], header_end: u64) -> Result<u64> {
    let header = usize::try_from(header_end).ok().and_then(|end| bytes.get(..end)).unwrap_or_default();
    let header = read_header(file, header)?;
    let end = |name| header.info(name).map_or(0, |tensor| tensor.data_offsets.end as u64);
    Ok(header_end.saturating_add(end(tensor::HEADER_CHECKSUM).max(end(tensor::HEAD))))
}

/// Reads the header from `bytes`, which begin with its length.
fn read_header(file: &str, bytes: &[u8]) -> Result<Header> {
    Header::read(bytes.get(LENGTH_BYTES..).unwrap_or_default()).map_err(|e| Error::malformed(file, e))
}

/// One tensor of a file.
#[derive(Debug, Clone, Copy)]
pub(super) struct StoredTensor<'a> {
    pub(super) dtype: Dtype,
    pub(super) shape: &'a [usize],
    pub(super) data: &'a [u8],
}
