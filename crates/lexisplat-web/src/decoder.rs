//! The decoder of a worker.

use lexisplat::lexi::{FeedOptions, LexiFeed};
use wasm_bindgen::prelude::*;

use crate::chunk::Chunk;
use crate::{job, limits, thrown};

/// Decodes the chunks of one packed file, each from a [job](crate::Feed::job).
#[wasm_bindgen]
#[derive(Debug)]
pub struct Decoder {
    feed: LexiFeed,
}

#[wasm_bindgen]
impl Decoder {
    /// Returns a decoder of the file that [starts](crate::Feed::start) with `start`. Errors call the file `name`.
    ///
    /// # Errors
    /// An error that tells what is wrong with the bytes.
    #[wasm_bindgen(constructor)]
    pub fn new(name: &str, start: &[u8], sh_parts: u32) -> Result<Self, JsError> {
        let options = FeedOptions::default().with_sh_parts(sh_parts as usize);
        let mut feed = LexiFeed::new(name, &options, &limits());
        feed.feed(0, start).map_err(thrown)?;
        if feed.outline().is_none() {
            return Err(thrown(format!("{name}: this is not the start of a packed file")));
        }
        Ok(Self { feed })
    }

    /// Decodes the chunk of `job`. It takes the memory of one chunk.
    ///
    /// # Errors
    /// An error that tells what is wrong with the bytes.
    pub fn decode(&mut self, job: &[u8]) -> Result<Chunk, JsError> {
        let chunk = job::take(&mut self.feed, job).map_err(thrown)?;
        let model = self.feed.decode(chunk);
        self.feed.forget(chunk);
        let model = model.map_err(thrown)?.ok_or_else(|| thrown("a job without the base of its chunk"))?;
        let found = self.feed.outline().and_then(|outline| outline.chunks.get(chunk));
        let first = found.map_or(0, |chunk| chunk.first);
        Ok(Chunk::new(model, first))
    }
}
