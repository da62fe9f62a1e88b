//! Reading a packed file from bytes as they come.

mod drawn;
mod elsewhere;
mod look;
mod options;
mod ranges;
mod run;
mod streamed;

use std::ops::Range;

use self::ranges::Ranges;
use self::run::Run;
use super::checked::{Checked, Extent, header_end, start_end};
use super::fields::layout;
use super::layout::Layout;
use super::schema::{FORMAT, LENGTH_BYTES};
use crate::formats::kind::FileKind;
use crate::packed::{Data, Decoder, Outline, PackedHead};
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::Model;
use crate::support::error::{Error, Result};
use crate::support::limits::Limits;
use crate::support::memory_budget::{COUNT_BYTES, GEOMETRY_BYTES, MemoryBudget};

pub use self::drawn::{ChunkChange, DrawnChunks};
pub use self::options::FeedOptions;
pub use self::streamed::StreamedScene;

/// Bytes that are asked for first: the length of the header, and the first byte of it, by which a .lexi is known.
const FIRST_BYTES: usize = LENGTH_BYTES + 1;

/// A reader of a packed .lexi file that is fed bytes as they come.
///
/// [`Self::wants`] says which bytes to fetch next. The bytes are given to [`Self::feed`] in pieces of any size and in any order,
/// also more than was asked for, such as the first 64 KiB of the file instead of its first 9 bytes. Every range
/// is checked when it is whole. [`Self::decode`] decodes a chunk from the ranges that are there. A
/// chunk is complete when nothing more of it is wanted, and then [`Self::forget`] makes room.
///
/// Extras and the order of the source are not read.
///
/// ```
/// # use lexisplat::packed::{PackOptions, Packer};
/// # use lexisplat::{Limits, Sensitivity, Silent, lexi};
/// # let splats = lexisplat_sample::scene(&lexisplat_sample::SampleOptions::new(2000, 0));
/// # let sensitivity = Sensitivity::guess(&splats.geometry);
/// # let packer = Packer::new(&splats, &sensitivity, &PackOptions::default())?;
/// # let (packed, _) = packer.pack(packer.step_for(40.0), &Silent)?;
/// # let mut file = Vec::new();
/// # lexi::LexiWriter::packed(&packed).write(&mut file, &Silent)?;
/// # let get = |range: std::ops::Range<u64>| &file[range.start as usize..range.end as usize];
/// use lexisplat::lexi::{FeedOptions, LexiFeed};
///
/// let options = FeedOptions::default().with_most_bytes(1 << 20);
/// let mut feed = LexiFeed::new("scene.lexi", &options, &Limits::default());
/// let mut gaussians = 0;
/// while let Some(range) = feed.wants() {
///     feed.feed(range.start, get(range))?; // by HTTP, for example
///     for chunk in feed.ready() {
///         if feed.is_chunk_complete(chunk) {
///             gaussians += feed.decode(chunk)?.map_or(0, |model| model.len());
///             feed.forget(chunk);
///         }
///     }
/// }
/// assert_eq!(gaussians, 2000);
/// # Ok::<(), lexisplat::Error>(())
/// ```
#[derive(Debug)]
pub struct LexiFeed {
    file: String,
    options: FeedOptions,
    limits: Limits,
    /// The first bytes of the file, as many as are needed so far.
    start: Run,
    /// Bytes that came before their meaning is known.
    early: Vec<(u64, Box<[u8]>)>,
    ranges: Option<Box<Ranges>>,
}

impl LexiFeed {
    /// A reader of a file of which nothing is there. Errors call it `file`.
    #[must_use]
    pub fn new(file: impl Into<String>, options: &FeedOptions, limits: &Limits) -> Self {
        let start = Run::new(0, FIRST_BYTES);
        let (file, options) = (file.into(), options.clone());
        Self { file, options, limits: *limits, start, early: Vec::new(), ranges: None }
    }

    /// The bytes of the file to fetch next: first its start, then runs of ranges. `None` if all came that is asked for, and if
    /// [`FeedOptions::most_bytes`] leave no room for the next range until others are forgotten.
    #[must_use]
    pub fn wants(&self) -> Option<Range<u64>> {
        match &self.ranges {
            None => self.start.gap(),
            Some(ranges) => ranges.wants(self.room()),
        }
    }

    /// The runs of ranges to fetch next besides those that were `asked` for and did not come yet, so that several can be fetched at
    /// the same time: at most `most` runs. None has more than `longest` bytes, unless a single range has. Ranges that are near to
    /// each other are one run, with the bytes between them. There are none before the start of the file came.
    #[must_use]
    pub fn wanted_runs(&self, asked: &[Range<u64>], most: usize, longest: u64) -> Vec<Range<u64>> {
        let runs = |ranges: &Ranges| ranges.runs(self.room(), asked, most, longest);
        self.ranges.as_deref().map_or_else(Vec::new, runs)
    }

