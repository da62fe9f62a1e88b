//! Scenes with levels of detail, and what is chosen and held of them within a budget.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::OnceLock;

use lexisplat::lexi::{DrawnChunks, FeedOptions, LexiFeed, LexiReader, StreamedScene};
use lexisplat::packed::{Budget, Eye, Outline, RangeKind, Selection};
use lexisplat::{Limits, lexi};
use lexisplat_testing::Random;

use super::support::{STEP, bytes, options, pack, sample};

const NAME: &str = "p.lexi";
/// Gaussians of the test scene: enough for several chunks in its last layer.
const GAUSSIANS: usize = 60_000;
/// Most Gaussians of its first layer, so that it has three layers.
const FIRST_LAYER: usize = 2000;

fn file() -> &'static [u8] {
    static FILE: OnceLock<Vec<u8>> = OnceLock::new();
    FILE.get_or_init(|| {
        let options = options(|o| o.lod = Some(FIRST_LAYER));
        bytes(&pack(&sample(GAUSSIANS, 5, 1), STEP, &options).0)
    })
}

fn outline() -> Outline {
    LexiReader::open(NAME, file(), &Limits::default()).unwrap().outline().unwrap().clone()
}

fn index(offset: u64) -> usize {
    usize::try_from(offset).unwrap()
}

fn streamed() -> StreamedScene {
    StreamedScene::new(LexiFeed::new(NAME, &FeedOptions::default(), &Limits::default()))
}

fn fill(scene: &mut StreamedScene, eye: &Eye, budget: &Budget) {
    while let Some(range) = scene.wants(eye, budget) {
        scene.feed(range.start, &file()[index(range.start)..index(range.end)]).unwrap();
    }
    scene.refresh().unwrap();
}

fn any_eye(random: &mut Random) -> Eye {
    let mut number = |most: f32| most * (random.below(2001) as f32 / 1000.0 - 1.0);
    let position = std::array::from_fn(|_| number(12.0));
    let forward = std::array::from_fn(|_| number(1.0));
    let eye = Eye::at(position).with_pixel(number(0.005).max(0.0));
    if random.below(3) == 0 { eye } else { eye.with_forward(forward).with_half_angle(0.5) }
}

fn select(eye: &Eye, budget: &Budget) -> Selection {
    outline().select(eye, budget, &|_| true)
}

#[test]
fn a_first_layer_has_at_most_so_many_gaussians() {
    let outline = outline();
    assert_eq!(outline.layers.len(), 3);
    let counts: Vec<u64> = outline.layers.iter().map(|layer| layer.gaussians).collect();
    assert!(counts[0] <= FIRST_LAYER as u64 && counts[1] > 3 * counts[0] && counts[2] > 5 * counts[1]);
    // All layers but the last fill in for the next.
    for (c, chunk) in outline.chunks.iter().enumerate() {
        let has = outline.ranges.iter().any(|range| range.chunk == c && range.kind == RangeKind::Interim);
        assert_eq!(has, chunk.layer < 2);
        assert_eq!(chunk.next.is_empty(), !has);
        assert!(chunk.next.clone().all(|next| outline.chunks[next].layer == chunk.layer + 1));
    }
    let none = options(|o| o.lod = Some(0));
    assert!(none.check().unwrap_err().to_string().contains("lod"));
}

#[test]
fn without_a_limit_everything_is_chosen() {
    let outline = outline();
    let eye = Eye::at([0.0; 3]);
    let all = select(&eye, &Budget::default());
    let sorted = |numbers: &[usize]| numbers.iter().copied().collect::<BTreeSet<_>>();
    assert_eq!(sorted(&all.chunks), (0..outline.chunks.len()).collect());
    assert_eq!(sorted(&all.ranges), (0..outline.ranges.len()).collect());
    assert_eq!((all.chunks.len(), all.ranges.len()), (outline.chunks.len(), outline.ranges.len()));
    let mut scene = streamed();
    fill(&mut scene, &eye, &Budget::default());
    assert_eq!(scene.model().unwrap().unwrap(), lexi::read_bytes(NAME, file(), &Limits::default()).unwrap());
    // Options of the feed hold.
    let bare = outline.select(&eye, &Budget::default(), &|kind| !matches!(kind, RangeKind::Sh(_)));
    assert!(bare.ranges.iter().all(|&r| !matches!(outline.ranges[r].kind, RangeKind::Sh(_))));
    assert!(bare.chunks == all.chunks && bare.bytes < all.bytes);
}

#[test]
fn a_budget_is_kept_and_layers_follow_each_other() {
    let outline = outline();
    let mut random = Random::new(1);
    for _ in 0..300 {
        let eye = any_eye(&mut random);
        let budget = Budget::default().with_splats(random.below(GAUSSIANS) as u64);
        let budget =
            if random.below(2) == 0 { budget } else { budget.with_bytes(random.below(400_000) as u64) };
        let found = select(&eye, &budget);
        assert_eq!(found, select(&eye, &budget));
        let gaussians = |c: &usize| outline.chunks[*c].gaussians as u64;
        let length = |r: &usize| outline.ranges[*r].bytes.end - outline.ranges[*r].bytes.start;
        assert_eq!(found.splats, found.chunks.iter().map(gaussians).sum::<u64>());
        assert_eq!(found.bytes, found.ranges.iter().map(length).sum::<u64>());
        assert!(found.splats <= budget.splats && found.bytes <= budget.bytes);
        let mut there = BTreeSet::new();
        for &c in &found.chunks {
            let mut before = (0..outline.chunks.len()).filter(|&b| outline.chunks[b].next.contains(&c));
            assert!(before.all(|b| there.contains(&b)), "chunk {c} has nothing to replace");
            assert!(there.insert(c));
        }
        let bases = found.ranges.iter().map(|&r| &outline.ranges[r]);
        let bases: Vec<usize> =
            bases.filter(|range| range.kind == RangeKind::Base).map(|range| range.chunk).collect();
        assert_eq!(bases, found.chunks);
        assert!(found.ranges.iter().all(|&r| there.contains(&outline.ranges[r].chunk)));
    }
}

