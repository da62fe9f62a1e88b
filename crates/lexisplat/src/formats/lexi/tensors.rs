//! Tensors and metadata written as a safetensors file with checksums.

use std::collections::BTreeMap;
use std::io::{self, Write};

use safetensors::Dtype;

use super::schema::{HEADER_ALIGNMENT, LENGTH_BYTES, key, tensor};
use crate::support::crc32;
use crate::support::spill::{Spilled, Woven};

#[cfg(target_endian = "big")]
compile_error!("tensors are little-endian and written as they lie in memory");

/// Number of words made at a time.
const BLOCK: usize = 1 << 14;

/// The metadata of a file, by key.
pub(super) type Metadata = BTreeMap<&'static str, String>;

/// One tensor to write.
#[derive(Debug)]
pub(super) struct Tensor<'a> {
    pub(super) name: String,
    dtype: Dtype,
    shape: Vec<usize>,
    source: Source<'a>,
    sum: Sum,
}

/// The part of a file that holds the checksum of a tensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sum {
    /// In the metadata.
    Listed,
    /// In bytes that depend on the meaning of the tensor.
    Elsewhere,
    /// In the first four bytes of the tensor, which come before the bytes of the source. The checksum covers the
    /// header and the source. The file then has no tensor with the checksum of the header.
    Sealed,
}

/// Number of bytes of a checksum.
const SUM_BYTES: usize = 4;

/// A function that makes the words of a tensor one after the other.
type Words<'a> = Box<dyn Fn() -> Box<dyn Iterator<Item = u32> + 'a> + 'a>;

/// The source of the bytes of a tensor.
pub(super) enum Source<'a> {
    /// Bytes as they lie in memory.
    Bytes(&'a [u8]),
    Spilled(Spilled),
    /// Spilled bytes in pieces. Their checksums are elsewhere.
    Woven(Woven),
    Owned(Vec<u8>),
    /// Words that are made twice: once for the checksum and once for the file.
    Words(Words<'a>),
}

impl std::fmt::Debug for Source<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Bytes(_) => "Bytes",
            Self::Spilled(_) => "Spilled",
            Self::Woven(_) => "Woven",
            Self::Owned(_) => "Owned",
            Self::Words(_) => "Words",
        })
    }
}

impl<'a> Source<'a> {
    /// Makes a source of `values` as they lie in memory.
    pub(super) fn of<T: bytemuck::NoUninit>(values: &'a [T]) -> Self {
        Self::Bytes(bytemuck::cast_slice(values))
    }

    /// Returns `crc` with the bytes of the source added.
    fn hashed(&self, mut crc: crc32::Hasher) -> crc32::Hasher {
        match self {
            Self::Bytes(bytes) => crc.update(bytes),
            Self::Owned(bytes) => crc.update(bytes),
            Self::Woven(_) => {}
            // Spilled bytes are hashed first, so `crc` has no bytes before them.
            Self::Spilled(spilled) => crc = crc32::Hasher::new_with_initial(spilled.checksum),
            Self::Words(make) => {
                // Hashing cannot fail.
                let _ = each_block(make(), |block| {
                    crc.update(block);
                    Ok(())
                });
            }
        }
        crc
    }

    pub(super) fn words<I: Iterator<Item = u32> + 'a>(make: impl Fn() -> I + 'a) -> Self {
        Self::Words(Box::new(move || Box::new(make())))
    }
}

impl<'a> Tensor<'a> {
    pub(super) fn new(name: &str, dtype: Dtype, shape: &[usize], source: Source<'a>) -> Self {
        Self { name: name.to_owned(), dtype, shape: shape.to_vec(), source, sum: Sum::Listed }
    }

    /// Returns the tensor with checksums that are elsewhere in the file.
    pub(super) fn summed_elsewhere(self) -> Self {
        Self { sum: Sum::Elsewhere, ..self }
    }

    /// Returns the tensor, which must be of bytes, with the checksum of itself and of the header before its bytes. No
    /// tensor before it may be wider.
    pub(super) fn sealed(self) -> Self {
        Self { shape: vec![self.bytes() + SUM_BYTES], sum: Sum::Sealed, ..self }
    }

    pub(super) fn bytes(&self) -> usize {
        self.shape.iter().product::<usize>() * (self.dtype.bitsize() / 8)
    }
}

