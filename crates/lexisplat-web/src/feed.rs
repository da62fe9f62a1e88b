//! The reader of a packed file on the main thread. It takes bytes, and tells which chunk is worth decoding.

use lexisplat::lexi::{FeedOptions, Layout, LexiFeed, PACKED_VERSION};
use wasm_bindgen::prelude::*;

use crate::{header, job, limits, thrown};

/// The state of a chunk.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
enum Done {
    /// The chunk was not decoded.
    #[default]
    Nothing,
    /// The chunk was decoded when `ranges` of its ranges had come and `missing` of the chunks around it had not.
    Coarse { ranges: usize, missing: usize },
    /// The bytes of the chunk were dropped to make room. They are requested again when no chunk around it is missing.
    Dropped,
    /// The chunk was decoded completely.
    Final,
}

/// Takes a packed file as its bytes arrive. It decodes nothing itself.
#[wasm_bindgen]
#[derive(Debug)]
pub struct Feed {
    feed: LexiFeed,
    done: Vec<Done>,
    /// Chunks that will not be decoded.
    given_up: Vec<bool>,
}

#[wasm_bindgen]
impl Feed {
    /// Returns a feed that holds at most `most_bytes` bytes of the file and requests `sh_parts` parts of SH-rest. Errors
    /// call the file `name`.
    #[wasm_bindgen(constructor)]
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    pub fn new(name: &str, most_bytes: f64, sh_parts: u32) -> Self {
        let options =
            FeedOptions::default().with_most_bytes(most_bytes as u64).with_sh_parts(sh_parts as usize);
        Self { feed: LexiFeed::new(name, &options, &limits()), done: Vec::new(), given_up: Vec::new() }
    }

    /// Returns the first byte to fetch next, and the byte after the last. Returns `None` if all bytes have come, or if
    /// there is no room until chunks are decoded.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "files are far below 2^53 bytes")]
    pub fn wants(&self) -> Option<Vec<f64>> {
        self.feed.wants().map(|range| vec![range.start as f64, range.end as f64])
    }

