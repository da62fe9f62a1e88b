//! A .lexi file read a part at a time, for scenes larger than memory.

use std::ops::Range;

use safetensors::Dtype;

use super::exact::Exact;
use super::read::{checked, extras};
use super::schema::{LENGTH_BYTES, tensor};
use super::tensors::Checked;
use crate::packed::{CHUNK, Decoder, Packed, StreamBits, TargetRecord};
use crate::scene::sh::ShDegree;
use crate::scene::splats::{Extra, Geometry, SceneMeta, Splats};
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::{Layout, Model, Record};
use crate::support::error::Result;
use crate::support::limits::Limits;
use crate::support::memory_budget::{COUNT_BYTES, GEOMETRY_BYTES, MemoryBudget};
use crate::support::parallel::map_chunks;

/// Gaussians of a part of an exact layout: a multiple of a packed chunk.
const PART: usize = 2 * CHUNK;
/// Packed chunks decoded before they are handed on.
const CHUNKS_AT_ONCE: usize = 16;

/// A .lexi file whose Gaussians are decoded a part at a time. Everything but their codes was looked at.
#[derive(Debug)]
pub struct LexiChunks<'a> {
    kind: Kind<'a>,
    extras: Vec<Extra>,
    attribute_bytes: Vec<(String, u64)>,
}

#[derive(Debug)]
enum Kind<'a> {
    Exact(Box<Exact<'a>>),
    Packed(Box<PackedParts<'a>>),
}

/// A packed scene whose parts stay in the file.
#[derive(Debug)]
struct PackedParts<'a> {
    file: &'a str,
    file_bytes: u64,
    checked: Checked<'a>,
    /// Without extras, order and data.
    head: Packed,
    decoder: Decoder<'a>,
    order_kept: bool,
}

impl<'a> LexiChunks<'a> {
    /// Looks over the .lexi file in `bytes`, which errors call `file`.
    ///
    /// # Errors
    /// As [`read_bytes`](super::read_bytes), but what is wrong with the codes themselves, and what is over
    /// [`Limits::bytes`] and [`Limits::expansion`], is only found by [`Self::each`].
    pub fn open(file: &'a str, bytes: &'a [u8], limits: &Limits) -> Result<Self> {
        let (checked, layout) = checked(file, bytes, limits)?;
        let attribute_bytes = sizes(&checked, bytes)?;
        if layout != Layout::Packed {
            let exact = Exact::open(checked, bytes.len() as u64, limits)?;
            let extras = exact.extras()?;
            return Ok(Self { kind: Kind::Exact(Box::new(exact)), extras, attribute_bytes });
        }
        let head = super::packed::head(&checked, bytes.len() as u64, limits)?;
        let data = super::packed::data(&checked)?;
        let decoder = Decoder::new(&head, file, data).map_err(|e| e.of_file(file))?;
        let extras = extras(&checked, head.gaussians, &(0..0))?;
        let order_kept = checked.has(tensor::ORDER);
        let file_bytes = bytes.len() as u64;
        let parts = PackedParts { file, file_bytes, checked, head, decoder, order_kept };
        Ok(Self { kind: Kind::Packed(Box::new(parts)), extras, attribute_bytes })
    }