#[test]
fn nothing_is_left_of_what_was_seen_before() {
    let mut random = Random::new(2);
    let mut scene = streamed();
    for _ in 0..12 {
        let (eye, budget) =
            (any_eye(&mut random), Budget::default().with_splats(random.below(GAUSSIANS) as u64));
        fill(&mut scene, &eye, &budget);
        let mut fresh = streamed();
        fill(&mut fresh, &eye, &budget);
        assert!(scene.chunks().eq(fresh.chunks()), "a chunk shows what is no longer there, or not yet");
        assert_eq!(scene.source().held_bytes(), fresh.source().held_bytes());
        let found = select(&eye, &budget);
        let splats: usize = scene.model().unwrap().map_or(0, |model| model.len());
        assert_eq!(splats as u64, found.splats);
        // Nothing changed, so nothing is decoded anew.
        scene.look(&eye, &budget).unwrap();
        assert!(scene.refresh().unwrap().is_empty());
    }
}

/// While a scene comes, what is chosen is never drawn with holes: a coarse Gaussian fills in until all finer ones are there.
#[test]
fn a_part_that_came_is_drawn_as_by_a_feed_that_has_no_more() {
    let (eye, budget) = (Eye::at([0.0, 0.0, -3.0]), Budget::default());
    let mut scene = streamed();
    let mut taken = Vec::new();
    while let Some(range) = scene.wants(&eye, &budget) {
        scene.feed(range.start, &file()[index(range.start)..index(range.end)]).unwrap();
        taken.push(range);
        scene.refresh().unwrap();
        let mut fresh = LexiFeed::new(NAME, &FeedOptions::default(), &Limits::default());
        for range in &taken {
            fresh.feed(range.start, &file()[index(range.start)..index(range.end)]).unwrap();
        }
        assert_eq!(scene.chunks().map(|(c, _)| c).collect::<Vec<_>>(), fresh.ready());
        assert!(scene.chunks().all(|(c, model)| fresh.decode(c).unwrap().as_ref() == Some(model)));
    }
}

/// Chunks that other feeds decode in steps of a few chunks look, after each step, as if no other chunks had come.
#[test]
fn steps_of_a_few_chunks_leave_no_hole() {
    let feed = || LexiFeed::new(NAME, &FeedOptions::default(), &Limits::default());
    let (mut whole, mut other, mut drawn) = (feed(), feed(), DrawnChunks::default());
    whole.feed(0, &file()[..1000]).unwrap();
    while let (None, Some(range)) = (whole.outline(), whole.wants()) {
        whole.feed(range.start, &file()[index(range.start)..index(range.end)]).unwrap();
    }
    other.feed(0, whole.start().unwrap()).unwrap();
    let mut random = Random::new(3);
    let mut models = BTreeMap::new();
    let mut steps = 0;
    for _ in 0..6 {
        let budget = Budget::default().with_splats(random.below(GAUSSIANS) as u64);
        let chosen = whole.look(&any_eye(&mut random), &budget).unwrap();
        loop {
            let runs = whole.wanted_runs(&[], 3, 5000);
            assert!(runs.len() <= 3 && runs.is_empty() == whole.wants().is_none());
            let others = whole.wanted_runs(&runs, 3, 5000);
            let apart = |a: &Range<u64>, b: &Range<u64>| a.end <= b.start || b.end <= a.start;
            assert!(others.iter().all(|other| runs.iter().all(|run| apart(run, other))));
            if let (Some(run), Some(first)) = (runs.first(), whole.wants()) {
                assert!(run.start <= first.start && first.start < run.end, "the first run is needed most");
            }
            for run in &runs {
                whole.feed(run.start, &file()[index(run.start)..index(run.end)]).unwrap();
            }
            let change = drawn.update(&whole, 2);
            change.removed.iter().for_each(|c| assert!(models.remove(c).is_some()));
            let new = change.decoded.iter().filter(|c| !models.contains_key(*c)).count();
            assert!(new <= 2);
            for &c in &change.decoded {
                other.note_bases(&change.drawn);
                other.want(c);
                for (at, bytes) in whole.ranges(c) {
                    other.feed(at, bytes).unwrap();
                }
                models.insert(c, other.decode(c).unwrap().unwrap());
                other.forget(c);
            }
            // A feed that has the bases and ranges of the drawn chunks, and no others.
            let mut fresh = feed();
            fresh.feed(0, whole.start().unwrap()).unwrap();
            fresh.note_bases(&change.drawn);
            for (&c, model) in models.iter().filter(|_| steps % 8 == 0) {
                fresh.want(c);
                let ranges = whole.ranges(c);
                ranges.iter().for_each(|(at, bytes)| fresh.feed(*at, bytes).unwrap());
                let now = fresh.decode(c).unwrap().unwrap();
                assert_eq!(model.geometry().opacities, now.geometry().opacities, "step {steps}, chunk {c}");
                fresh.forget(c);
            }
            steps += 1;
            if runs.is_empty() && change.is_empty() {
                break;
            }
        }
        assert_eq!(models.len(), chosen.chunks.len());
        assert!(models.iter().all(|(&c, model)| whole.decode(c).unwrap().as_ref() == Some(model)));
    }
    assert!(steps > 20, "{steps}");
}
