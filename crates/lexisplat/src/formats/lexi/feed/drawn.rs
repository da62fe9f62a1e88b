//! The chunks of a streamed scene that are drawn.

use std::collections::BTreeMap;

use super::LexiFeed;

/// The chunks that are drawn of a feed that [looks](LexiFeed::look), and the data that each of them was decoded from.
///
/// [`StreamedScene`](super::StreamedScene) keeps decoded chunks by it. Programs that decode in other threads, or keep chunks on
/// a GPU, use it directly.
#[derive(Debug, Default)]
pub struct DrawnChunks {
    chunks: BTreeMap<usize, Origin>,
}

/// The data that a chunk was decoded from.
#[derive(Debug, PartialEq, Eq)]
struct Origin {
    /// Number of its ranges that came.
    ranges: usize,
    /// For each chunk of the next layer around it, whether it is drawn.
    next: Vec<bool>,
}

/// A change of the chunks that are drawn. If all of it is shown at once, no place is empty in between, and nothing is drawn
/// twice.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ChunkChange {
    /// Chunks that are not drawn any more, in ascending order.
    pub removed: Vec<usize>,
    /// Chunks that must be decoded, for the first time or again, in ascending order.
    pub decoded: Vec<usize>,
    /// All chunks that are drawn after the change, in ascending order. A feed [elsewhere](LexiFeed::note_bases) decodes by them.
    pub drawn: Vec<usize>,
}

impl ChunkChange {
    /// Returns whether nothing changes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.removed.is_empty() && self.decoded.is_empty()
    }
}

impl DrawnChunks {
    /// Returns the change to draw the chunks that `feed` holds, and takes it for done.
    ///
    /// At most `most` chunks are decoded for the first time, and at most `most` are decoded again because more of their ranges
    /// came. A chunk is decoded again in any case if chunks of the next layer [around](LexiFeed::around) it come or go.
    pub fn update(&mut self, feed: &LexiFeed, most: usize) -> ChunkChange {
        let ready = feed.ready();
        let removed: Vec<usize> =
            self.chunks.keys().copied().filter(|c| ready.binary_search(c).is_err()).collect();
        self.chunks.retain(|c, _| removed.binary_search(c).is_err());
        let mut new = 0;
        let is_drawn = |c: &usize| {
            let was_drawn = self.chunks.contains_key(c);
            new += usize::from(!was_drawn);
            was_drawn || new <= most
        };
        let drawn: Vec<usize> = ready.into_iter().filter(is_drawn).collect();
        let (mut decoded, mut finer) = (Vec::new(), 0);
        for &c in &drawn {
            let next = feed.around(c).map(|c| drawn.binary_search(&c).is_ok()).collect();
            let origin = Origin { ranges: feed.whole_ranges(c), next };
            if let Some(before) = self.chunks.get(&c).filter(|before| before.next == origin.next) {
                finer += usize::from(before.ranges != origin.ranges);
                if before.ranges == origin.ranges || finer > most {
                    continue;
                }
            }
            self.chunks.insert(c, origin);
            decoded.push(c);
        }
        ChunkChange { removed, decoded, drawn }
    }
}
