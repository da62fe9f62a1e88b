//! Packed files that are read in part: their first bytes, without some of their SH-rest, and from bytes as they come.

use std::ops::Range;
use std::sync::OnceLock;

use lexisplat::lexi::{FeedOptions, LexiFeed, LexiReader};
use lexisplat::packed::{Outline, RangeKind};
use lexisplat::{Error, FormatError, Limits, Model, Result, SplatSource, lexi};
use lexisplat_testing::Random;

use crate::parts::Parts;

use super::support::{STEP, bytes, options, pack, sample, with_extras};

const NAME: &str = "p.lexi";
/// Gaussians of the test scene: enough for several layers, and for several chunks of the last.
const GAUSSIANS: usize = 20_000;

/// A file of several layers, with points of view and without extras.
fn file() -> &'static [u8] {
    static FILE: OnceLock<Vec<u8>> = OnceLock::new();
    FILE.get_or_init(|| {
        let options = options(|o| o.points_of_view = vec![[0.0, -1.0, -4.0], [3.0, -1.0, 2.0]]);
        bytes(&pack(&sample(GAUSSIANS, 5, 2), STEP, &options).0)
    })
}

fn outline(file: &[u8]) -> Outline {
    LexiReader::open(NAME, file, &Limits::default()).unwrap().outline().unwrap().clone()
}

/// Returns the decoded chunks of `reader`.
fn chunks(reader: &LexiReader<'_>) -> Vec<Model> {
    let mut chunks = Vec::new();
    reader
        .each(&mut |_, model| {
            chunks.push(model);
            Ok(())
        })
        .unwrap();
    chunks
}

fn whole(file: &[u8]) -> Vec<Model> {
    chunks(&LexiReader::open(NAME, file, &Limits::default()).unwrap())
}

fn feed(options: &FeedOptions) -> LexiFeed {
    LexiFeed::new(NAME, options, &Limits::default())
}

/// Gives all that the feed asks for.
fn fill(feed: &mut LexiFeed, file: &[u8]) {
    while let Some(range) = feed.wants() {
        give(feed, file, range).unwrap();
    }
}

fn give(feed: &mut LexiFeed, file: &[u8], range: Range<u64>) -> Result<()> {
    feed.feed(range.start, &file[index(range.start)..index(range.end)])
}

fn index(offset: u64) -> usize {
    usize::try_from(offset).unwrap()
}

fn decoded(feed: &LexiFeed) -> Vec<Model> {
    feed.ready().into_iter().map(|c| feed.decode(c).unwrap().unwrap()).collect()
}

#[test]
fn the_scene_has_several_layers_and_chunks() {
    let outline = outline(file());
    assert!(outline.layers.len() > 1 && outline.chunks.len() > outline.layers.len());
    let kinds = [RangeKind::Base, RangeKind::Refinement(0), RangeKind::Sh(1), RangeKind::Interim];
    assert!(kinds.iter().all(|kind| outline.ranges.iter().any(|range| range.kind == *kind)));
    assert_eq!(outline.layers.iter().map(|layer| layer.gaussians).sum::<u64>(), {
        let reader = LexiReader::open(NAME, file(), &Limits::default()).unwrap();
        reader.len() as u64
    });
    // Ranges follow one another without holes.
    let mut end = outline.ranges[0].bytes.start;
    for range in &outline.ranges {
        assert_eq!((range.bytes.start, range.bytes.is_empty()), (end, false));
        assert_eq!(crc32fast::hash(&file()[index(end)..index(range.bytes.end)]), range.checksum);
        end = range.bytes.end;
    }
}

#[test]
fn what_is_asked_for_makes_the_whole_scene() {
    let file = file();
    let mut feed = feed(&FeedOptions::default().with_verify_integers(true));
    assert!(feed.head().is_none() && feed.outline().is_none() && !feed.is_complete());
    fill(&mut feed, file);
    assert!(feed.is_complete());
    assert_eq!(feed.outline(), Some(&outline(file)));
    assert_eq!(decoded(&feed), whole(file));
}

