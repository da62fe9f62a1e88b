//! Packed .lexi files that come in pieces, in any order, twice or damaged: what is decoded is finite and what
//! the reader of whole files gives, and no more is held than is allowed.
#![no_main]

use std::cell::Cell;

use lexisplat::lexi::{FeedOptions, LexiFeed, LexiReader};
use lexisplat::{Error, FormatError};
use lexisplat_fuzz::allocator::{PACKED_HEAD, PACKED_PER_BYTE, bounded};
use lexisplat_fuzz::{container, invariants, limits, one_thread, parts};
use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};

const NAME: &str = "fuzz.lexi";
const PER_BYTE: usize = PACKED_PER_BYTE;
/// Tables, a dictionary, what a chunk may hold before it is asked for its bits, and the container.
const BASE: usize = PACKED_HEAD + 64 * 16 * 72 * 16 + (1 << 20);
/// Bytes at the end of an input that say how the file before them is fed.
const SCRIPT: usize = container::FEED_SCRIPT;
/// Most things that are done before the rest is fed.
const STEPS: usize = 48;
/// Bytes that a feed counts as held before anything came.
const FIRST_BYTES: u64 = 9;

fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    container::mutate_before(data, size, max_size, seed, SCRIPT, |buffer, len| {
        let room = buffer.len();
        fuzzer_mutate(buffer, len, room)
    })
});

/// Takes numbers from a script, again and again but not the same.
struct Script<'s> {
    bytes: &'s [u8],
    taken: Cell<usize>,
}

impl Script<'_> {
    fn below(&self, bound: usize) -> usize {
        let taken = self.taken.replace(self.taken.get() + 2);
        let byte = |k: usize| usize::from(self.bytes[k % self.bytes.len()]);
        let round = taken / self.bytes.len();
        (byte(taken) << 8 | byte(taken + 1)).wrapping_mul(2 * round + 1) % bound.max(1)
    }

    fn coordinate(&self) -> f32 {
        [-10.0, -1.0, -0.1, 0.0, 0.1, 1.0, 10.0, f32::MAX, f32::INFINITY, f32::NAN][self.below(10)]
    }

    fn point(&self) -> [f32; 3] {
        [self.coordinate(), self.coordinate(), self.coordinate()]
    }

    fn options(&self, len: usize) -> FeedOptions {
        let most = [usize::MAX, usize::MAX, len, len / 2, self.below(len + 1), 8][self.below(6)];
        FeedOptions::default()
            .with_most_bytes(most as u64)
            .with_sh_parts([usize::MAX, 0, 1, 2][self.below(4)])
            .with_within((self.below(3) == 0).then(|| [self.point(), self.point()]))
            .with_nearest((self.below(3) == 0).then(|| self.point()))
            .with_verify_integers(self.below(3) == 0)
    }
}

/// Feeds `bytes`, which are in the file from `at` on.
fn give(feed: &mut LexiFeed, bytes: &[u8], at: usize, most: u64) -> Result<(), Error> {
    let before = feed.held_bytes();
    let result = feed.feed(at as u64, bytes);
    let after = feed.held_bytes();
    assert!(after <= most.max(FIRST_BYTES), "{after} bytes held, {most} allowed");
    if let Err(error) = &result {
        assert!(error.to_string().contains(NAME), "{error}");
        // Bytes beyond the limit are not taken.
        assert!(!matches!(error, Error::Limit { .. }) || after <= before.max(FIRST_BYTES), "{error}");
    }
    result
}

/// Feeds what is asked for until nothing is, or it is not there or damaged.
fn fill(feed: &mut LexiFeed, file: &[u8], most: u64) -> bool {
    let mut refused = Vec::new();
    while let Some(range) = feed.wants() {
        assert!(range.start < range.end, "{range:?} is asked for");
        let is_open = feed.outline().is_some();
        let (Ok(start), Ok(end)) = (usize::try_from(range.start), usize::try_from(range.end)) else {
            return false;
        };
        let Some(bytes) = file.get(start..end) else { return false };
        if let Err(error) = give(feed, bytes, start, most) {
            // Only the start of a file is asked for before its size is known.
            assert!(!is_open || !matches!(error, Error::Limit { .. }), "{range:?} is asked for: {error}");
            // Once for damage that a step did, which is dropped, and never again.
            if refused.contains(&range.start) {
                return false;
            }
            refused.push(range.start);
        } else {
            assert_ne!(feed.wants(), Some(range), "what was taken is asked for again");
        }
    }
    true
}

/// Decodes what can be.
fn decode(feed: &LexiFeed, chunk: usize) {
    let is_ready = feed.ready().contains(&chunk);
    match feed.decode(chunk) {
        Ok(Some(model)) => {
            assert!(is_ready);
            assert_eq!(feed.outline().map(|o| o.chunks[chunk].gaussians), Some(model.len()));
            invariants::decoded(&model);
        }
        Ok(None) => assert!(!is_ready),
        Err(error) => assert!(error.to_string().contains(NAME), "{error}"),
    }
}

