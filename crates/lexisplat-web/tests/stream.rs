//! A scene of which a part is drawn within a budget, as a page draws it, against the library's own.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::BTreeMap;

use lexisplat::lexi::{FeedOptions, LexiFeed, StreamedScene};
use lexisplat::packed::{Budget, Eye, PackOptions, Packer};
use lexisplat::{Limits, Model, Sensitivity, Silent, lexi};
use lexisplat_sample::{SampleOptions, scene};
use lexisplat_web::{Decoder, Feed, Stream};

const NAME: &str = "a.lexi";
/// All parts of SH-rest.
const ALL: u32 = u32::MAX;
const GAUSSIANS: usize = 40_000;
/// Most Gaussians of the first layer, so that there are three layers.
const FIRST_LAYER: usize = 1500;

fn file() -> Vec<u8> {
    let splats = scene(&SampleOptions::new(GAUSSIANS, 4));
    let sensitivity = Sensitivity::guess(&splats.geometry);
    let packer = Packer::new(&splats, &sensitivity, &PackOptions::default().with_lod(FIRST_LAYER)).unwrap();
    let (packed, _) = packer.pack(packer.step_for(36.0), &Silent).unwrap();
    let mut file = Vec::new();
    lexi::LexiWriter::packed(&packed).write(&mut file, &Silent).unwrap();
    file
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an offset in a small file")]
fn bytes(file: &[u8], from: f64, to: f64) -> &[u8] {
    &file[from as usize..to as usize]
}

/// Does what a page does until nothing is to be done, and returns the number of changes.
fn settle(
    stream: &mut Stream,
    decoder: &mut Decoder,
    file: &[u8],
    drawn: &mut BTreeMap<usize, Model>,
) -> usize {
    for changes in 0.. {
        let wanted = stream.wants(3);
        assert!(wanted.len() <= 6 && stream.wants(3).is_empty(), "nothing is asked for twice");
        // The last request is answered first.
        for run in wanted.chunks(2).rev() {
            assert!(stream.feed(run[0], bytes(file, run[0], run[1])).is_ok());
        }
        let Some(change) = stream.change(2) else {
            if wanted.is_empty() {
                return changes;
            }
            continue;
        };
        let change: BTreeMap<String, Vec<usize>> = serde_json::from_str(&change).unwrap();
        change["removed"].iter().for_each(|chunk| assert!(drawn.remove(chunk).is_some()));
        for &chunk in &change["decoded"] {
            let made = decoder.decode(&stream.job(chunk)).ok().unwrap();
            drawn.insert(chunk, made.model().clone());
        }
    }
    unreachable!("a file has an end")
}

#[test]
fn a_page_draws_what_the_library_does() {
    let file = file();
    let mut feed = Feed::new(NAME, 1e9, ALL);
    while feed.header().is_none() {
        let wanted = feed.wants().unwrap();
        assert!(feed.feed(wanted[0], bytes(&file, wanted[0], wanted[1])).is_ok());
    }
    let mut decoder = Decoder::new(NAME, &feed.start().unwrap(), ALL).ok().unwrap();
    let mut stream = Stream::new(feed);
    let mut drawn = BTreeMap::new();
    let gaussians = |drawn: &BTreeMap<usize, Model>| drawn.values().map(Model::len).sum::<usize>();
    let chosen = stream.begin(1e6);
    settle(&mut stream, &mut decoder, &file, &mut drawn);
    assert!(gaussians(&drawn) as f64 == chosen[0] && gaussians(&drawn) <= FIRST_LAYER);

    let mut expected = StreamedScene::new(LexiFeed::new(NAME, &FeedOptions::default(), &Limits::default()));
    for (x, splats) in [(-9.0, 30_000_u16), (9.0, 12_000), (0.0, 3000), (2.0, 50_000)] {
        let eye = [x, 0.0, -2.0, 0.0, 0.0, 1.0, 0.4, 1e-3];
        let chosen = stream.look(&eye, splats.into(), 1e9);
        let changes = settle(&mut stream, &mut decoder, &file, &mut drawn);
        assert!(gaussians(&drawn) as f64 == chosen[0] && chosen[0] <= splats.into() && changes > 0);
        let eye = Eye::at([x, 0.0, -2.0]).with_forward([0.0, 0.0, 1.0]).with_half_angle(0.4).with_pixel(1e-3);
        let budget = Budget::default().with_splats(u64::from(splats)).with_bytes(1_000_000_000_u64);
        while let Some(range) = expected.wants(&eye, &budget) {
            expected.feed(range.start, bytes(&file, range.start as f64, range.end as f64)).unwrap();
        }
        expected.refresh().unwrap();
        assert!(drawn.iter().map(|(&c, model)| (c, model)).eq(expected.chunks()));
        assert!(stream.held() == expected.source().held_bytes() as f64);
    }
    // A view of nothing, and one that is no view.
    assert!(stream.look(&[f32::NAN; 8], 0.0, f64::NAN)[0] == 0.0);
    assert!(stream.look(&[1.0], 1e6, 1e9).is_empty());
    settle(&mut stream, &mut decoder, &file, &mut drawn);
    assert!(drawn.is_empty());
}
