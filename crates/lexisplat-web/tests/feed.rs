//! Requests of the main thread's feed, and results of its jobs in workers. Errors of JavaScript cannot be made outside of
//! it, so what is refused is tested in `web/test`.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use lexisplat::packed::{PackOptions, Packer};
use lexisplat::{Limits, Model, Sensitivity, Silent, lexi};
use lexisplat_sample::{SampleOptions, scene};
use lexisplat_web::{Decoder, Feed};

/// All parts of SH-rest.
const ALL: u32 = u32::MAX;

/// A file of several layers.
fn file() -> Vec<u8> {
    let splats = scene(&SampleOptions::new(20_000, 3));
    let sensitivity = Sensitivity::guess(&splats.geometry);
    let packer = Packer::new(&splats, &sensitivity, &PackOptions::default()).unwrap();
    let (packed, _) = packer.pack(packer.step_for(38.0), &Silent).unwrap();
    let mut file = Vec::new();
    lexi::LexiWriter::packed(&packed).write(&mut file, &Silent).unwrap();
    file
}

fn offset(at: f64) -> usize {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an offset in a small file")]
    let offset = at as usize;
    offset
}

/// Gives the feed what it wants, at most `piece` bytes at once. Returns whether it wanted anything.
fn give(feed: &mut Feed, file: &[u8], piece: usize) -> bool {
    let Some(wanted) = feed.wants() else { return false };
    let (from, to) = (offset(wanted[0]), offset(wanted[1]));
    assert!(feed.feed(wanted[0], &file[from..to.min(from.saturating_add(piece))]).is_ok());
    true
}

/// Reads `file` in pieces and decodes what the feed says. Returns the last of each chunk, and how many were decoded.
fn decoded(file: &[u8], most_bytes: f64, piece: usize, refine: bool) -> (Vec<Option<Model>>, usize) {
    let mut feed = Feed::new("a.lexi", most_bytes, ALL);
    while feed.header().is_none() {
        assert!(give(&mut feed, file, piece));
    }
    let mut decoder = Decoder::new("a.lexi", &feed.start().unwrap(), ALL).ok().unwrap();
    let (mut chunks, mut times) = (Vec::new(), 0);
    while !feed.is_done() {
        while let Some(chunk) = feed.next(refine, false) {
            let job = feed.job(chunk, refine);
            let made = decoder.decode(&job).ok().unwrap();
            chunks.resize(chunks.len().max(chunk + 1), None);
            chunks[chunk] = Some(made.model().clone());
            times += 1;
        }
        if !give(&mut feed, file, piece) && !feed.is_done() {
            assert!(feed.ask_again() || feed.relieve(), "it goes on");
        }
    }
    (chunks, times)
}

fn expected(file: &[u8]) -> Vec<Option<Model>> {
    let mut chunks = Vec::new();
    let reader = lexi::LexiReader::open("a.lexi", file, &Limits::default()).unwrap();
    reader
        .each(&mut |_, model| {
            chunks.push(Some(model));
            Ok(())
        })
        .unwrap();
    chunks
}

#[test]
fn every_chunk_is_decoded_as_fine_as_it_can_be() {
    let file = file();
    let expected = expected(&file);
    assert!(expected.len() > 2);
    let (once, times) = decoded(&file, 1e9, usize::MAX, false);
    assert!(once == expected && times == expected.len());
    for piece in [1000, 70_000, usize::MAX] {
        let (finest, times) = decoded(&file, 1e9, piece, true);
        assert!(finest == expected, "{piece}");
        assert!(times >= expected.len() && times <= 3 * expected.len(), "{piece}: {times}");
    }
}

#[test]
fn little_memory_is_enough_for_all_of_it() {
    let file = file();
    let expected = expected(&file);
    // Less than the chunks that wait for others around them.
    let (finest, _) = decoded(&file, file.len() as f64 * 0.7, 5000, true);
    assert!(finest == expected);
}

#[test]
fn chunks_that_are_given_up_are_not_asked_for() {
    let file = file();
    let expected = expected(&file);
    let mut feed = Feed::new("a.lexi", 1e9, ALL);
    while feed.header().is_none() {
        assert!(give(&mut feed, &file, 10_000));
    }
    let first = expected[0].as_ref().unwrap().len();
    assert_eq!(feed.give_up(first), first);
    let mut decoder = Decoder::new("a.lexi", &feed.start().unwrap(), ALL).ok().unwrap();
    let mut chunks = Vec::new();
    while !feed.is_done() {
        while let Some(chunk) = feed.next(true, false) {
            chunks.push((chunk, decoder.decode(&feed.job(chunk, true)).ok().unwrap().count()));
        }
        assert!(give(&mut feed, &file, 10_000) || feed.is_done());
    }
    assert!(chunks.iter().all(|&(chunk, count)| chunk == 0 && count == first), "{chunks:?}");
    let nothing = feed.give_up(0);
    assert_eq!(nothing, first, "what was decoded stays");
}