/// Does something.
fn step(feed: &mut LexiFeed, file: &[u8], script: &Script<'_>, most: u64) {
    let chunks = feed.outline().map_or(0, |outline| outline.chunks.len());
    match script.below(12) {
        0 => decode(feed, script.below(chunks + 1)),
        1 => feed.forget(script.below(chunks + 1)),
        2 => feed.want(script.below(chunks + 1)),
        3 => {
            give(feed, &[0; 9], usize::MAX - script.below(16), most).ok();
        }
        4 | 5 => {
            // A part of what is asked for, or more.
            let wanted = feed.wants().map_or(0..0, |range| range);
            let start = usize::try_from(wanted.start).unwrap_or(usize::MAX).min(file.len());
            let end = start
                .saturating_add(
                    1 + script.below(usize::try_from(2 * (wanted.end - wanted.start)).unwrap_or(usize::MAX)),
                )
                .min(file.len());
            give(feed, &file[start..end], start, most).ok();
        }
        kind => {
            let widths = [9, 200, 2000, file.len()];
            let start = script.below(file.len() + 1);
            let end = (start + script.below(widths[script.below(widths.len())])).min(file.len());
            let mut bytes = file[start..end].to_vec();
            if kind == 6 && !bytes.is_empty() {
                let at = script.below(bytes.len());
                bytes[at] ^= 1 << script.below(8);
            }
            give(feed, &bytes, start, most).ok();
        }
    }
}

/// Reads the first bytes `first`, as the options ask for.
fn reader<'f>(first: &'f [u8], options: &FeedOptions) -> Result<LexiReader<'f>, Error> {
    let reader = LexiReader::open_first(NAME, first, &limits())?.with_sh_parts(options.sh_parts)?;
    if options.verify_integers { reader.with_integers_verified() } else { Ok(reader) }
}

/// Compares what a feed gives with what a reader gives that has the same bytes.
fn compare(feed: &LexiFeed, reader: &LexiReader<'_>) {
    let ready = feed.ready();
    let mut next = 0;
    let read = reader.each(&mut |_, model| {
        match feed.decode(ready[next]) {
            Ok(own) => parts::decoded(&own.expect("it is ready"), &model),
            // Its budget is that of a chunk instead of that of the file.
            Err(Error::Limit { .. }) => {}
            Err(error) => panic!("only the reader takes chunk {}: {error}", ready[next]),
        }
        next += 1;
        Ok(())
    });
    match read {
        Ok(()) => assert_eq!(next, ready.len()),
        Err(Error::Limit { .. }) => {}
        Err(error) => assert!(
            ready[next..].iter().any(|&c| feed.decode(c).is_err()),
            "only the reader refuses: {error}"
        ),
    }
}

/// Whether an error is of extras, of the order of the source, of tensors that are ignored or of the length of the file,
/// which a feed does not read.
fn is_of_others(error: &str) -> bool {
    ["tensor '", "checksum of '", "'checksums'", "do not match the header"]
        .iter()
        .any(|text| error.contains(text))
        && !error.contains("'range")
}

fn run(file: &[u8], script: &Script<'_>, options: &FeedOptions) {
    let most = options.most_bytes;
    let mut feed = LexiFeed::new(NAME, options, &limits());
    (0..script.below(STEPS)).for_each(|_| step(&mut feed, file, script, most));
    fill(&mut feed, file, most);
    let chunks = feed.outline().map_or(0, |outline| outline.chunks.len());
    (0..chunks).for_each(|c| feed.want(c));
    if fill(&mut feed, file, most) && feed.is_complete() {
        assert!(feed.wants().is_none());
        let end =
            feed.outline().and_then(|o| o.ranges.last()).map_or(file.len() as u64, |range| range.bytes.end);
        if let (true, Some(data)) =
            (feed.ready().len() == chunks, file.get(..usize::try_from(end).unwrap_or(usize::MAX)))
        {
            match reader(data, options) {
                Ok(reader) => compare(&feed, &reader),
                // The bytes of the head may follow the ranges.
                Err(Error::Limit { .. } | Error::Format { problem: FormatError::Truncated { .. }, .. }) => {}
                Err(error) => assert!(is_of_others(&error.to_string()), "only a feed takes it: {error}"),
            }
        }
    }
    (0..chunks).for_each(|c| feed.forget(c));
    assert!(feed.ready().is_empty());
}

/// The first bytes of a file, for a feed and for a reader.
fn first(file: &[u8], options: &FeedOptions) {
    let options = options.clone().with_most_bytes(u64::MAX).with_within(None);
    let mut feed = LexiFeed::new(NAME, &options, &limits());
    let fed = feed.feed(0, file);
    match (feed.head().is_some(), reader(file, &options)) {
        // Damaged ranges are dropped, and the others are decoded.
        (true, Ok(_)) if fed.is_err() => {}
        (true, Ok(reader)) => compare(&feed, &reader),
        (false, Ok(_)) => assert!(fed.is_err_and(|e| e.to_string().contains("range without bytes"))),
        // It looks at what follows the ranges too.
        (true, Err(error)) => assert!(!error.to_string().is_empty()),
        (false, Err(_)) => {}
    }
}

fuzz_target!(init: one_thread(), |data: &[u8]| {
    let Some((file, script)) = data.split_last_chunk::<SCRIPT>() else { return };
    let script = Script { bytes: script, taken: Cell::new(0) };
    let options = script.options(file.len());
    let most = usize::try_from(options.most_bytes).unwrap_or(usize::MAX);
    // Bytes that come before their meaning is known may come again and again.
    let held = STEPS.saturating_mul(file.len()).min(most);
    bounded(&data[..held.min(data.len())], PER_BYTE, BASE, || run(file, &script, &options));
    let some = &file[..script.below(file.len() + 1)];
    bounded(data, PER_BYTE, BASE, || first(some, &options));
});
