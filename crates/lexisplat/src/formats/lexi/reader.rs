//! Reading .lexi files of every layout, whole or a part at a time.

use std::borrow::Cow;
use std::ops::Range;
use std::path::Path;

use super::checked::{Checked, Extent, FileBytes};
use super::exact::Exact;
use super::fields::{extras, layout};
use super::layout::Layout;
use super::schema::{EXTRA_PREFIX, FORMAT, GEOMETRY, LENGTH_BYTES, PACKED, PACKED_VERSION, VERSION, tensor};
use crate::packed::{Data, DecodeOptions, Decoder, Outline, Packed, PackedHead, StreamBits};
use crate::scene::extra::Extra;
use crate::scene::sh::ShDegree;
use crate::scene::source::{SplatSource, check_range};
use crate::scene::splats::{Geometry, SceneMeta, Splats};
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::{Model, Record};
use crate::support::error::{Error, Result};
use crate::support::input::Input;
use crate::support::limits::Limits;
use crate::support::memory_budget::{COUNT_BYTES, GEOMETRY_BYTES, MemoryBudget};
use crate::support::parallel::map_chunks;

/// Number of Gaussians of a part of an exact layout.
const PART: usize = 1 << 16;
/// Number of packed chunks that are decoded before they are handed on.
const CHUNKS_AT_ONCE: usize = 16;

/// Reads a .lexi file.
///
/// # Errors
/// [`crate::Error::Io`] if the file cannot be opened, [`crate::Error::Format`] if it is damaged, [`crate::Error::Limit`] if
/// it asks for more than `limits` allow.
pub fn read(path: impl AsRef<Path>, limits: &Limits) -> Result<Model> {
    let path = path.as_ref();
    let bytes = Input::open_within(path, limits)?;
    read_bytes(&path.display().to_string(), &bytes, limits)
}

/// Reads a .lexi file that is in memory. `file` is its name in errors.
///
/// # Errors
/// As [`read`].
pub fn read_bytes(file: &str, bytes: &[u8], limits: &Limits) -> Result<Model> {
    LexiReader::open(file, bytes, limits)?.model()
}

/// A .lexi file in which everything is checked except the codes themselves. It is decoded whole or a part at
/// a time.
///
/// As a [`SplatSource`] it gives the dense scene in the order of the file.
#[derive(Debug)]
pub struct LexiReader<'a> {
    kind: Kind<'a>,
    layout: Layout,
    limits: Limits,
    /// Names and types of extras, without values.
    extras: Vec<Extra>,
    tensor_bytes: Vec<(String, u64)>,
}

#[derive(Debug)]
enum Kind<'a> {
    Exact(Box<Exact<'a>>),
    Packed(Box<PackedFile<'a>>),
}

/// A packed scene whose chunks stay in the file.
#[derive(Debug)]
struct PackedFile<'a> {
    checked: Checked<'a>,
    /// The head, with the number of Gaussians that are there.
    head: PackedHead,
    decoder: Decoder,
    /// Number of Gaussians of the whole file.
    whole: usize,
    outline: Outline,
}

impl<'a> LexiReader<'a> {
    /// Checks the .lexi file in `bytes`, which are borrowed or owned. `file` is its name in errors.
    ///
    /// # Errors
    /// As [`read`]. Only decoding finds damage in the codes themselves, and contents over [`Limits::bytes`] or
    /// [`Limits::expansion`].
    pub fn open(
        file: impl Into<String>,
        bytes: impl AsRef<[u8]> + Send + Sync + 'a,
        limits: &Limits,
    ) -> Result<Self> {
        Self::with_extent(file.into(), Box::new(bytes), Extent::Whole, limits)
    }

    /// Checks the first bytes of a packed .lexi file, as many as there are. `file` is its name in errors.
    ///
    /// The reader then has the Gaussians whose base is whole in these bytes, as fine as the bytes make them. Where the next
    /// layer is missing, Gaussians look as the file says to fill the place of that layer. Extras and the order of the
    /// source are left out unless all bytes of the file are there. [`Limits::gaussians`] and [`Limits::bytes`] concern only
    /// the Gaussians and bytes that are there.
    ///
    /// # Errors
    /// As [`Self::open`]. [`crate::FormatError::Truncated`] says how many bytes are needed at least.
    /// [`crate::FormatError::Malformed`] for files of other layouts, which are only read whole.
    pub fn open_first(
        file: impl Into<String>,
        bytes: impl AsRef<[u8]> + Send + Sync + 'a,
        limits: &Limits,
    ) -> Result<Self> {
        Self::with_extent(file.into(), Box::new(bytes), Extent::First, limits)
    }