    /// Number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        match &self.kind {
            Kind::Exact(exact) => exact.len(),
            Kind::Packed(packed) => packed.head.gaussians,
        }
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// SH degree.
    #[must_use]
    pub fn degree(&self) -> ShDegree {
        self.dictionary().degree()
    }

    /// Comments and marks of the source.
    #[must_use]
    pub fn meta(&self) -> &SceneMeta {
        match &self.kind {
            Kind::Exact(exact) => &exact.meta,
            Kind::Packed(packed) => &packed.head.meta,
        }
    }

    /// How it was made and what it promises.
    #[must_use]
    pub fn record(&self) -> &Record {
        match &self.kind {
            Kind::Exact(exact) => &exact.record,
            Kind::Packed(packed) => &packed.head.record,
        }
    }

    /// The atoms.
    #[must_use]
    pub fn dictionary(&self) -> &Dictionary {
        match &self.kind {
            Kind::Exact(exact) => &exact.dictionary,
            Kind::Packed(packed) => &packed.decoder.dictionary,
        }
    }

    /// Whether a packed file knows the order of its source.
    #[must_use]
    pub fn order_kept(&self) -> bool {
        matches!(&self.kind, Kind::Packed(packed) if packed.order_kept)
    }

    /// What a packed file aimed at and reached, if something was.
    #[must_use]
    pub fn target(&self) -> Option<&TargetRecord> {
        match &self.kind {
            Kind::Exact(_) => None,
            Kind::Packed(packed) => packed.head.target.as_ref(),
        }
    }

    /// The GPU that looked at a packed scene, if it was not the CPU renderer.
    #[must_use]
    pub fn device(&self) -> Option<&str> {
        match &self.kind {
            Kind::Exact(_) => None,
            Kind::Packed(packed) => packed.head.device.as_deref(),
        }
    }

    /// Bytes of each tensor in the file, and of the header under `header`, as
    /// [`attribute_bytes`](super::attribute_bytes) and [`packed_tensor_bytes`](super::packed_tensor_bytes).
    #[must_use]
    pub fn attribute_bytes(&self) -> &[(String, u64)] {
        &self.attribute_bytes
    }

    /// Bytes that stand for SH-rest in an exact layout, as [`sh_bytes`](super::sh_bytes).
    #[must_use]
    pub fn sh_bytes(&self) -> u64 {
        self.attribute_bytes.iter().filter(|a| super::is_sh(&a.0)).map(|a| a.1).sum()
    }

    /// A dense scene like this one without Gaussians. Normals are left out.
    #[must_use]
    pub fn empty(&self) -> Splats {
        let geometry = Geometry { extras: self.extras.clone(), ..Geometry::default() };
        Splats { geometry, degree: self.degree(), sh_rest: Vec::new(), meta: self.meta().clone() }
    }

    /// For Gaussians `range` of a packed file whose order was kept their places in the source.
    ///
    /// # Errors
    /// [`crate::Error::Format`] if the order was not kept or the range ends after [`Self::len`].
    pub fn order(&self, range: Range<usize>) -> Result<Vec<u32>> {
        match &self.kind {
            Kind::Packed(packed) => {
                packed.checked.part(tensor::ORDER, Dtype::U32, &[packed.head.gaussians], &range)
            }
            Kind::Exact(exact) => Err(exact.no_order()),
        }
    }

    /// Hands all Gaussians to `take`, part after part in the order of the file: the number of the first one,
    /// and the part. Every part but the last is a multiple of [`CHUNK`] Gaussians long.
    ///
    /// # Errors
    /// As [`read_bytes`](super::read_bytes), and what `take` says.
    pub fn each(&self, take: &mut dyn FnMut(usize, Model) -> Result<()>) -> Result<()> {
        self.parts(false, take)?;
        Ok(())
    }

    /// [`Self::each`] with parts of `at_once` Gaussians where the layout is exact, for the fuzz targets.
    #[cfg(feature = "fuzzing")]
    #[doc(hidden)]
    pub fn each_of(&self, at_once: usize, take: &mut dyn FnMut(usize, Model) -> Result<()>) -> Result<()> {
        match &self.kind {
            Kind::Exact(exact) => exact_parts(exact, at_once.max(1), take),
            Kind::Packed(_) => self.each(take),
        }
    }

    /// [`Self::each`]; returns what the streams of a packed file take if `count_bits`.
    pub(crate) fn parts(
        &self,
        count_bits: bool,
        take: &mut dyn FnMut(usize, Model) -> Result<()>,
    ) -> Result<Vec<StreamBits>> {
        match &self.kind {
            Kind::Exact(exact) => {
                exact_parts(exact, PART, take)?;
                Ok(Vec::new())
            }
            Kind::Packed(packed) => packed.parts(count_bits, take),
        }
    }
}

