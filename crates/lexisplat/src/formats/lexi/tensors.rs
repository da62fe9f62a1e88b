//! A list of tensors with their metadata: written as safetensors with checksums, and read back checked.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::ops::Range;

use safetensors::tensor::{SafeTensorError, TensorView};
use safetensors::{Dtype, SafeTensors};

use super::schema::{HEADER_ALIGNMENT, LENGTH_BYTES, MAX_VERSION, key, tensor};
use crate::formats::kind::FileKind;
use crate::support::error::{Error, FormatError, Result};
use crate::support::limits::Limits;
use crate::support::parallel::map_chunks;
use crate::support::progress::Progress;
use crate::support::sink::Sink;
use crate::support::spill::Spilled;

#[cfg(target_endian = "big")]
compile_error!("tensors are little-endian and written as they lie in memory");

/// Entries converted at a time when a tensor is not stored as it lies in memory.
const BLOCK: usize = 1 << 14;

/// One tensor to write.
pub(super) struct Tensor<'a> {
    pub(super) name: String,
    pub(super) dtype: Dtype,
    pub(super) shape: Vec<usize>,
    pub(super) source: Source<'a>,
}

/// Where a tensor's bytes come from.
pub(super) enum Source<'a> {
    /// As they lie in memory.
    Bytes(&'a [u8]),
    /// Set aside in a temporary file.
    Spilled(Spilled),
    /// Made entry by entry.
    I32(Box<dyn Iterator<Item = i32> + 'a>, Box<dyn Iterator<Item = i32> + 'a>),
}

impl<'a> Source<'a> {
    /// Entries made twice: once for the checksum, once for the file.
    pub(super) fn i32(make: impl Fn() -> Box<dyn Iterator<Item = i32> + 'a>) -> Self {
        Self::I32(make(), make())
    }
}

impl Tensor<'_> {
    /// A tensor over `values` as they lie in memory.
    pub(super) fn plain<'a, T: bytemuck::NoUninit>(
        name: &str,
        dtype: Dtype,
        shape: &[usize],
        values: &'a [T],
    ) -> Tensor<'a> {
        let source = Source::Bytes(bytemuck::cast_slice(values));
        Tensor { name: name.to_owned(), dtype, shape: shape.to_vec(), source }
    }

    /// A tensor whose bytes were set aside.
    pub(super) fn spilled(name: &str, dtype: Dtype, shape: &[usize], spilled: Spilled) -> Self {
        Self { name: name.to_owned(), dtype, shape: shape.to_vec(), source: Source::Spilled(spilled) }
    }

    pub(super) fn bytes(&self) -> usize {
        self.shape.iter().product::<usize>() * (self.dtype.bitsize() / 8)
    }
}

fn each_block(
    mut entries: &mut dyn Iterator<Item = i32>,
    mut f: impl FnMut(&[u8]) -> io::Result<()>,
) -> io::Result<()> {
    let mut block = Vec::with_capacity(BLOCK);
    loop {
        block.clear();
        block.extend((&mut entries).take(BLOCK));
        if block.is_empty() {
            return Ok(());
        }
        f(bytemuck::cast_slice(&block))?;
    }
}

/// A file about to be written: the header made, the tensors in order.
pub(super) struct Draft<'a> {
    header: Vec<u8>,
    header_checksum: [u8; 4],
    tensors: Vec<Tensor<'a>>,
}

impl<'a> Draft<'a> {
    /// Puts `tensors` in order of alignment, computes all checksums and makes the header.
    pub(super) fn new(mut metadata: BTreeMap<String, String>, mut tensors: Vec<Tensor<'a>>) -> Self {
        // Each tensor then starts at a multiple of its entry size, and there are no holes.
        tensors.sort_by_key(|t| std::cmp::Reverse(t.dtype.bitsize()));
        let mut sums = BTreeMap::new();
        for tensor in &mut tensors {
            let mut crc = crc32fast::Hasher::new();
            match &mut tensor.source {
                Source::Bytes(bytes) => crc.update(bytes),
                Source::Spilled(spilled) => crc = crc32fast::Hasher::new_with_initial(spilled.checksum),
                Source::I32(entries, _) => {
                    // Hashing cannot fail.
                    let _ = each_block(entries, |block| {
                        crc.update(block);
                        Ok(())
                    });
                }
            }
            sums.insert(tensor.name.clone(), format!("{:08x}", crc.finalize()));
        }
        metadata.insert(key::CHECKSUMS.to_owned(), json(&sums));
        let mut text = format!("{{\"__metadata__\":{}", json(&metadata));
        let mut offset = 0;
        let sum_shape: &[usize] = &[1];
        let entries = tensors
            .iter()
            .map(|t| (t.name.as_str(), t.dtype, t.shape.as_slice(), t.bytes()))
            .chain([(tensor::HEADER_CHECKSUM, Dtype::U32, sum_shape, 4)]);
        // The checksum is four bytes, so it goes before the first narrower tensor.
        let mut entries: Vec<_> = entries.collect();
        entries.sort_by_key(|e| std::cmp::Reverse(e.1.bitsize()));
        for (name, dtype, shape, bytes) in entries {
            let end = offset + bytes;
            text.push_str(&format!(
                ",{}:{{\"dtype\":\"{dtype:?}\",\"shape\":{},\"data_offsets\":[{offset},{end}]}}",
                json(&name),
                json(&shape)
            ));
            offset = end;
        }
        text.push('}');
        while !(LENGTH_BYTES + text.len()).is_multiple_of(HEADER_ALIGNMENT) {
            text.push(' ');
        }
        let mut header = (text.len() as u64).to_le_bytes().to_vec();
        header.extend_from_slice(text.as_bytes());
        let header_checksum = crc32fast::hash(&header).to_le_bytes();
        Self { header, header_checksum, tensors }
    }

