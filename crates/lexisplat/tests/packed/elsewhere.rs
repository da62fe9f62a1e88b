//! Chunks that are decoded by another feed than the one that takes the file.

use std::sync::OnceLock;

use lexisplat::lexi::{FeedOptions, LexiFeed};
use lexisplat::{Limits, Model};

use super::support::{STEP, bytes, options, pack, sample};

const NAME: &str = "p.lexi";
/// Enough for several layers, and for several chunks of the last.
const GAUSSIANS: usize = 20_000;

fn file() -> &'static [u8] {
    static FILE: OnceLock<Vec<u8>> = OnceLock::new();
    FILE.get_or_init(|| bytes(&pack(&sample(GAUSSIANS, 7, 2), STEP, &options(|_| ())).0))
}

fn feed() -> LexiFeed {
    LexiFeed::new(NAME, &FeedOptions::default(), &Limits::default())
}

/// Decodes chunk `c` of `feed` by `other`.
fn elsewhere(other: &mut LexiFeed, feed: &LexiFeed, c: usize) -> Option<Model> {
    other.note_bases(&feed.bases());
    other.want(c);
    for (at, bytes) in feed.ranges(c) {
        other.feed(at, bytes).unwrap();
    }
    let model = other.decode(c).unwrap();
    other.forget(c);
    model
}

#[test]
fn another_feed_decodes_the_same() {
    let file = file();
    let mut whole = feed();
    whole.feed(0, file).unwrap();
    let chunks = whole.outline().unwrap().chunks.len();
    assert!(chunks > 2, "{chunks}");
    let mut other = feed();
    assert!(whole.start().unwrap().len() < file.len() / 4);
    other.feed(0, whole.start().unwrap()).unwrap();
    let mut changed = 0;
    for thousandths in [200, 400, 700, 1000, 600] {
        let mut feed = feed();
        feed.feed(0, &file[..thousandths * file.len() / 1000]).unwrap();
        if thousandths == 600 {
            // Chunks that were forgotten do not fill the place of others.
            feed.forget(feed.outline().unwrap().layers[1].chunks.start);
        }
        for c in feed.ready() {
            let own = feed.decode(c).unwrap();
            assert!(elsewhere(&mut other, &feed, c) == own, "{thousandths}: {c}");
            let is_final = feed.around(c).all(|c| feed.came(c)) && feed.is_chunk_complete(c);
            if is_final {
                assert!(own == whole.decode(c).unwrap(), "{thousandths}: {c} is not as it will be");
            } else {
                changed += usize::from(own != whole.decode(c).unwrap());
            }
        }
    }
    assert!(changed > 0, "some chunks are not final");
}

#[test]
fn nothing_is_shared_of_a_file_that_has_not_begun() {
    let mut feed = feed();
    assert!(feed.start().is_none() && feed.ranges(0).is_empty() && feed.bases().is_empty());
    assert!(feed.around(0).is_empty() && !feed.came(0) && !feed.is_ready(0));
    feed.note_bases(&[0, usize::MAX]);
    feed.feed(0, file()).unwrap();
    feed.note_bases(&[usize::MAX]);
    assert!(feed.ranges(usize::MAX).is_empty());
    assert!(feed.around(usize::MAX).is_empty() && feed.whole_ranges(usize::MAX) == 0);
    assert_eq!(feed.bases().len(), feed.outline().unwrap().chunks.len());
}