    /// Takes `bytes`, which are at `at` in the file. Bytes that were not requested are dropped.
    ///
    /// # Errors
    /// An error that tells what is wrong with the bytes. They are requested again.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    pub fn feed(&mut self, at: f64, bytes: &[u8]) -> Result<(), JsError> {
        let result = self.feed.feed(at as u64, bytes).map_err(thrown);
        let chunks = self.feed.outline().map_or(0, |outline| outline.chunks.len());
        self.done.resize(chunks, Done::Nothing);
        self.given_up.resize(chunks, false);
        result
    }

    /// Returns the facts in the file's header as JSON, once the start of the file has come.
    #[must_use]
    pub fn header(&self) -> Option<String> {
        let (head, outline) = (self.feed.head()?, self.feed.outline()?);
        let end = outline.ranges.iter().map(|range| range.bytes.end).max().unwrap_or(0);
        let fields = [
            ("version", PACKED_VERSION),
            ("gaussians", head.gaussians as u64),
            ("sourceGaussians", head.gaussians as u64 + head.removed),
            ("degree", head.degree.get() as u64),
            ("bytes", end),
            ("atoms", head.atoms as u64),
            ("chunks", outline.chunks.len() as u64),
            ("layers", outline.layers.len() as u64),
            ("firstLayerEnd", outline.first_layer_end()),
        ];
        Some(header::json(Layout::Packed, head.meta.antialiased, &fields))
    }

    /// Returns the bytes at the start of the file, for a [`Decoder`](crate::Decoder), once they have come.
    #[must_use]
    pub fn start(&self) -> Option<Vec<u8>> {
        self.feed.start().map(<[u8]>::to_vec)
    }

    /// Returns the atoms of the dictionary, row by row, channel-major. There are none until the start of the file has
    /// come.
    #[must_use]
    pub fn dictionary(&self) -> Vec<f32> {
        self.feed.dictionary().map_or_else(Vec::new, |dictionary| dictionary.as_slice().to_vec())
    }

    /// Returns the layer of chunk `chunk`.
    #[must_use]
    pub fn layer(&self, chunk: usize) -> usize {
        self.feed.outline().and_then(|outline| outline.chunks.get(chunk)).map_or(0, |chunk| chunk.layer)
    }

    /// Returns whether a job was returned for every chunk at its best quality.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.feed.outline().is_some() && self.done.iter().all(|&done| done == Done::Final)
    }

    /// Returns the chunk that is most worth decoding now, if there is one.
    ///
    /// Without `refine` only chunks count whose bytes have all come. With `refine` a chunk that was not decoded yet is
    /// returned first, then a chunk that can be decoded at its best quality, then, if `idle` is set, a chunk that can be
    /// decoded better than before.
    #[must_use]
    pub fn next(&self, refine: bool, idle: bool) -> Option<usize> {
        let chunks = 0..self.done.len();
        let at = |c: usize| self.done.get(c).copied().unwrap_or_default();
        let open = || chunks.clone().filter(|&c| !matches!(at(c), Done::Final | Done::Dropped));
        if !refine {
            return open().find(|&c| self.feed.is_chunk_complete(c) && self.feed.is_ready(c));
        }
        let first = open().find(|&c| at(c) == Done::Nothing && self.feed.is_ready(c));
        let last = || open().find(|&c| self.is_final(c));
        let better = || open().find(|&c| self.feed.is_ready(c) && at(c) != self.state(c));
        first.or_else(last).or_else(|| if idle { better() } else { None })
    }

    /// Returns whether all data for chunk `chunk` have come.
    #[must_use]
    pub fn is_final(&self, chunk: usize) -> bool {
        self.feed.is_chunk_complete(chunk) && self.feed.is_ready(chunk) && self.missing(chunk) == 0
    }

    /// Returns the job of chunk `chunk`: the data that a [`Decoder`](crate::Decoder) needs. Without `refine` the chunk is
    /// decoded as if all other chunks had come. The bytes of a chunk at its best quality are dropped.
    pub fn job(&mut self, chunk: usize, refine: bool) -> Vec<u8> {
        let bases = if refine { self.feed.bases() } else { (0..self.done.len()).collect() };
        let job = job::write(&self.feed, chunk, &bases);
        let is_final = self.is_final(chunk) || !refine;
        let state = if is_final { Done::Final } else { self.state(chunk) };
        if let Some(done) = self.done.get_mut(chunk) {
            *done = state;
        }
        if is_final {
            self.feed.forget(chunk);
        }
        job
    }

    /// Makes room if [`Self::wants`] has none. Drops the bytes of chunks that are whole but wait for others around them.
    /// If there are none, drops the bytes of all chunks but the first that is not whole. Dropped bytes are requested
    /// again later. Returns whether any bytes were dropped.
    pub fn relieve(&mut self) -> bool {
        let open = |c: &usize| !matches!(self.done.get(*c), Some(Done::Final | Done::Dropped));
        let holding = (0..self.done.len()).filter(open).filter(|&c| self.feed.whole_ranges(c) > 0);
        let (whole, unfinished): (Vec<usize>, Vec<usize>) =
            holding.partition(|&c| self.feed.is_chunk_complete(c));
        let dropped = if whole.is_empty() { unfinished.get(1..).unwrap_or_default() } else { &whole };
        for &c in dropped {
            self.feed.forget(c);
            if let Some(done) = self.done.get_mut(c) {
                *done = Done::Dropped;
            }
        }
        !dropped.is_empty()
    }

    /// Requests again the first chunk that [`Self::relieve`] dropped and around which all chunks have come. Returns
    /// whether there was such a chunk.
    pub fn ask_again(&mut self) -> bool {
        let is_next = |&c: &usize| self.done.get(c) == Some(&Done::Dropped) && self.missing(c) == 0;
        let Some(c) = (0..self.done.len()).find(is_next) else { return false };
        self.feed.want(c);
        if let Some(done) = self.done.get_mut(c) {
            *done = Done::Coarse { ranges: 0, missing: 0 };
        }
        true
    }
}

#[cfg(feature = "stream")]
#[wasm_bindgen]
impl Feed {
    /// Cancels the requests of all chunks that end beyond the first `gaussians` Gaussians of the file and were not
    /// decoded. Chunks of the layer before stay as they are drawn without them. Returns the number of Gaussians that will
    /// be decoded.
    pub fn give_up(&mut self, gaussians: usize) -> usize {
        let chunks = self.feed.outline().map(|outline| outline.chunks.clone()).unwrap_or_default();
        let mut kept = 0;
        for (c, chunk) in chunks.iter().enumerate() {
            let (Some(done), Some(given_up)) = (self.done.get_mut(c), self.given_up.get_mut(c)) else {
                break;
            };
            if chunk.first + chunk.gaussians > gaussians && *done == Done::Nothing {
                self.feed.forget(c);
                (*done, *given_up) = (Done::Final, true);
            }
            kept += if *given_up { 0 } else { chunk.gaussians };
        }
        kept
    }
}

impl Feed {
    /// Returns the feed for a scene that is drawn within a budget.
    #[cfg(feature = "stream")]
    pub(crate) fn into_inner(self) -> LexiFeed {
        self.feed
    }

    fn state(&self, chunk: usize) -> Done {
        Done::Coarse { ranges: self.feed.whole_ranges(chunk), missing: self.missing(chunk) }
    }

    /// Returns how many chunks around `chunk` have not come but will come.
    fn missing(&self, chunk: usize) -> usize {
        let comes = |c: &usize| !self.feed.came(*c) && !self.given_up.get(*c).copied().unwrap_or(false);
        self.feed.around(chunk).filter(comes).count()
    }
}