    /// Bytes that may be held beside those that are.
    fn room(&self) -> u64 {
        self.options.most_bytes.saturating_sub(self.held_bytes())
    }

    /// Whether all bytes came that are asked for.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        let all = |ranges: &Ranges| (0..ranges.outline.chunks.len()).all(|c| ranges.is_complete(c));
        self.ranges.as_deref().is_some_and(all)
    }

    /// Bytes of the file that are held. A range of which a part is there counts whole.
    #[must_use]
    pub fn held_bytes(&self) -> u64 {
        let ranges = self.ranges.as_ref().map_or(0, |ranges| ranges.held);
        self.start.len() as u64 + self.early_bytes() + ranges
    }

    fn early_bytes(&self) -> u64 {
        self.early.iter().map(|(_, bytes)| bytes.len() as u64).sum()
    }

    /// Takes `bytes` that are in the file from `at` on. Bytes that are not wanted or there already are dropped.
    ///
    /// # Errors
    /// [`Error::Limit`] if more would be held than [`FeedOptions::most_bytes`]; nothing is taken then. [`Error::Format`] for
    /// damage, naming the range; its bytes are dropped and wanted again. Other ranges in `bytes` are taken.
    pub fn feed(&mut self, at: u64, bytes: &[u8]) -> Result<()> {
        let Some(ranges) = &mut self.ranges else { return self.feed_start(at, bytes) };
        let more = ranges.more(at, bytes);
        self.check_room(more)?;
        self.ranges.as_mut().map_or(Ok(()), |ranges| ranges.take(at, bytes))
    }

    /// Refuses to hold so many bytes more.
    fn check_room(&self, more: u64) -> Result<()> {
        let what = format!("bytes held of {}", self.file);
        let held = if more > 0 { self.held_bytes().saturating_add(more) } else { 0 };
        Limits::check(&what, held, self.options.most_bytes)
    }

    fn feed_start(&mut self, at: u64, bytes: &[u8]) -> Result<()> {
        let after = usize::try_from(self.start.end().saturating_sub(at)).unwrap_or(usize::MAX);
        let early = bytes.get(after..).unwrap_or_default();
        self.check_room(early.len() as u64)?;
        self.start.put(at, bytes);
        if !early.is_empty() {
            self.early.push((at.saturating_add(after as u64), early.into()));
        }
        while let Some(there) = self.start.whole() {
            match needed(&self.file, there, &self.limits).and_then(|needed| self.make_room(needed)) {
                Ok(needed) if needed > self.start.len() => self.extend_start(needed),
                Ok(_) => return self.open(),
                Err(error) => return self.refuse_start(error),
            }
        }
        Ok(())
    }

    /// `needed` bytes at the start, if there may be so many.
    fn make_room(&mut self, needed: u64) -> Result<usize> {
        let what = format!("bytes at the start of {}", self.file);
        Limits::check(&what, needed, self.options.most_bytes)?;
        if needed.saturating_add(self.early_bytes()) > self.options.most_bytes {
            // It will be asked for again.
            self.early.clear();
        }
        usize::try_from(needed).map_err(|_| Error::limit(what, needed, usize::MAX as u64, None))
    }

    fn extend_start(&mut self, needed: usize) {
        self.start.grow(needed);
        let end = self.start.end();
        for (at, bytes) in &self.early {
            self.start.put(*at, bytes);
        }
        self.early.retain(|(at, bytes)| at.saturating_add(bytes.len() as u64) > end);
    }

    /// Begins anew after damage at the start.
    fn refuse_start(&mut self, error: Error) -> Result<()> {
        self.start = Run::new(0, FIRST_BYTES);
        self.early.clear();
        Err(error)
    }

    /// Reads the start, which is whole.
    fn open(&mut self) -> Result<()> {
        let ranges = match self.start.whole().map(|start| self.read_start(start)) {
            Some(Ok(ranges)) => ranges,
            Some(Err(error)) => return self.refuse_start(error),
            None => return Ok(()),
        };
        self.ranges = Some(Box::new(ranges));
        // Ranges for which there is no room are asked for later.
        let unless_full = |result: Result<()>| match result {
            Err(Error::Limit { .. }) => Ok(()),
            other => other,
        };
        let mut result = unless_full(self.take_from_start());
        for (at, bytes) in std::mem::take(&mut self.early) {
            result = result.and(unless_full(self.feed(at, &bytes)));
        }
        result
    }

    /// Takes the ranges that lie within the start. There are some where the head comes after them.
    fn take_from_start(&mut self) -> Result<()> {
        let (Some(ranges), Some(start)) = (&self.ranges, self.start.whole()) else { return Ok(()) };
        let more = ranges.more(0, start);
        self.check_room(more)?;
        match (&mut self.ranges, self.start.whole()) {
            (Some(ranges), Some(start)) => ranges.take(0, start),
            _ => Ok(()),
        }
    }

    fn read_start(&self, start: &[u8]) -> Result<Ranges> {
        let checked =
            Checked::open(self.file.clone(), Box::new(start), &[FORMAT], Extent::First, &self.limits)?;
        if layout(&checked)? != Layout::Packed {
            return Err(checked.malformed("the layout is not 'packed'"));
        }
        let head = super::packed::head(&checked, &self.limits)?;
        let (data_start, data_bytes) = super::packed::data_span(&checked);
        let mut decoder = Decoder::new(&head, data_bytes)?;
        decoder.options.sh_parts = self.options.sh_parts;
        decoder.options.verify = self.options.verify_integers;
        let outline = decoder.outline(data_start);
        if let Some(range) = outline.ranges.iter().find(|range| range.bytes.is_empty()) {
            let (kind, chunk) = (range.kind, range.chunk);
            let text = format!("packed.data: {kind} of chunk {chunk} has no bytes, and a lane has two words");
            return Err(checked.malformed(text));
        }
        Ok(Ranges::new(head, decoder, outline, data_start, &self.options))
    }

    /// Returns the header of the file, once its start came.
    #[must_use]
    pub fn head(&self) -> Option<&PackedHead> {
        self.ranges.as_ref().map(|ranges| &ranges.head)
    }

    /// The dictionary, once the start of the file came.
    #[must_use]
    pub fn dictionary(&self) -> Option<&Dictionary> {
        self.ranges.as_ref().map(|ranges| ranges.decoder.dictionary())
    }

    /// The layers, chunks and ranges of the file, once its start came.
    #[must_use]
    pub fn outline(&self) -> Option<&Outline> {
        self.ranges.as_ref().map(|ranges| &ranges.outline)
    }

    /// The chunks that can be decoded, by their numbers in the [outline](Self::outline).
    #[must_use]
    pub fn ready(&self) -> Vec<usize> {
        let ready =
            |ranges: &Ranges| (0..ranges.outline.chunks.len()).filter(|&c| ranges.is_ready(c)).collect();
        self.ranges.as_deref().map_or_else(Vec::new, ready)
    }

    /// Whether all bytes came that are asked for of chunk `chunk`.
    #[must_use]
    pub fn is_chunk_complete(&self, chunk: usize) -> bool {
        self.ranges.as_ref().is_some_and(|ranges| ranges.is_complete(chunk))
    }

    /// Decodes chunk `chunk` from the ranges that are there; `None` if its base is not there. Nothing else is decoded, so the
    /// memory is that of one chunk.
    ///
    /// More ranges make it finer. In layers that are filled by others, Gaussians look as the file says to fill their place
    /// until the base of the chunks of the next layer around came, forgotten or not.
    ///
    /// # Errors
    /// [`Error::Format`] for damage that no checksum shows, [`Error::Limit`] if it takes more than the limits of the feed.
    pub fn decode(&self, chunk: usize) -> Result<Option<Model>> {
        let Some(ranges) = self.ranges.as_deref().filter(|ranges| ranges.is_ready(chunk)) else {
            return Ok(None);
        };
        let gaussians = ranges.outline.chunks.get(chunk).map_or(0, |chunk| chunk.gaussians);
        let bytes = self.start.len() as u64 + ranges.bytes_of(chunk);
        let budget = MemoryBudget::new(&self.limits, &self.file, bytes);
        budget.take(gaussians, GEOMETRY_BYTES + COUNT_BYTES)?;
        let (geometry, codes, _) = ranges.decoder.chunk(Data::Ranges(ranges), chunk, &budget, false)?;
        let (meta, record) = (ranges.head.meta.clone(), ranges.head.record.clone());
        let dictionary: Dictionary = ranges.decoder.dictionary().clone();
        Model::new(geometry, meta, dictionary, codes, record).map(Some)
    }

    /// Drops the bytes of chunk `chunk` and asks for no more of it.
    pub fn forget(&mut self, chunk: usize) {
        if let Some(ranges) = &mut self.ranges {
            ranges.forget(chunk);
        }
    }

    /// Asks for chunk `chunk` again, or although it is not [where](FeedOptions::within) chunks are asked for.
    pub fn want(&mut self, chunk: usize) {
        if let Some(ranges) = &mut self.ranges {
            ranges.want(chunk, &self.options);
        }
    }
}

/// The number of bytes at the start of a file that are needed to go on, if it starts with `there`.
fn needed(file: &str, there: &[u8], limits: &Limits) -> Result<u64> {
    FileKind::Lexi.expect(file, there)?;
    let header = header_end(file, there, limits)?;
    if header > there.len() as u64 { Ok(header) } else { start_end(file, there, header) }
}