#[test]
fn any_order_and_any_cuts_make_the_whole_scene() {
    let (file, whole) = (file(), whole(file()));
    let mut random = Random::new(7);
    for most in [200, 5000, 70_000, file.len()] {
        let mut cuts = vec![0];
        while let Some(&last) = cuts.last().filter(|&&last| last < file.len()) {
            cuts.push((last + 1 + random.below(most)).min(file.len()));
        }
        let mut pieces: Vec<Range<usize>> = cuts.windows(2).map(|cut| cut[0]..cut[1]).collect();
        for i in (1..pieces.len()).rev() {
            pieces.swap(i, random.below(i + 1));
        }
        let mut feed = feed(&FeedOptions::default());
        for (i, piece) in pieces.iter().enumerate() {
            // Some of what is asked for comes too, and again.
            if i % 50 == 0
                && let Some(range) = feed.wants()
            {
                give(&mut feed, file, range).unwrap();
            }
            feed.feed(piece.start as u64, &file[piece.clone()]).unwrap();
        }
        assert!(feed.is_complete() && feed.wants().is_none());
        assert!(decoded(&feed) == whole, "pieces of up to {most} bytes");
    }
}

#[test]
fn bytes_one_by_one_are_taken() {
    let splats = sample(300, 2, 1);
    let file = bytes(&pack(&splats, STEP, &options(|_| ())).0);
    let mut feed = feed(&FeedOptions::default());
    for (i, byte) in file.iter().enumerate() {
        feed.feed(i as u64, std::slice::from_ref(byte)).unwrap();
    }
    let model = lexi::read_bytes(NAME, &file, &Limits::default()).unwrap();
    assert_eq!(feed.decode(0).unwrap(), Some(model));
    // Files of one layer and one chunk have no bounds to compare with a box.
    let mut boxed = self::feed(&FeedOptions::default().with_within([[1e9; 3], [1e9; 3]]));
    fill(&mut boxed, &file);
    assert_eq!(boxed.ready(), [0]);
}

#[test]
fn a_wrong_byte_is_found_in_its_range_and_asked_for_again() {
    let (file, outline) = (file(), outline(file()));
    let mut random = Random::new(3);
    for range in &outline.ranges {
        let mut damaged = file.to_vec();
        let at = index(range.bytes.start) + random.below(index(range.bytes.end - range.bytes.start));
        damaged[at] ^= 1 << random.below(8);
        let mut feed = feed(&FeedOptions::default());
        let covered = loop {
            let wanted = feed.wants().unwrap();
            match give(&mut feed, &damaged, wanted) {
                Ok(()) => {}
                Err(Error::Format { problem: FormatError::Checksum { covered }, .. }) => break covered,
                Err(other) => panic!("{other}"),
            }
        };
        assert!(covered.ends_with(&format!("of chunk {}", range.chunk)), "{covered}: {range:?}");
        // The message of the reader of whole files is the same.
        let error = lexi::read_bytes(NAME, &damaged, &Limits::default()).unwrap_err().to_string();
        assert!(error.contains(&format!("'{covered}'")), "{error}: {covered}");
        assert_eq!(feed.wants(), Some(range.bytes.clone()));
        fill(&mut feed, file);
        assert!(feed.is_complete());
    }
}

#[test]
fn damage_at_the_start_is_found_before_any_range() {
    let file = file();
    let start = index(outline(file).ranges[0].bytes.start);
    let mut random = Random::new(5);
    for _ in 0..200 {
        let mut damaged = file.to_vec();
        damaged[random.below(start)] ^= 1 << random.below(8);
        let mut feed = feed(&FeedOptions::default().with_most_bytes(file.len() as u64));
        let mut result = Ok(());
        while result.is_ok() && feed.head().is_none() {
            let wanted = feed.wants().unwrap();
            let end = wanted.end.min(damaged.len() as u64);
            // A length that is too large asks for more than there is.
            if wanted.start >= end {
                break;
            }
            result = give(&mut feed, &damaged, wanted.start..end);
        }
        assert!(feed.head().is_none());
        if result.is_err() {
            fill(&mut feed, file);
            assert!(feed.is_complete());
        }
    }
}