    fn with_extent(file: String, bytes: FileBytes<'a>, extent: Extent, limits: &Limits) -> Result<Self> {
        let checked = Checked::open(file, bytes, &[FORMAT], extent, limits)?;
        let layout = layout(&checked)?;
        let tensor_bytes = sizes(&checked)?;
        let (kind, extras) = if layout == Layout::Packed {
            let mut head = super::packed::head(&checked, limits)?;
            super::packed::check_columns(&checked, head.gaussians)?;
            let data = super::packed::data(&checked)?;
            let (start, length) = super::packed::data_span(&checked);
            let decoder = Decoder::of_prefix(&head, data.len() as u64, length)?;
            let there = decoder.spans().last().map_or(0, |span| span.end);
            let whole = std::mem::replace(&mut head.gaussians, there);
            let extras = extras(&checked, there, &(0..0))?;
            let outline = decoder.outline(start);
            (Kind::Packed(Box::new(PackedFile { checked, head, decoder, whole, outline })), extras)
        } else {
            let exact = Exact::open(checked, limits)?;
            let extras = extras(&exact.checked, exact.gaussians, &(0..0))?;
            (Kind::Exact(Box::new(exact)), extras)
        };
        Ok(Self { kind, layout, limits: *limits, extras, tensor_bytes })
    }

    /// Decodes at most `sh_parts` SH parts from here on. The first has the largest values. With 0 SH parts there is no
    /// SH-rest, and base colours are the average colours that are seen.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a file that is not packed. It has no SH parts.
    pub fn with_sh_parts(mut self, sh_parts: usize) -> Result<Self> {
        self.decode_options("sh_parts", sh_parts)?.sh_parts = sh_parts;
        Ok(self)
    }

    /// Verifies the checksums of the integers that ranges decode to from here on. They are not verified otherwise. If such
    /// a checksum is wrong although the checksum of the bytes holds, a decoder is at fault.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a file that is not packed, which has no such checksums.
    pub fn with_integers_verified(mut self) -> Result<Self> {
        self.decode_options("verify", true)?.verify = true;
        Ok(self)
    }

    /// Returns the options of decoding chunks of a packed file. Errors call the option that is set `name`, and its value
    /// `value`.
    fn decode_options(&mut self, name: &'static str, value: impl ToString) -> Result<&mut DecodeOptions> {
        match &mut self.kind {
            Kind::Packed(packed) => Ok(&mut packed.decoder.options),
            Kind::Exact(_) => Err(Error::parameter(name, value, "only for packed .lexi files")),
        }
    }

    /// Returns the layers, chunks and ranges of a packed file. They are those of the whole file, even if only a first part
    /// of it is there.
    #[must_use]
    pub fn outline(&self) -> Option<&Outline> {
        self.packed_file().map(|packed| &packed.outline)
    }

    /// Returns the number of Gaussians of the whole file. There are [fewer](Self::len) if only a first part of it is there.
    #[must_use]
    pub fn whole_len(&self) -> usize {
        self.packed_file().map_or(self.len(), |packed| packed.whole)
    }

    /// Returns the number of Gaussians that are there.
    #[must_use]
    pub fn len(&self) -> usize {
        match &self.kind {
            Kind::Exact(exact) => exact.gaussians,
            Kind::Packed(packed) => packed.head.gaussians,
        }
    }

    /// Returns whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the layout of the file.
    #[must_use]
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// Returns the version of the format of the file.
    #[must_use]
    pub fn version(&self) -> u64 {
        match &self.kind {
            Kind::Exact(_) => VERSION,
            Kind::Packed(_) => PACKED_VERSION,
        }
    }

    /// Returns the SH degree.
    #[must_use]
    pub fn degree(&self) -> ShDegree {
        self.dictionary().degree()
    }

    /// Returns the comments and marks of the source.
    #[must_use]
    pub fn meta(&self) -> &SceneMeta {
        match &self.kind {
            Kind::Exact(exact) => &exact.meta,
            Kind::Packed(packed) => &packed.head.meta,
        }
    }

    /// Returns the record of the making of the file and of its promises.
    #[must_use]
    pub fn record(&self) -> &Record {
        match &self.kind {
            Kind::Exact(exact) => &exact.record,
            Kind::Packed(packed) => &packed.head.record,
        }
    }

    /// Returns the atoms.
    #[must_use]
    pub fn dictionary(&self) -> &Dictionary {
        match &self.kind {
            Kind::Exact(exact) => &exact.dictionary,
            Kind::Packed(packed) => packed.decoder.dictionary(),
        }
    }

    /// Returns the head of a packed file; `None` for exact layouts.
    #[must_use]
    pub fn packed_head(&self) -> Option<&PackedHead> {
        self.packed_file().map(|packed| &packed.head)
    }

