//! Decoding chunks by another feed than the one that takes the file, such as in a worker of a browser.

use std::ops::Range;

use super::LexiFeed;

/// A feed that has no file decodes chunks for one that has. It is fed [`Self::start`] once, and for each chunk it is told
/// which [`Self::bases`] came, then to [`Self::want`] the chunk, and is fed the [`Self::ranges`].
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
/// # use lexisplat::lexi::{FeedOptions, LexiFeed};
/// # let mut feed = LexiFeed::new("scene.lexi", &FeedOptions::default(), &Limits::default());
/// # feed.feed(0, &file)?;
/// let mut other = LexiFeed::new("scene.lexi", &FeedOptions::default(), &Limits::default());
/// other.feed(0, feed.start().unwrap())?;
/// for chunk in feed.ready() {
///     other.note_bases(&feed.bases());
///     other.want(chunk);
///     for (at, bytes) in feed.ranges(chunk) {
///         other.feed(at, bytes)?;
///     }
///     assert_eq!(other.decode(chunk)?, feed.decode(chunk)?);
///     other.forget(chunk);
/// }
/// # Ok::<(), lexisplat::Error>(())
/// ```
impl LexiFeed {
    /// The bytes at the start of the file that every feed needs before it takes ranges; `None` before they came.
    #[must_use]
    pub fn start(&self) -> Option<&[u8]> {
        self.ranges.as_ref().and_then(|_| self.start.whole())
    }

    /// Where the ranges of chunk `chunk` that are held are in the file, and their bytes, whole and checked.
    #[must_use]
    pub fn ranges(&self, chunk: usize) -> Vec<(u64, &[u8])> {
        self.ranges.as_deref().map_or_else(Vec::new, |ranges| ranges.whole(chunk).collect())
    }

    /// The chunks whose base came, forgotten or not.
    #[must_use]
    pub fn bases(&self) -> Vec<usize> {
        let chunks = self.outline().map_or(0, |outline| outline.chunks.len());
        (0..chunks).filter(|&c| self.came(c)).collect()
    }

    /// Decodes chunks from here on as if the bases of `chunks`, and no others, had come and had been forgotten. Chunks that are to
    /// be decoded here are asked for by [`Self::want`] afterwards.
    pub fn note_bases(&mut self, chunks: &[usize]) {
        if let Some(ranges) = self.ranges.as_deref_mut() {
            (0..ranges.outline.chunks.len()).for_each(|c| ranges.note_base(c, false));
            chunks.iter().for_each(|&c| ranges.note_base(c, true));
        }
    }

    /// Whether the base of chunk `chunk` came, forgotten or not.
    #[must_use]
    pub fn came(&self, chunk: usize) -> bool {
        self.ranges.as_deref().is_some_and(|ranges| ranges.base_came(chunk))
    }

    /// The chunks of the next layer around chunk `chunk`. Until all of them [came](Self::came), some of its Gaussians are decoded
    /// as the file says to fill their place. None if the file does not say.
    #[must_use]
    pub fn around(&self, chunk: usize) -> Range<usize> {
        self.outline().and_then(|outline| outline.chunks.get(chunk)).map_or(0..0, |chunk| chunk.next.clone())
    }

    /// How many ranges of chunk `chunk` are held whole.
    #[must_use]
    pub fn whole_ranges(&self, chunk: usize) -> usize {
        self.ranges.as_deref().map_or(0, |ranges| ranges.whole(chunk).count())
    }

    /// Whether chunk `chunk` can be decoded.
    #[must_use]
    pub fn is_ready(&self, chunk: usize) -> bool {
        self.ranges.as_deref().is_some_and(|ranges| ranges.is_ready(chunk))
    }
}