#[test]
fn the_allowance_is_kept() {
    let (file, whole) = (file(), whole(file()));
    let outline = outline(file);
    let start = outline.ranges[0].bytes.start;
    let of = |c: usize| -> u64 {
        let ranges = outline.ranges.iter().filter(|range| range.chunk == c);
        ranges.map(|range| range.bytes.end - range.bytes.start).sum()
    };
    let largest = (0..outline.chunks.len()).map(of).max().unwrap();
    // With room for the start and for all chunks but one, and chunks that are forgotten once they are complete.
    let most = start + (0..outline.chunks.len()).map(of).sum::<u64>() - largest / 2;
    let mut feed = feed(&FeedOptions::default().with_most_bytes(most));
    let mut models: Vec<Option<Model>> = vec![None; outline.chunks.len()];
    while let Some(range) = feed.wants() {
        assert!(range.end - range.start + feed.held_bytes() <= most || range.start < start);
        give(&mut feed, file, range).unwrap();
        assert!(feed.held_bytes() <= most);
        // Only when there is no room, so that no chunk is decoded while the next layer is not there.
        if feed.wants().is_none() && !feed.is_complete() {
            for c in feed.ready().into_iter().filter(|&c| feed.is_chunk_complete(c)).collect::<Vec<_>>() {
                models[c] = feed.decode(c).unwrap();
                feed.forget(c);
                assert!(feed.decode(c).unwrap().is_none());
            }
        }
    }
    assert!(feed.is_complete());
    for c in feed.ready() {
        models[c] = feed.decode(c).unwrap();
    }
    assert!(models.into_iter().map(Option::unwrap).eq(whole));

    // Bytes beyond it are refused, and none of them is taken.
    let mut tight = self::feed(&FeedOptions::default().with_most_bytes(start + 10));
    fill(&mut tight, file);
    assert!(tight.head().is_some() && !tight.is_complete() && tight.held_bytes() <= start + 10);
    let range = outline.ranges[0].bytes.clone();
    let refused = give(&mut tight, file, range.clone()).unwrap_err();
    assert!(matches!(refused, Error::Limit { limit, .. } if limit == start + 10), "{refused}");
    assert_eq!(tight.held_bytes(), start);
    // So is a start that is too long, and what comes before it is known what it is.
    let mut none = self::feed(&FeedOptions::default().with_most_bytes(100));
    give(&mut none, file, 0..9).unwrap_err();
    assert!(matches!(none.feed(5000, &[0; 200]), Err(Error::Limit { .. })));
    assert!(none.held_bytes() <= 100);
    // Ranges that are not asked for take no room.
    let mut without = self::feed(&FeedOptions::default().with_sh_parts(0).with_most_bytes(start));
    fill(&mut without, file);
    let sh = outline.ranges.iter().find(|range| matches!(range.kind, RangeKind::Sh(_))).unwrap();
    give(&mut without, file, sh.bytes.clone()).unwrap();
    assert_eq!(without.held_bytes(), start);
    // Neither do no bytes in the middle of a range.
    let inside = outline.ranges[0].bytes.start + 1;
    tight.feed(inside, &[]).unwrap();
    let mut open = self::feed(&FeedOptions::default());
    open.feed(0, &file[..index(start)]).unwrap();
    open.feed(inside, &[]).unwrap();
    assert_eq!((tight.held_bytes(), open.held_bytes()), (start, start));
}

#[test]
fn the_missing_part_of_a_range_takes_no_more_room() {
    let file = file();
    let outline = outline(file);
    let [first, second] = [0, 1].map(|r| outline.ranges[r].bytes.clone());
    let most = second.end;
    let mut feed = feed(&FeedOptions::default().with_most_bytes(most));
    feed.feed(0, &file[..index(first.start)]).unwrap();
    let middle = second.start.midpoint(second.end);
    give(&mut feed, file, middle..second.end).unwrap();
    assert_eq!(feed.held_bytes(), most - (first.end - first.start));
    // One run, of the first range and of the first half of the second, is longer than the room that is left.
    assert_eq!(feed.wants(), Some(first.start..middle));
    give(&mut feed, file, first.start..middle).unwrap();
    assert_eq!((feed.wants(), feed.held_bytes()), (None, most));
}