    fn packed_file(&self) -> Option<&PackedFile<'a>> {
        match &self.kind {
            Kind::Exact(_) => None,
            Kind::Packed(packed) => Some(packed),
        }
    }

    /// Returns whether a packed file holds the order of its source.
    #[must_use]
    pub fn order_kept(&self) -> bool {
        self.packed_file().is_some_and(|packed| super::packed::has_order(&packed.checked))
    }

    /// Returns the number of bytes of each tensor in the file, and of the header under the name `header`, as
    /// [`LexiWriter::tensor_bytes`](super::LexiWriter::tensor_bytes) does.
    #[must_use]
    pub fn tensor_bytes(&self) -> &[(String, u64)] {
        &self.tensor_bytes
    }

    /// Returns the indices in the source of the Gaussians of `range`, for a packed file that holds the order of its source.
    ///
    /// # Errors
    /// [`crate::Error::Format`] if the file does not hold the order or the range ends after [`Self::len`].
    pub fn order(&self, range: Range<usize>) -> Result<Vec<u32>> {
        match &self.kind {
            Kind::Packed(packed) => super::packed::order(&packed.checked, packed.head.gaussians, range),
            Kind::Exact(exact) => {
                let text = "only packed files hold an order; this one is in the order of its source";
                Err(exact.checked.malformed(text))
            }
        }
    }

    /// Decodes the whole scene.
    ///
    /// # Errors
    /// As [`read`].
    pub fn model(&self) -> Result<Model> {
        match &self.kind {
            Kind::Exact(exact) => exact.part(0..exact.gaussians),
            Kind::Packed(packed) => packed.take(&self.limits)?.unpack_with(&packed.decoder),
        }
    }

    /// Returns the packed scene without decoding it; `None` for exact layouts.
    ///
    /// # Errors
    /// [`crate::Error::Format`] for damage, and if only a first part of the file is there; [`crate::Error::Limit`] for a
    /// scene too large to hold.
    pub fn packed(&self) -> Result<Option<Packed>> {
        let Some(packed) = self.packed_file() else { return Ok(None) };
        if !packed.checked.is_whole() {
            let text = "only a first part is there, and packed scenes are taken whole";
            return Err(packed.checked.malformed(text));
        }
        packed.take(&self.limits).map(Some)
    }

    /// Hands all Gaussians to `take`, part after part in the order of the file. `take` gets the number of the first
    /// Gaussian of a part, and the part.
    ///
    /// # Errors
    /// As [`read`], and errors that `take` returns.
    pub fn each(&self, take: &mut dyn FnMut(usize, Model) -> Result<()>) -> Result<()> {
        self.parts(false, take).map(drop)
    }

    /// Does the same as [`Self::each`], with `at_once` Gaussians at a time for exact layouts. It is for the fuzz targets.
    #[cfg(feature = "fuzzing")]
    #[doc(hidden)]
    pub fn each_of(&self, at_once: usize, take: &mut dyn FnMut(usize, Model) -> Result<()>) -> Result<()> {
        match &self.kind {
            Kind::Exact(exact) => exact_parts(exact, at_once.max(1), take),
            Kind::Packed(_) => self.each(take),
        }
    }

    /// Does the same as [`Self::each`], and returns the bits of each stream of a packed file if `count_bits`.
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
            Kind::Packed(packed) => {
                let mut bit_counts = packed.decoder.dictionary_bits().clone();
                let chunks = packed.decoder.spans().len();
                for first in (0..chunks).step_by(CHUNKS_AT_ONCE) {
                    let at_once = first..chunks.min(first + CHUNKS_AT_ONCE);
                    bit_counts.add(&packed.chunks(at_once, &self.extras, &self.limits, count_bits, take)?);
                }
                Ok(bit_counts.named())
            }
        }
    }
}

fn exact_parts(
    exact: &Exact<'_>,
    at_once: usize,
    take: &mut dyn FnMut(usize, Model) -> Result<()>,
) -> Result<()> {
    for start in (0..exact.gaussians).step_by(at_once) {
        take(start, exact.part(start..exact.gaussians.min(start + at_once))?)?;
    }
    Ok(())
}

