//! Tensors and metadata written as a safetensors file with checksums.

use std::collections::BTreeMap;
use std::io::{self, Write};

use safetensors::Dtype;

use super::schema::{HEADER_ALIGNMENT, LENGTH_BYTES, key, tensor};
use crate::support::spill::{Spilled, Woven};

#[cfg(target_endian = "big")]
compile_error!("tensors are little-endian and written as they lie in memory");

/// Words made at a time.
const BLOCK: usize = 1 << 14;

/// What a file says of itself, by key.
pub(super) type Metadata = BTreeMap<&'static str, String>;

/// One tensor to write.
#[derive(Debug)]
pub(super) struct Tensor<'a> {
    pub(super) name: String,
    dtype: Dtype,
    shape: Vec<usize>,
    source: Source<'a>,
    /// Whether its checksum is in the metadata.
    summed: bool,
}

/// Makes the words of a tensor one after the other.
type Words<'a> = Box<dyn Fn() -> Box<dyn Iterator<Item = u32> + 'a> + 'a>;

/// Where the bytes of a tensor come from.
pub(super) enum Source<'a> {
    /// As they lie in memory.
    Bytes(&'a [u8]),
    Spilled(Spilled),
    /// Their checksums are elsewhere.
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
    /// `values` as they lie in memory.
    pub(super) fn of<T: bytemuck::NoUninit>(values: &'a [T]) -> Self {
        Self::Bytes(bytemuck::cast_slice(values))
    }

    pub(super) fn words<I: Iterator<Item = u32> + 'a>(make: impl Fn() -> I + 'a) -> Self {
        Self::Words(Box::new(move || Box::new(make())))
    }
}

impl<'a> Tensor<'a> {
    pub(super) fn new(name: &str, dtype: Dtype, shape: &[usize], source: Source<'a>) -> Self {
        Self { name: name.to_owned(), dtype, shape: shape.to_vec(), source, summed: true }
    }

    /// The same, with checksums that are elsewhere in the file.
    pub(super) fn summed_elsewhere(self) -> Self {
        Self { summed: false, ..self }
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
    header_checksum: [u8; 4],
    tensors: Vec<Tensor<'a>>,
}

impl<'a> Draft<'a> {
    /// Puts `tensors` in order of alignment, computes all checksums and makes the header.
    pub(super) fn new(mut metadata: Metadata, mut tensors: Vec<Tensor<'a>>) -> Self {
        // Each tensor then starts at a multiple of its entry size, and there are no holes.
        tensors.sort_by_key(|t| std::cmp::Reverse(t.dtype.bitsize()));
        let mut sums = BTreeMap::new();
        for tensor in tensors.iter().filter(|tensor| tensor.summed) {
            let mut crc = crc32fast::Hasher::new();
            match &tensor.source {
                Source::Bytes(bytes) => crc.update(bytes),
                Source::Owned(bytes) => crc.update(bytes),
                Source::Woven(_) => {}
                Source::Spilled(spilled) => crc = crc32fast::Hasher::new_with_initial(spilled.checksum),
                Source::Words(make) => {
                    // Hashing cannot fail.
                    let _ = each_block(make(), |block| {
                        crc.update(block);
                        Ok(())
                    });
                }
            }
            sums.insert(tensor.name.clone(), format!("{:08x}", crc.finalize()));
        }
        metadata.insert(key::CHECKSUMS, json(&sums));
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

    /// Bytes of the length, the JSON and the header's checksum.
    pub(super) fn header_bytes(&self) -> u64 {
        (self.header.len() + self.header_checksum.len()) as u64
    }

    /// Writes the whole file.
    pub(super) fn write_to(self, writer: &mut dyn Write) -> io::Result<()> {
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

/// JSON of a value that cannot fail to serialise: strings, numbers, lists and maps of them.
pub(super) fn json<T: serde::Serialize + ?Sized>(value: &T) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// The metadata every file begins with.
pub(super) fn preamble(format: &str, version: u64) -> Metadata {
    BTreeMap::from([
        (key::FORMAT, format.to_owned()),
        (key::VERSION, version.to_string()),
        (key::GENERATOR, "lexisplat".to_owned()),
    ])
}