#[test]
fn chunks_are_chosen_and_ordered_by_where_they_are() {
    let (file, outline) = (file(), outline(file()));
    let last = outline.chunks.len() - 1;
    let holds_point = |c: usize, point: [f32; 3]| {
        let [least, most] = outline.chunks[c].bounds;
        (0..3).all(|k| (least[k]..=most[k]).contains(&point[k]))
    };
    // A corner of a chunk of the last layer that is not in all others.
    let layer = outline.layers.last().unwrap().chunks.clone();
    let corners = layer.clone().flat_map(|c| {
        let bounds = outline.chunks[c].bounds;
        (0..8).map(move |i| std::array::from_fn(|k| bounds[i >> k & 1][k]))
    });
    let point = corners.into_iter().find(|&point| (0..=last).any(|c| !holds_point(c, point))).unwrap();
    let holds = |c: usize| holds_point(c, point);
    let mut boxed = feed(&FeedOptions::default().with_within([point, point]));
    fill(&mut boxed, file);
    let expected: Vec<usize> = (0..=last).filter(|&c| holds(c)).collect();
    assert!(boxed.is_complete() && expected.len() <= last);
    assert_eq!(boxed.ready(), expected);
    // Another one is asked for by its number.
    let other = (0..=last).find(|&c| !holds(c)).unwrap();
    boxed.want(other);
    fill(&mut boxed, file);
    assert!(boxed.ready().contains(&other));
    boxed.forget(other);
    boxed.want(other);
    assert!(!boxed.is_complete());

    // Near chunks of a layer first, and bases of all before what makes them finer.
    let mut near = feed(&FeedOptions::default().with_nearest(point));
    let mut bases = Vec::new();
    while let Some(range) = near.wants() {
        let first = outline.ranges.iter().find(|r| r.bytes.contains(&range.start));
        if let Some(first) = first {
            bases.extend((first.kind == RangeKind::Base).then_some(first.chunk));
            give(&mut near, file, first.bytes.clone()).unwrap();
        } else {
            give(&mut near, file, range).unwrap();
        }
    }
    assert_eq!(bases.len(), outline.chunks.len());
    let first = *bases.iter().find(|c| layer.contains(c)).unwrap();
    assert!(holds(first), "{first}: {bases:?}");
    assert!(decoded(&near) == whole(file));
}

#[test]
fn the_first_bytes_are_read_as_they_come() {
    let file = file();
    let outline = outline(file);
    let whole = LexiReader::open(NAME, file, &Limits::default()).unwrap();
    assert_eq!(whole.whole_len(), whole.len());
    let mut before = 0;
    for thousandths in [150, 300, 450, 600, 800, 999] {
        let first = &file[..thousandths * file.len() / 1000];
        let reader = LexiReader::open_first(NAME, first, &Limits::default()).unwrap();
        let bases: usize = outline
            .ranges
            .iter()
            .filter(|range| range.kind == RangeKind::Base && range.bytes.end <= first.len() as u64)
            .map(|range| outline.chunks[range.chunk].gaussians)
            .sum();
        assert_eq!((reader.len(), reader.whole_len()), (bases, whole.len()), "{thousandths}");
        assert!(reader.len() >= before);
        before = reader.len();
        // As a feed that got no more, and in all ways to read.
        let mut feed = feed(&FeedOptions::default());
        feed.feed(0, first).unwrap();
        let parts = chunks(&reader);
        assert!(parts == decoded(&feed), "{thousandths}");
        let model = reader.model().unwrap();
        assert_eq!(model.len(), reader.len());
        let dense: Vec<f32> = parts.iter().flat_map(Model::dense_rest).collect();
        assert_eq!(model.dense_rest(), dense);
        let positions: Vec<[f32; 3]> = parts.iter().flat_map(|p| p.geometry().positions.clone()).collect();
        assert_eq!(model.geometry().positions, positions);
        let mut splats = reader.empty();
        reader.read(0..reader.len(), &mut splats).unwrap();
        assert_eq!(splats, model.into_splats());
        assert!(reader.packed().is_err() && reader.order(0..1).is_err() && !reader.order_kept());
    }
    assert_eq!(before, whole.len());
    let all = LexiReader::open_first(NAME, file, &Limits::default()).unwrap();
    assert_eq!(all.model().unwrap(), whole.model().unwrap());
    assert_eq!(all.packed().unwrap(), whole.packed().unwrap());
}