fn each_block(
    mut words: impl Iterator<Item = u32>,
    mut f: impl FnMut(&[u8]) -> io::Result<()>,
) -> io::Result<()> {
    let mut block: Vec<u32> = Vec::with_capacity(BLOCK);
    loop {
        block.clear();
        block.extend(words.by_ref().take(BLOCK));
        if block.is_empty() {
            return Ok(());
        }
        f(bytemuck::cast_slice(&block))?;
    }
}

/// A file whose header is made and whose tensors are in order.
#[derive(Debug)]
pub(super) struct Draft<'a> {
    header: Vec<u8>,
    header_checksum: [u8; SUM_BYTES],
    tensors: Vec<Tensor<'a>>,
}

impl<'a> Draft<'a> {
    /// Puts `tensors` in order of alignment, computes all checksums and makes the header.
    pub(super) fn new(mut metadata: Metadata, mut tensors: Vec<Tensor<'a>>) -> Self {
        // Each tensor then starts at a multiple of its entry size, and there are no holes.
        tensors.sort_by_key(|t| std::cmp::Reverse(t.dtype.bitsize()));
        let mut sums = BTreeMap::new();
        for tensor in tensors.iter().filter(|tensor| tensor.sum == Sum::Listed) {
            let crc = tensor.source.hashed(crc32::Hasher::new());
            sums.insert(tensor.name.clone(), format!("{:08x}", crc.finalize()));
        }
        let sealed = tensors.iter().position(|tensor| tensor.sum == Sum::Sealed);
        if sealed.is_none() || !sums.is_empty() {
            metadata.insert(key::CHECKSUMS, json(&sums));
        }
        let mut text = format!("{{\"__metadata__\":{}", json(&metadata));
        let mut offset = 0;
        let sum_shape: &[usize] = &[1];
        let entries = tensors
            .iter()
            .map(|t| (t.name.as_str(), t.dtype, t.shape.as_slice(), t.bytes()))
            .chain(sealed.is_none().then_some((tensor::HEADER_CHECKSUM, Dtype::U32, sum_shape, SUM_BYTES)));
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
        let mut crc = crc32::Hasher::new();
        crc.update(&header);
        if let Some(tensor) = sealed.and_then(|sealed| tensors.get(sealed)) {
            crc = tensor.source.hashed(crc);
        }
        let header_checksum = crc.finalize().to_le_bytes();
        Self { header, header_checksum, tensors }
    }

    /// Returns the number of bytes of the length, the JSON, and the header's checksum unless a sealed tensor holds it.
    pub(super) fn header_bytes(&self) -> u64 {
        let is_sealed = self.tensors.iter().any(|tensor| tensor.sum == Sum::Sealed);
        (self.header.len() + if is_sealed { 0 } else { SUM_BYTES }) as u64
    }

    /// Writes the whole file.
    pub(super) fn write_to(self, writer: &mut dyn Write) -> io::Result<()> {
        writer.write_all(&self.header)?;
        let mut checksum = Some(self.header_checksum);
        let is_sealed = self.tensors.iter().any(|tensor| tensor.sum == Sum::Sealed);
        for tensor in self.tensors {
            let is_here = tensor.sum == Sum::Sealed || (!is_sealed && tensor.dtype.bitsize() < 32);
            if is_here && let Some(bytes) = checksum.take() {
                writer.write_all(&bytes)?;
            }
            match tensor.source {
                Source::Bytes(bytes) => writer.write_all(bytes)?,
                Source::Owned(bytes) => writer.write_all(&bytes)?,
                Source::Woven(woven) => woven.copy_to(writer)?,
                Source::Spilled(spilled) => spilled.copy_to(writer)?,
                Source::Words(make) => each_block(make(), |block| writer.write_all(block))?,
            }
        }
        if let Some(bytes) = checksum {
            writer.write_all(&bytes)?;
        }
        Ok(())
    }
}

/// Returns the JSON of a value that cannot fail to serialise: strings, numbers, lists and maps of them.
pub(super) fn json<T: serde::Serialize + ?Sized>(value: &T) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// Returns the metadata that every file begins with.
pub(super) fn preamble(format: &str, version: u64) -> Metadata {
    BTreeMap::from([
        (key::FORMAT, format.to_owned()),
        (key::VERSION, version.to_string()),
        (key::GENERATOR, "lexisplat".to_owned()),
    ])
}