fn exact_parts(
    exact: &Exact<'_>,
    at_once: usize,
    take: &mut dyn FnMut(usize, Model) -> Result<()>,
) -> Result<()> {
    for start in (0..exact.len()).step_by(at_once) {
        let (geometry, codes) = exact.part(start..exact.len().min(start + at_once))?;
        let (meta, dictionary) = (exact.meta.clone(), exact.dictionary.clone());
        take(start, Model { geometry, meta, dictionary, codes, record: exact.record.clone() })?;
    }
    Ok(())
}

impl PackedParts<'_> {
    fn parts(
        &self,
        count_bits: bool,
        take: &mut dyn FnMut(usize, Model) -> Result<()>,
    ) -> Result<Vec<StreamBits>> {
        let n = self.head.gaussians;
        let chunks = n.div_ceil(CHUNK);
        let extra_bytes = extras(&self.checked, n, &(0..0))?.iter().map(|e| e.values.width()).sum::<usize>();
        let mut bit_counts = self.decoder.dictionary_bits();
        for first in (0..chunks).step_by(CHUNKS_AT_ONCE) {
            let count = CHUNKS_AT_ONCE.min(chunks - first);
            let held = n.min((first + count) * CHUNK) - first * CHUNK;
            let budget = MemoryBudget::new(&self.head.limits, self.file, self.file_bytes);
            budget.take(held, GEOMETRY_BYTES + COUNT_BYTES + extra_bytes)?;
            let parts = map_chunks(count, 1, |c| self.decoder.chunk(first + c.start, &budget, count_bits));
            for (c, part) in (first..).zip(parts) {
                let (mut geometry, codes, bits) = part.map_err(|e| e.of_file(self.file))?;
                bit_counts.add(&bits);
                let range = c * CHUNK..n.min((c + 1) * CHUNK);
                let start = range.start;
                geometry.extras = extras(&self.checked, n, &range)?;
                let (meta, dictionary) = (self.head.meta.clone(), self.decoder.dictionary.clone());
                take(start, Model { geometry, meta, dictionary, codes, record: self.head.record.clone() })?;
            }
        }
        Ok(bit_counts.named())
    }
}

/// Bytes of all tensors that are not to be ignored, in the order writers list them, and of what is around
/// them.
fn sizes(checked: &Checked<'_>, bytes: &[u8]) -> Result<Vec<(String, u64)>> {
    const FIRST: [&str; 6] =
        [tensor::POSITION, tensor::DC, tensor::OPACITY, tensor::SCALE, tensor::ROTATION, tensor::NORMAL];
    const PACKED: [&str; 5] =
        [tensor::PARAMETERS, tensor::LENGTHS, tensor::TABLES, tensor::DATA, tensor::ORDER];
    const LAST: [&str; 7] = [
        tensor::DICTIONARY,
        tensor::VALUES,
        tensor::POINTERS,
        tensor::INDICES,
        tensor::COUNTS,
        tensor::ESCAPED,
        tensor::ESCAPE_ROWS,
    ];
    let names = checked.names();
    let extras = names.iter().copied().filter(|name| name.starts_with(super::schema::EXTRA_PREFIX));
    let order = FIRST.into_iter().chain(PACKED).chain(extras).chain(LAST);
    let mut out = Vec::new();
    for name in order.filter(|name| names.contains(name)) {
        out.push((name.to_owned(), checked.view(name)?.data().len() as u64));
    }
    let length = bytes.first_chunk::<LENGTH_BYTES>().map_or(0, |l| u64::from_le_bytes(*l));
    let checksum = checked.view(tensor::HEADER_CHECKSUM)?.data().len();
    out.push(("header".to_owned(), length + (LENGTH_BYTES + checksum) as u64));
    Ok(out)
}