#[test]
fn first_bytes_without_a_head_are_refused() {
    let file = file();
    let start = index(outline(file).ranges[0].bytes.start);
    for len in [0, 5, 9, 200, start - 1] {
        let error = LexiReader::open_first(NAME, &file[..len], &Limits::default()).unwrap_err();
        assert!(len < 8 || error.to_string().contains("truncated"), "{len}: {error}");
    }
    assert_eq!(LexiReader::open_first(NAME, &file[..start], &Limits::default()).unwrap().len(), 0);
    let long = [file, &[0]].concat();
    let error = LexiReader::open_first(NAME, &long, &Limits::default()).unwrap_err();
    assert!(error.to_string().contains("too long"), "{error}");
    // Limits concern what is there.
    let first = &file[..file.len() / 4];
    let there = LexiReader::open_first(NAME, first, &Limits::default()).unwrap().len() as u64;
    assert!(LexiReader::open_first(NAME, first, &Limits::default().with_gaussians(there)).is_ok());
    let few = Limits::default().with_gaussians(there - 1);
    assert!(matches!(LexiReader::open_first(NAME, first, &few), Err(Error::Limit { .. })));
    let golden =
        |name: &str| std::fs::read(format!("{}/tests/golden/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap();
    for name in ["f16.lexi", "paper.lexi"] {
        let bytes = golden(name);
        let exact = LexiReader::open(name, &bytes, &Limits::default()).unwrap();
        assert!(exact.outline().is_none());
        for len in [bytes.len(), bytes.len() - 1] {
            let error = LexiReader::open_first(name, &bytes[..len], &Limits::default()).unwrap_err();
            assert!(error.to_string().contains("only read whole"), "{name}: {error}");
        }
        assert!(matches!(exact.with_sh_parts(0), Err(Error::Parameter { .. })));
        let error = feed(&FeedOptions::default()).feed(0, &bytes).unwrap_err();
        assert!(error.to_string().contains("only read whole"), "{name}: {error}");
    }
}

#[test]
fn extras_are_left_out_of_a_first_part() {
    let splats = with_extras(sample(500, 3, 1));
    let file = bytes(&pack(&splats, STEP, &options(|o| o.keep_order = true)).0);
    let end = outline(&file).ranges.last().unwrap().bytes.end;
    let reader = LexiReader::open_first(NAME, &file[..index(end)], &Limits::default()).unwrap();
    assert!(reader.empty().geometry.extras.is_empty() && !reader.order_kept());
    let model = reader.model().unwrap();
    assert_eq!(model.len(), 500);
    let mut feed = feed(&FeedOptions::default());
    fill(&mut feed, &file);
    assert_eq!(feed.decode(0).unwrap(), Some(model));
    let all = LexiReader::open_first(NAME, &file[..], &Limits::default()).unwrap();
    assert_eq!(all.empty().geometry.extras.len(), 2);
}

/// The header must also be right about tensors that are not there yet.
#[test]
fn tensors_that_are_not_there_yet_are_described_rightly() {
    let splats = with_extras(sample(500, 3, 1));
    let mut good = Parts::of(&bytes(&pack(&splats, STEP, &options(|o| o.keep_order = true)).0));
    good.tensors.sort_by_key(|tensor| tensor.0 != "packed.head");
    let head = good.tensors[0].3.len();
    let first = |file: &[u8]| {
        let file = &file[..header_end(file) + head];
        let opened = LexiReader::open_first(NAME, file, &Limits::default()).map(drop);
        let fed = feed(&FeedOptions::default()).feed(0, file);
        [opened, fed].map(|result| result.map_err(|error| error.to_string()))
    };
    assert_eq!(first(&good.sealed()), [Ok(()), Ok(())]);
    for name in ["packed.data", "packed.order", "extra.label"] {
        let changes: [fn(&mut serde_json::Value, &mut serde_json::Value, usize); 3] = [
            |dtype, _, _| *dtype = "I8".into(),
            |_, shape, len| *shape = serde_json::json!([len, 1]),
            |_, shape, len| *shape = serde_json::json!([1, len]),
        ];
        for change in changes {
            let mut parts = good.clone();
            let tensor = parts.tensors.iter_mut().find(|tensor| tensor.0 == name).unwrap();
            change(&mut tensor.1, &mut tensor.2, tensor.3.len());
            for result in first(&parts.sealed()) {
                let said = result.unwrap_err();
                assert!(said.contains(&format!("tensor '{name}' is not U8 of one dimension")), "{said}");
            }
        }
    }
    // Sums are listed of them too, of nothing else, and as sums are written.
    let sums = good.metadata["checksums"].as_str().unwrap();
    let wrong: [(String, &str); 4] = [
        (sums.replacen("extra.label", "extra.labels", 1), "names 'extra.labels'"),
        (sums.replacen("\"packed.order\":\"", "\"packed.order\":\"0", 1), "lacks tensor 'packed.order'"),
        (sums.replacen("\"packed.order\":\"", "\"x\":\"", 1), "names 'x'"),
        ("{}".to_owned(), "lacks tensor 'extra.label'"),
    ];
    for (sums, rule) in wrong {
        for result in first(&with_sums(&good.sealed(), &sums)) {
            let said = result.unwrap_err();
            assert!(said.contains("metadata 'checksums' ") && said.contains(rule), "{said}");
        }
    }
}

/// Where the header of a file ends.
fn header_end(file: &[u8]) -> usize {
    8 + index(u64::from_le_bytes(*file.first_chunk().unwrap()))
}

/// The file with other sums of its tensors, and a checksum of its head that fits.
fn with_sums(file: &[u8], sums: &str) -> Vec<u8> {
    let (text, data) = file.split_at(header_end(file));
    let mut header: serde_json::Value = serde_json::from_slice(&text[8..]).unwrap();
    header["__metadata__"]["checksums"] = sums.into();
    let offsets = header["packed.head"]["data_offsets"].clone();
    let at = |k: usize| index(offsets[k].as_u64().unwrap());
    let text = header.to_string();
    let mut new = [&(text.len() as u64).to_le_bytes(), text.as_bytes()].concat();
    let mut crc = crc32fast::Hasher::new();
    crc.update(&new);
    crc.update(&data[at(0) + 4..at(1)]);
    new.extend_from_slice(data);
    let sum = header_end(&new) + at(0);
    new[sum..sum + 4].copy_from_slice(&crc.finalize().to_le_bytes());
    new
}

/// Damage of a range that a whole file does not need is found.
#[test]
fn interim_ranges_of_whole_files_have_right_checksums() {
    let mut file = file().to_vec();
    let outline = outline(&file);
    let range = outline.ranges.iter().find(|range| range.kind == RangeKind::Interim).unwrap();
    file[index(range.bytes.start)] ^= 1;
    let error = LexiReader::open(NAME, &file[..], &Limits::default()).unwrap().model().unwrap_err();
    let last = outline.ranges.iter().filter(|other| other.chunk == range.chunk).count() - 1;
    assert!(error.to_string().contains(&format!("'range {last} of chunk {}'", range.chunk)), "{error}");
}

#[test]
fn parts_of_sh_are_dropped_and_colours_seen_stay() {
    let file = file();
    let open = || LexiReader::open(NAME, file, &Limits::default()).unwrap();
    let parts = outline(file).layers[0].sh_parts;
    let full = open().model().unwrap();
    assert_eq!(open().with_sh_parts(parts).unwrap().model().unwrap(), full);
    let mut before = full.codes().nonzeros();
    for sh_parts in (0..parts).rev() {
        let model = open().with_sh_parts(sh_parts).unwrap().model().unwrap();
        assert!(model.codes().nonzeros() < before);
        before = model.codes().nonzeros();
        assert_eq!(model.geometry().positions, full.geometry().positions);
        assert_ne!(model.geometry().dc, full.geometry().dc);
        let mut feed = feed(&FeedOptions::default().with_sh_parts(sh_parts));
        fill(&mut feed, file);
        let chunks = chunks(&open().with_sh_parts(sh_parts).unwrap());
        assert!(decoded(&feed) == chunks);
    }
    assert_eq!(before, 0);
    // From the points of view the scene has on average the colour that it has with SH-rest.
    let without = open().with_sh_parts(0).unwrap().model().unwrap();
    let dense = full.clone().into_splats();
    let points = [[0.0, -1.0, -4.0], [3.0, -1.0, 2.0_f32]];
    for i in (0..dense.len()).step_by(97) {
        let position = dense.geometry.positions[i];
        let mut expected = dense.geometry.dc[i];
        for point in points {
            let off: [f32; 3] = std::array::from_fn(|k| position[k] - point[k]);
            let length = off.iter().map(|x| x * x).sum::<f32>().sqrt();
            let basis = lexisplat::sh::rest_basis(dense.degree, off.map(|x| x / length));
            let per_channel = dense.degree.rest_per_channel();
            for (c, expected) in expected.iter_mut().enumerate() {
                let row = &dense.rest(i)[c * per_channel..][..per_channel];
                let seen: f32 = row.iter().zip(basis).map(|(a, b)| a * b).sum();
                *expected += seen / (0.282_094_8 * points.len() as f32);
            }
        }
        for (found, expected) in without.geometry().dc[i].iter().zip(expected) {
            assert!((found - expected).abs() < 1e-2 + 1e-2 * expected.abs(), "{i}: {found} {expected}");
        }
    }
}

#[test]
fn integers_are_verified_when_asked_for() {
    let file = file();
    let open = |file| LexiReader::open(NAME, file, &Limits::default()).unwrap();
    let verified = open(file).with_integers_verified().unwrap();
    assert_eq!(verified.model().unwrap(), open(file).model().unwrap());
    for share in [5, 2] {
        let first = &file[..file.len() / share];
        let reader = LexiReader::open_first(NAME, first, &Limits::default()).unwrap();
        reader.with_integers_verified().unwrap().model().unwrap();
    }
    let reader = open(file).with_sh_parts(1).unwrap();
    reader.with_integers_verified().unwrap().model().unwrap();
}

#[test]
fn wrong_sums_of_integers_are_found_when_asked_for() {
    let mut parts = Parts::of(file());
    // The head ends with the sum of the last range.
    *parts.tensor("packed.head").unwrap().last_mut().unwrap() ^= 1;
    let file = parts.sealed();
    let last = outline(&file).ranges.last().unwrap().clone();
    assert_ne!(outline(super::feed::file()).ranges.last().unwrap().integers, last.integers);
    let open = || LexiReader::open(NAME, &file[..], &Limits::default()).unwrap();
    assert!(open().model().is_ok());
    let said = |error: Error| {
        let expected =
            format!("the integers of range {} of chunk {}'", number(&last.kind, &file), last.chunk);
        assert!(error.to_string().contains(&expected), "{error}: {expected}");
    };
    said(open().with_integers_verified().unwrap().model().unwrap_err());
    for (verify, fails) in [(false, false), (true, true)] {
        let mut feed = feed(&FeedOptions::default().with_verify_integers(verify));
        fill(&mut feed, &file);
        let result = feed.decode(last.chunk);
        assert_eq!(result.is_err(), fails);
        if let Err(error) = result {
            said(error);
        }
    }
}

/// The number by which errors name a range of the last layer.
fn number(kind: &RangeKind, file: &[u8]) -> usize {
    let refinements = outline(file).layers.last().unwrap().refinements;
    match kind {
        RangeKind::Base => 0,
        RangeKind::Refinement(level) => 1 + level,
        RangeKind::Sh(part) => 1 + refinements + part,
        other => panic!("{other:?} in the last layer"),
    }
}

#[test]
fn ranges_before_the_head_are_taken_with_it() {
    let mut parts = Parts::of(file());
    parts.tensors.sort_by_key(|t| t.0 == "packed.head");
    let file = parts.sealed();
    let mut feed = feed(&FeedOptions::default());
    feed.feed(0, &file).unwrap();
    assert!(feed.is_complete());
    assert_eq!(decoded(&feed), whole(&file));
    assert_eq!(whole(&file), whole(super::feed::file()));
}
