//! The reader of a packed file on the main thread: it takes bytes, and says what is worth decoding.

use lexisplat::lexi::{FeedOptions, Layout, LexiFeed, PACKED_VERSION};
use wasm_bindgen::prelude::*;

use crate::{header, job, limits, thrown};

/// What was decoded of a chunk.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
enum Done {
    /// Nothing.
    #[default]
    Nothing,
    /// It was decoded when so many of its ranges were there and so many chunks around it missing.
    Coarse { ranges: usize, missing: usize },
    /// Its bytes were dropped to make room. It is asked for again when nothing around it is missing.
    Dropped,
    /// All of it.
    Final,
}

/// Takes a packed file as its bytes come. Decodes nothing itself.
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
    /// A feed that holds at most `most_bytes` of the file and asks for `sh_parts` parts of SH-rest. Errors call the file `name`.
    #[wasm_bindgen(constructor)]
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    pub fn new(name: &str, most_bytes: f64, sh_parts: u32) -> Self {
        let options =
            FeedOptions::default().with_most_bytes(most_bytes as u64).with_sh_parts(sh_parts as usize);
        Self { feed: LexiFeed::new(name, &options, &limits()), done: Vec::new(), given_up: Vec::new() }
    }

    /// The first and the last byte to fetch next, the last not included. Nothing if all came, or if there is no room until
    /// chunks are decoded.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "files are far below 2^53 bytes")]
    pub fn wants(&self) -> Option<Vec<f64>> {
        self.feed.wants().map(|range| vec![range.start as f64, range.end as f64])
    }

    /// Takes `bytes`, which are in the file from `at` on. Those that are not asked for are dropped.
    ///
    /// # Errors
    /// What is wrong with them. They are asked for again.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    pub fn feed(&mut self, at: f64, bytes: &[u8]) -> Result<(), JsError> {
        let result = self.feed.feed(at as u64, bytes).map_err(thrown);
        let chunks = self.feed.outline().map_or(0, |outline| outline.chunks.len());
        self.done.resize(chunks, Done::Nothing);
        self.given_up.resize(chunks, false);
        result
    }

    /// What the file says of itself, as JSON, once its start came.
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

    /// The bytes at the start of the file, which a [`Decoder`](crate::Decoder) takes, once they came.
    #[must_use]
    pub fn start(&self) -> Option<Vec<u8>> {
        self.feed.start().map(<[u8]>::to_vec)
    }

    /// The atoms of the dictionary, row by row, channel-major; none before the start came.
    #[must_use]
    pub fn dictionary(&self) -> Vec<f32> {
        self.feed.dictionary().map_or_else(Vec::new, |dictionary| dictionary.as_slice().to_vec())
    }

    /// The layer of chunk `chunk`.
    #[must_use]
    pub fn layer(&self, chunk: usize) -> usize {
        self.feed.outline().and_then(|outline| outline.chunks.get(chunk)).map_or(0, |chunk| chunk.layer)
    }

    /// Whether every chunk was given as a job as fine as it can be.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.feed.outline().is_some() && self.done.iter().all(|&done| done == Done::Final)
    }

    /// The chunk that is most worth decoding now, if there is one.
    ///
    /// Without `refine` that is one of which all bytes came. With it that is one that was not decoded yet, else one that can be
    /// decoded as fine as it will be, else, if `idle`, one that became finer since it was decoded.
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

    /// Whether all that can be had of chunk `chunk` is there.
    #[must_use]
    pub fn is_final(&self, chunk: usize) -> bool {
        self.feed.is_chunk_complete(chunk) && self.feed.is_ready(chunk) && self.missing(chunk) == 0
    }

    /// What a [`Decoder`](crate::Decoder) needs to decode chunk `chunk`. Without `refine` it is decoded as if all other chunks
    /// were there. The bytes of a chunk that is as fine as it can be are dropped.
    pub fn job(&mut self, chunk: usize, refine: bool) -> Vec<u8> {
        let job = job::write(&self.feed, chunk, !refine);
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

    /// Makes room where [`Self::wants`] has none: drops the bytes of chunks that are whole but wait for others around them, or
    /// if there are none, those of all chunks but the first that is not whole. They are asked for again later. Returns whether
    /// there were any.
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

    /// Asks again for the first of the chunks that [`Self::relieve`] dropped around which all came. Returns whether there was
    /// one.
    pub fn ask_again(&mut self) -> bool {
        let is_next = |&c: &usize| self.done.get(c) == Some(&Done::Dropped) && self.missing(c) == 0;
        let Some(c) = (0..self.done.len()).find(is_next) else { return false };
        self.feed.want(c);
        if let Some(done) = self.done.get_mut(c) {
            *done = Done::Coarse { ranges: 0, missing: 0 };
        }
        true
    }

    /// Asks for no chunk that ends beyond the first `gaussians` Gaussians of the file, unless it was decoded. Chunks of the layer
    /// before stay as they are drawn without them. Returns the number of Gaussians that will be decoded.
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

    fn state(&self, chunk: usize) -> Done {
        Done::Coarse { ranges: self.feed.whole_ranges(chunk), missing: self.missing(chunk) }
    }

    /// How many chunks around `chunk` have not come but will.
    fn missing(&self, chunk: usize) -> usize {
        let comes = |c: &usize| !self.feed.came(*c) && !self.given_up.get(*c).copied().unwrap_or(false);
        self.feed.around(chunk).filter(comes).count()
    }
}