    /// Bytes of each tensor in the order given, and of the header under `header`. They sum to the file's
    /// size.
    pub(super) fn sizes(metadata: BTreeMap<String, String>, tensors: Vec<Tensor<'a>>) -> Vec<(String, u64)> {
        let mut out: Vec<(String, u64)> =
            tensors.iter().map(|t| (t.name.clone(), t.bytes() as u64)).collect();
        out.push(("header".to_owned(), Self::new(metadata, tensors).header_bytes()));
        out
    }

    /// Writes the file. Returns its size in bytes.
    pub(super) fn save(self, sink: Sink<'_>, progress: &dyn Progress) -> Result<u64> {
        let bytes = self.header_bytes() + self.tensors.iter().map(|t| t.bytes() as u64).sum::<u64>();
        sink.write(bytes, progress, |writer, named| self.write_to(writer).map_err(named))
    }

    /// Bytes of the length, the JSON and the header's checksum.
    pub(super) fn header_bytes(&self) -> u64 {
        (self.header.len() + self.header_checksum.len()) as u64
    }

    fn write_to(self, writer: &mut dyn Write) -> io::Result<()> {
        writer.write_all(&self.header)?;
        let mut checksum = Some(self.header_checksum);
        for tensor in self.tensors {
            if tensor.dtype.bitsize() < 32
                && let Some(bytes) = checksum.take()
            {
                writer.write_all(&bytes)?;
            }
            match tensor.source {
                Source::Bytes(bytes) => writer.write_all(bytes)?,
                Source::Spilled(spilled) => spilled.copy_to(writer)?,
                Source::I32(_, mut entries) => each_block(&mut *entries, |block| writer.write_all(block))?,
            }
        }
        if let Some(bytes) = checksum {
            writer.write_all(&bytes)?;
        }
        Ok(())
    }
}

/// JSON of a value that cannot fail to serialise: strings, numbers, lists and maps of them.
fn json<T: serde::Serialize + ?Sized>(value: &T) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// A file read: its header parsed and all checksums verified.
#[derive(Debug)]
pub(super) struct Checked<'a> {
    /// The file, as the caller named it.
    pub(super) file: &'a str,
    tensors: SafeTensors<'a>,
    metadata: BTreeMap<String, String>,
}

impl<'a> Checked<'a> {
    /// Parses `bytes` and verifies everything that does not need to know what the tensors mean.
    pub(super) fn open(file: &'a str, bytes: &'a [u8], formats: &[&str], limits: &Limits) -> Result<Self> {
        FileKind::Lexi.expect(file, bytes)?;
        let format = |problem| Error::format(file, problem);
        let malformed = |text: String| Error::malformed(file, text);
        let Some(length) = bytes.first_chunk::<LENGTH_BYTES>() else {
            let what = "the header's length".to_owned();
            let problem =
                FormatError::Truncated { what, expected: LENGTH_BYTES as u64, found: bytes.len() as u64 };
            return Err(format(problem));
        };
        let length = u64::from_le_bytes(*length);
        limits.check_header(file, length)?;
        let end = length + LENGTH_BYTES as u64;
        let header = usize::try_from(end).ok().and_then(|end| bytes.get(..end)).ok_or_else(|| {
            let found = bytes.len() as u64;
            format(FormatError::Truncated { what: "the header".to_owned(), expected: end, found })
        })?;
        let explain = |error: SafeTensorError| match error {
            SafeTensorError::MetadataIncompleteBuffer => {
                malformed(format!("truncated or too long: {} bytes do not match the header", bytes.len()))
            }
            other => malformed(format!("not a valid safetensors file: {other}")),
        };
        let (_, parsed) = SafeTensors::read_metadata(bytes).map_err(explain)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(explain)?;
        let metadata: BTreeMap<String, String> =
            parsed.metadata().iter().flatten().map(|(k, v)| (k.clone(), v.clone())).collect();
        let checked = Self { file, tensors, metadata };

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
        if version == 0 {
            return Err(malformed("metadata 'version' is 0".to_owned()));
        }
        let stored = checked.values::<u32>(tensor::HEADER_CHECKSUM, Dtype::U32, &[1])?;
        if stored != [crc32fast::hash(header)] {
            return Err(format(FormatError::Checksum { part: "header".to_owned() }));
        }
        checked.verify_tensors()?;
        Ok(checked)
    }