impl PackedFile<'_> {
    /// Returns the packed scene that is there, not decoded.
    fn take(&self, limits: &Limits) -> Result<Packed> {
        super::packed::packed(&self.checked, self.head.clone(), limits)
    }

    /// Decodes `chunks` together, hands them to `take` one after the other, and returns the bits that they took.
    fn chunks(
        &self,
        chunks: Range<usize>,
        like: &[Extra],
        limits: &Limits,
        count_bits: bool,
        take: &mut dyn FnMut(usize, Model) -> Result<()>,
    ) -> Result<crate::packed::BitCounts> {
        let n = self.head.gaussians;
        let extra_bytes = like.iter().map(|e| e.values.width()).sum::<usize>();
        let spans = self.decoder.spans().get(chunks.clone()).unwrap_or_default();
        let held = spans.iter().map(|span| span.len()).sum();
        let first = spans.first().map_or(0, |span| span.start);
        let budget = MemoryBudget::new(limits, &self.checked.file, self.checked.bytes().len() as u64);
        budget.take(held, GEOMETRY_BYTES + COUNT_BYTES + extra_bytes)?;
        let data = Data::First(super::packed::data(&self.checked)?);
        let decoded = map_chunks(chunks.len(), 1, |c| {
            self.decoder.chunk(data, chunks.start + c.start, &budget, count_bits)
        });
        // The extras of all chunks are read at once, because a block of a column holds rows of several chunks.
        let own_extras = extras(&self.checked, n, &(first..first + held))?;
        let mut bit_counts = crate::packed::BitCounts::default();
        for (span, chunk) in spans.iter().zip(decoded) {
            let (mut geometry, codes, bits) = chunk?;
            bit_counts.add(&bits);
            let rows = span.start - first..span.end - first;
            geometry.extras = own_extras.iter().map(|extra| extra.slice(rows.clone())).collect();
            let (meta, dictionary) = (self.head.meta.clone(), self.decoder.dictionary().clone());
            take(span.start, Model::new(geometry, meta, dictionary, codes, self.head.record.clone())?)?;
        }
        Ok(bit_counts)
    }
}

impl SplatSource for LexiReader<'_> {
    fn len(&self) -> usize {
        LexiReader::len(self)
    }

    fn empty(&self) -> Splats {
        let geometry = Geometry { extras: self.extras.clone(), ..Geometry::default() };
        Splats { geometry, degree: self.degree(), sh_rest: Vec::new(), meta: self.meta().clone() }
    }

    fn has_normals(&self) -> bool {
        matches!(&self.kind, Kind::Exact(exact) if exact.normals)
    }

    fn row_bytes(&self) -> u64 {
        let bytes: u64 = self.tensor_bytes.iter().map(|a| a.1).sum();
        bytes / LexiReader::len(self).max(1) as u64
    }

    /// Returns the scene in the order of its source, if the file holds that order. Parts are in the order of the file.
    fn whole(&self) -> Result<Cow<'_, Splats>> {
        if self.order_kept() {
            return Ok(Cow::Owned(self.model()?.into_splats()));
        }
        let mut splats = self.empty();
        self.read(0..LexiReader::len(self), &mut splats)?;
        Ok(Cow::Owned(splats))
    }

    fn read(&self, range: Range<usize>, part: &mut Splats) -> Result<()> {
        check_range(&range, LexiReader::len(self))?;
        let packed = match &self.kind {
            Kind::Exact(exact) => {
                *part = exact.part(range)?.into_splats();
                return Ok(());
            }
            Kind::Packed(packed) => packed,
        };
        // Chunks are decoded whole, and the Gaussians outside of the range are left out.
        let spans = packed.decoder.spans();
        let first = spans.partition_point(|span| span.end <= range.start);
        let chunks = first..spans.partition_point(|span| span.start < range.end).max(first);
        *part = self.empty();
        packed.chunks(chunks, &self.extras, &self.limits, false, &mut |start, model| {
            let chunk = model.into_splats();
            let end = start + chunk.len();
            let inside = range.start.clamp(start, end) - start..range.end.clamp(start, end) - start;
            let mut piece = self.empty();
            chunk.read(inside, &mut piece)?;
            part.append(piece);
            Ok(())
        })?;
        Ok(())
    }
}

/// Returns the number of bytes that are there of each tensor that must not be ignored, in the order in which writers list
/// tensors, and the number of bytes of the header.
fn sizes(checked: &Checked<'_>) -> Result<Vec<(String, u64)>> {
    const LAST: [&str; 7] = [
        tensor::DICTIONARY,
        tensor::VALUES,
        tensor::POINTERS,
        tensor::INDICES,
        tensor::COUNTS,
        tensor::ESCAPED,
        tensor::ESCAPE_ROWS,
    ];
    let extras = checked.names().filter(|name| name.starts_with(EXTRA_PREFIX));
    let geometry = GEOMETRY.into_iter().map(|(name, _)| name);
    let order = geometry.chain(PACKED).chain(extras).chain(LAST);
    let mut out = Vec::new();
    for name in order.filter(|name| checked.has(name)) {
        let bytes = checked.first_of(name).map_or(0, |(_, _, bytes)| bytes.len());
        out.push((name.to_owned(), bytes as u64));
    }
    let length = checked.bytes().first_chunk::<LENGTH_BYTES>().map_or(0, |l| u64::from_le_bytes(*l));
    let checksum = match checked.has(tensor::HEADER_CHECKSUM) {
        true => checked.tensor(tensor::HEADER_CHECKSUM)?.data.len(),
        false => 0,
    };
    out.push(("header".to_owned(), length + (LENGTH_BYTES + checksum) as u64));
    Ok(out)
}