    fn verify_tensors(&self) -> Result<()> {
        let sums: BTreeMap<String, String> = serde_json::from_str(self.text(key::CHECKSUMS)?)
            .map_err(|e| self.malformed(format!("metadata 'checksums': {e}")))?;
        let mut names = self.tensors.names();
        names.retain(|&name| name != tensor::HEADER_CHECKSUM);
        names.sort_unstable();
        if let Some(name) = sums.keys().find(|name| names.binary_search(&name.as_str()).is_err()) {
            return Err(self.malformed(format!("metadata 'checksums' names '{name}', which is no tensor")));
        }
        let found = map_chunks(names.len(), 1, |range| {
            let name = names[range.start];
            self.tensors.tensor(name).map(|t| format!("{:08x}", crc32fast::hash(t.data())))
        });
        for (name, sum) in names.iter().zip(found) {
            let expected = sums
                .get(*name)
                .ok_or_else(|| self.malformed(format!("metadata 'checksums' lacks tensor '{name}'")))?;
            if sum.ok().as_ref() != Some(expected) {
                return Err(Error::format(self.file, FormatError::Checksum { part: (*name).to_owned() }));
            }
        }
        Ok(())
    }

    pub(super) fn malformed(&self, text: impl Into<String>) -> Error {
        Error::malformed(self.file, text)
    }

    /// Names of all tensors, sorted.
    pub(super) fn names(&self) -> Vec<&str> {
        let mut names = self.tensors.names();
        names.sort_unstable();
        names
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.tensors.names().contains(&name)
    }

    /// The metadata entry `key`.
    pub(super) fn text(&self, key: &str) -> Result<&str> {
        self.metadata
            .get(key)
            .map(String::as_str)
            .ok_or_else(|| self.malformed(format!("metadata '{key}' is missing")))
    }

    /// The metadata entry `key` as a number or a name.
    pub(super) fn number<T: std::str::FromStr>(&self, key: &str) -> Result<T> {
        let text = self.text(key)?;
        text.parse().map_err(|_| self.malformed(format!("metadata '{key}' is '{text}'")))
    }

    /// The metadata entry `key`, if it is there.
    pub(super) fn optional<T: std::str::FromStr>(&self, key: &str) -> Result<Option<T>> {
        if self.metadata.contains_key(key) { self.number(key).map(Some) } else { Ok(None) }
    }

    pub(super) fn view(&self, name: &str) -> Result<TensorView<'a>> {
        self.tensors.tensor(name).map_err(|_| self.malformed(format!("tensor '{name}' is missing")))
    }

    /// The bytes of the tensor `name`, which must have this type and shape.
    pub(super) fn data(&self, name: &str, dtype: Dtype, shape: &[usize]) -> Result<&'a [u8]> {
        let view = self.view(name)?;
        if view.dtype() != dtype || view.shape() != shape {
            let text = format!(
                "tensor '{name}' is {:?} {:?}, expected {dtype:?} {shape:?}",
                view.dtype(),
                view.shape()
            );
            return Err(self.malformed(text));
        }
        Ok(view.data())
    }

    /// A copy of the tensor `name`, which must have this type and shape.
    pub(super) fn values<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(
        &self,
        name: &str,
        dtype: Dtype,
        shape: &[usize],
    ) -> Result<Vec<T>> {
        Ok(bytemuck::allocation::pod_collect_to_vec(self.data(name, dtype, shape)?))
    }

    /// A copy of rows `range` of the tensor `name`, which must have this type and shape.
    pub(super) fn part<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(
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

/// The metadata every file begins with.
pub(super) fn preamble(format: &str, version: u64) -> BTreeMap<String, String> {
    BTreeMap::from([
        (key::FORMAT.to_owned(), format.to_owned()),
        (key::VERSION.to_owned(), version.to_string()),
        (key::GENERATOR.to_owned(), "lexisplat".to_owned()),
    ])
}
