//! The steps, as separate processes take them.

use super::*;
use crate::packed::PackOptions;
use crate::scene::source::SplatSource;
use crate::scene::splats::Splats;
use crate::stream::{self, Observed};
use crate::support::sink::Sink;
use crate::{Error, Extra, ExtraValues, Limits, Offset, Result, Sensitivity, ShDegree, Silent, lexi};

/// Number of Gaussians of a bucket in these tests.
const SMALL: usize = 9000;

fn scene(count: usize, seed: u64) -> Splats {
    let mut splats = crate::support::testing::scene(count, seed).with_degree_cut(ShDegree::ONE);
    let values = ExtraValues::U32((0..u32::try_from(count).unwrap()).collect());
    splats.geometry.extras = vec![Extra { name: "number".into(), values }];
    splats
}

fn options() -> PackOptions {
    PackOptions { keep_order: true, atoms: Some(12), ..PackOptions::default() }
}

fn surveys(tiles: &[Splats]) -> Vec<(String, Vec<Survey>)> {
    let of = |(number, tile): (usize, &Splats)| {
        let blocks = Plan::blocks(tile.len()).map(|rows| {
            let survey = Survey::of(tile, rows, 0, &Silent).unwrap();
            Survey::from_bytes(&survey.to_bytes()).unwrap()
        });
        (format!("{number}.ply"), blocks.collect())
    };
    tiles.iter().enumerate().map(of).collect()
}

/// Returns the files that separate processes make of `tiles`. Each step reads its input from bytes, and buckets and groups
/// are taken in reverse order.
fn by_workers(tiles: &[Splats], one_each: bool) -> Vec<Vec<u8>> {
    let plan = Plan::with_bucket(&surveys(tiles), &options(), 38.0, one_each, SMALL).unwrap();
    let plan = Plan::from_bytes(&plan.to_bytes()).unwrap();
    let bucket = |wanted: usize| {
        let mut reader = BucketReader::new(&plan, wanted);
        // The order of blocks makes no difference either.
        for (number, tile) in tiles.iter().enumerate().rev() {
            match number {
                1 => {
                    let pieces = plan.scatter(number, tile, 0..tile.len(), &Silent).unwrap();
                    let own = pieces.iter().filter(|(bucket, _)| *bucket == wanted);
                    own.for_each(|(_, piece)| reader.add_piece(piece).unwrap());
                }
                _ => reader.add(number, tile, 0..tile.len(), &Silent).unwrap(),
            }
        }
        reader.finish()
    };
    let backwards = |count: usize| (0..count).rev();
    let mut looks: Vec<(Vec<u8>, Vec<u8>)> = backwards(plan.buckets())
        .map(|number| {
            let (statistics, looked) = bucket(number).look(&plan, None).unwrap();
            (statistics.to_bytes(), looked.to_bytes())
        })
        .collect();
    looks.reverse();
    let statistics: Vec<_> = looks.iter().map(|look| LookStatistics::from_bytes(&look.0).unwrap()).collect();
    let looked = |number: usize| Looked::from_bytes(&looks[number].1).unwrap();
    let steps = Steps::from_bytes(&Steps::new(&plan, &statistics).unwrap().to_bytes()).unwrap();
    let sample = |group: usize| {
        let mut sample = Sample::new();
        for number in plan.group(group) {
            sample.add(&plan, &bucket(number), &looked(number)).unwrap();
        }
        sample
    };
    let of_groups = |of: &dyn Fn(usize) -> Vec<u8>| -> Vec<Vec<u8>> {
        let mut all: Vec<Vec<u8>> = backwards(plan.groups()).map(of).collect();
        all.reverse();
        all
    };
    let groups = of_groups(&|group| sample(group).statistics(&plan, &steps).unwrap().to_bytes());
    let groups: Vec<_> = groups.iter().map(|bytes| SampleStatistics::from_bytes(bytes).unwrap()).collect();
    let coding = Coding::new(&plan, &steps, &groups, &Silent).unwrap();
    let coding = Coding::from_bytes(&coding.to_bytes()).unwrap();
    let mut coded: Vec<(Vec<u8>, Vec<u8>)> = backwards(plan.buckets())
        .map(|number| {
            let none = None::<&mut crate::packed::Refit<'_>>;
            let done = coding.code(&plan, &bucket(number), &looked(number), none, &Silent).unwrap();
            (done.0.to_bytes(), done.1.to_bytes())
        })
        .collect();
    coded.reverse();
    let counts: Vec<_> = coded.iter().map(|coded| Counts::from_bytes(&coded.0).unwrap()).collect();
    let tables = Tables::from_bytes(&Tables::new(&counts).unwrap().to_bytes()).unwrap();
    let mut written: Vec<Vec<u8>> = backwards(plan.buckets())
        .map(|number| {
            let coded = Coded::from_bytes(&coded[number].1).unwrap();
            coded.with_tables(&plan, &coding, &tables).unwrap().to_bytes()
        })
        .collect();
    written.reverse();
    let file = |(number, own): (usize, std::ops::Range<usize>)| {
        let mut bytes = Vec::new();
        let folder = std::env::temp_dir();
        let mut assembly = Assembly::new(&plan, &coding, &tables, number, folder).unwrap();
        for bucket in own.clone() {
            assembly.push(Coded::from_bytes(&written[bucket]).unwrap()).unwrap();
        }
        let done = assembly.finish(&counts[own], None, &mut bytes, &Silent).unwrap();
        assert_eq!(done.file_bytes(), bytes.len() as u64);
        bytes
    };
    plan.files().into_iter().enumerate().map(file).collect()
}

/// Cuts `splats` into `tiles` tiles of different lengths.
fn cut(splats: &Splats, tiles: usize) -> Vec<Splats> {
    let ends: Vec<usize> = (0..=tiles).map(|k| splats.len() * k * (k + 3) / (tiles * (tiles + 3))).collect();
    let part = |pair: &[usize]| {
        let mut part = splats.empty();
        splats.read(pair[0]..pair[1], &mut part).unwrap();
        part
    };
    ends.windows(2).map(part).collect()
}

fn in_one_process(tiles: &[Splats]) -> Vec<u8> {
    let named: Vec<(String, &dyn SplatSource)> =
        tiles.iter().enumerate().map(|(k, tile)| (format!("{k}.ply"), tile as &dyn SplatSource)).collect();
    let joined = crate::Joined::new(&named).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.lexi");
    let sink = Sink::from(&output);
    let none = None::<&mut dyn stream::Observer<Error>>;
    stream::pack_in_buckets(&joined, none, &options(), 38.0, sink, SMALL, &Silent).unwrap();
    std::fs::read(output).unwrap()
}

#[test]
fn workers_make_the_bytes_of_one_process() {
    let splats = scene(30_000, 4);
    for tiles in [1, 3] {
        let tiles = cut(&splats, tiles);
        let [file] = by_workers(&tiles, false).try_into().unwrap();
        assert!(file == in_one_process(&tiles), "{} tiles", tiles.len());
        let model = lexi::read_bytes("t", &file, &Limits::default()).unwrap();
        assert_eq!(model.geometry().extras, splats.geometry.extras);
    }
}

#[test]
fn one_file_each_holds_its_tile() {
    let tiles = cut(&scene(30_000, 4), 3);
    for (file, tile) in by_workers(&tiles, true).iter().zip(&tiles) {
        let model = lexi::read_bytes("t", file, &Limits::default()).unwrap();
        assert_eq!(model.geometry().extras, tile.geometry.extras);
        let pairs = model.geometry().positions.iter().zip(&tile.geometry.positions);
        let far = pairs.filter(|(a, b)| (0..3).any(|k| (a[k] - b[k]).abs() > 0.1));
        assert_eq!(far.count(), 0);
    }
}

#[test]
fn tiles_that_do_not_go_together_are_named() {
    let tiles = cut(&scene(2000, 4), 3);
    let refused = |change: &dyn Fn(&mut Splats)| -> String {
        let mut tiles = tiles.clone();
        change(&mut tiles[1]);
        let planned = Plan::new(&surveys(&tiles), &options(), 38.0, false);
        let named: Vec<(String, &dyn SplatSource)> = tiles
            .iter()
            .enumerate()
            .map(|(k, tile)| (format!("{k}.ply"), tile as &dyn SplatSource))
            .collect();
        assert!(matches!(crate::Joined::new(&named), Err(Error::Format { .. })));
        planned.unwrap_err().to_string()
    };
    let text = refused(&|tile| *tile = tile.with_degree_cut(ShDegree::ZERO));
    assert_eq!(text, "1.ply: the tile has SH degree 0, where the tiles before have degree 1");
    assert_eq!(refused(&|tile| *tile = tile.empty()), "1.ply: the tile has no Gaussians");
    assert!(refused(&|tile| tile.geometry.extras.clear()).contains("the extra properties none, where"));
    assert!(refused(&|tile| tile.meta.antialiased = true).contains("antialiasing"));
    assert!(Plan::new(&[], &options(), 38.0, false).is_err());
}

#[test]
fn damaged_messages_and_those_of_other_scenes_are_refused() {
    let tiles = cut(&scene(3000, 4), 2);
    let plan = Plan::new(&surveys(&tiles), &options(), 38.0, false).unwrap();
    let bytes = plan.to_bytes();
    for end in (0..bytes.len()).step_by(7) {
        assert!(Plan::from_bytes(&bytes[..end]).is_err(), "{end}");
        let mut damaged = bytes.clone();
        damaged[end] ^= 1 << (end % 8);
        assert!(Plan::from_bytes(&damaged).is_err(), "{end}");
    }
    let error = Looked::from_bytes(&bytes).unwrap_err().to_string();
    assert!(error.contains("plan of version"), "{error}");
    let bucket = |tiles: &[Splats]| -> Result<Bucket> {
        let mut reader = BucketReader::new(&plan, 0);
        for (number, tile) in tiles.iter().enumerate() {
            reader.add(number, tile, 0..tile.len(), &Silent)?;
        }
        Ok(reader.finish())
    };
    // The second tile is not the one that was surveyed.
    let error = bucket(&[tiles[0].clone(), tiles[0].clone()]).unwrap_err().to_string();
    assert!(error.contains("as when it was surveyed"), "{error}");
    let whole = bucket(&tiles).unwrap();
    let (statistics, looked) = whole.look(&plan, None).unwrap();
    let part = bucket(&tiles[..1]).unwrap();
    assert!(Sample::new().add(&plan, &part, &looked).is_err());
    assert!(Steps::new(&plan, &[statistics.clone(), statistics]).is_err());
}

#[test]
fn a_bucket_that_asks_for_half_the_step_has_four_times_the_sensitivity() {
    let tiles = [scene(3000, 4), scene(1000, 5)];
    let plan = Plan::with_bucket(&surveys(&tiles), &options(), 38.0, true, SMALL).unwrap();
    let mut reader = BucketReader::new(&plan, 0);
    reader.add(0, &tiles[0], 0..3000, &Silent).unwrap();
    let bucket = reader.finish();
    let own = Sensitivity::guess(&bucket.splats().geometry);
    let looked = |step_factor: f64| {
        bucket.look(&plan, Some(Observed { step_factor, ..own.clone().into() })).map(|pair| pair.1)
    };
    let sensitivities = |looked: &Looked| looked.of_each(&plan, &bucket, false).unwrap().0;
    let (usual, half) = (looked(1.0).unwrap(), looked(0.5).unwrap());
    for ((own, usual), half) in own.appearances().iter().zip(sensitivities(&usual)).zip(sensitivities(&half))
    {
        // Sensitivities are rounded to an eighth of an octave.
        let is_about = |a: f32, b: f32| (a / b).log2().abs() < 0.07;
        assert!(
            is_about(usual.colour, 0.75 * own.colour) && is_about(half.colour, 4.0 * usual.colour),
            "{own:?} {usual:?} {half:?}"
        );
    }
    // The observer gets its own sensitivities back.
    let observed = |looked: &Looked| looked.observation(&plan, &bucket).observed(&sensitivities(looked));
    let again = [observed(&half), observed(&usual)];
    for (a, b) in again[0].iter().zip(&again[1]) {
        assert!((a.opacity / b.opacity).log2().abs() < 0.07, "{a:?} {b:?}");
    }
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(looked(wrong).unwrap_err().to_string().contains("step factor"));
    }
}

/// Returns a scene of one bucket: its plan, its coding, its counts and the coded bucket.
fn coded() -> (Plan, Coding, Counts, Coded) {
    let tiles = [scene(3000, 4)];
    let plan = Plan::new(&surveys(&tiles), &options(), 38.0, false).unwrap();
    let mut reader = BucketReader::new(&plan, 0);
    reader.add(0, &tiles[0], 0..3000, &Silent).unwrap();
    let bucket = reader.finish();
    let (statistics, looked) = bucket.look(&plan, None).unwrap();
    let steps = Steps::new(&plan, &[statistics]).unwrap();
    let mut sample = Sample::new();
    sample.add(&plan, &bucket, &looked).unwrap();
    let groups = [sample.statistics(&plan, &steps).unwrap()];
    let coding = Coding::new(&plan, &steps, &groups, &Silent).unwrap();
    let none = None::<&mut crate::packed::Refit<'_>>;
    let (counts, coded) = coding.code(&plan, &bucket, &looked, none, &Silent).unwrap();
    (plan, coding, counts, coded)
}

#[test]
fn buckets_are_coded_anew_without_a_change() {
    let (plan, coding, counts, coded) = coded();
    // The tables of this bucket alone are those that it is coded with.
    let tables = Tables::new(std::slice::from_ref(&counts)).unwrap();
    let same = coded.clone().with_tables(&plan, &coding, &tables).unwrap();
    assert!(same.to_bytes() == coded.to_bytes());
    // Recodes the bucket with other tables, and back.
    let mut more = counts.clone();
    more.counts.add(&counts.counts);
    let other = Tables::new(&[more, counts.clone()]).unwrap();
    let there = coded.clone().with_tables(&plan, &coding, &other).unwrap();
    assert!(there.with_tables(&plan, &coding, &tables).unwrap().to_bytes() == coded.to_bytes());
}

#[test]
fn damaged_buckets_are_refused_or_are_others() {
    let (plan, coding, counts, coded) = coded();
    let tables = Tables::new(&[counts]).unwrap();
    let mut refused = 0;
    for at in 0..400 {
        let mut damaged = coded.clone();
        damaged.damage(at * 7919);
        refused += usize::from(damaged.with_tables(&plan, &coding, &tables).is_err());
    }
    assert!(refused > 300, "{refused}");
}

/// Tiles of a geographic survey, each with an offset of its own, become one scene, by separate processes and in one
/// process.
#[test]
fn tiles_with_other_offsets_are_one_scene() {
    let mut tiles = [scene(6000, 1), scene(7000, 2), scene(5000, 3)];
    for (tile, x) in tiles.iter_mut().zip([5e5, 5e5 + 2.0, 5e5 + 4.0]) {
        tile.meta.offset = Offset::new([x, 4_649_776.0, 0.0]).unwrap();
    }
    let [file] = by_workers(&tiles, false).try_into().unwrap();
    assert!(file == in_one_process(&tiles));
    let model = lexi::read_bytes("t", &file, &Limits::default()).unwrap();
    assert_eq!(model.meta().offset, tiles[1].meta.offset);
    let moved = tiles.iter().zip([-2.0, 0.0, 2.0]);
    let expected =
        moved.flat_map(|(tile, x)| tile.geometry.positions.iter().map(move |p| [p[0] + x, p[1], p[2]]));
    let pairs = model.geometry().positions.iter().zip(expected);
    let far = pairs.filter(|(a, b)| (0..3).any(|k| (a[k] - b[k]).abs() > 0.1));
    assert_eq!(far.count(), 0);
}

/// Messages of one scene are refused by another, whatever its degree.
#[test]
fn messages_of_another_scene_are_refused() {
    let (plan, coding, counts, coded) = coded();
    let other = [scene(3000, 5).with_degree_cut(ShDegree::ZERO)];
    let other = Plan::new(&surveys(&other), &options(), 38.0, false).unwrap();
    let tables = Tables::new(&[counts]).unwrap();
    assert!(coded.clone().with_tables(&other, &coding, &tables).is_err());
    assert!(coding.encoding(&other).is_err() && coding.encoding(&plan).is_ok());
    assert!(tables.read(&other).is_err());
    // Tables of other counts lack symbols.
    let mut reader = BucketReader::new(&other, 0);
    reader.add(0, &scene(3000, 5).with_degree_cut(ShDegree::ZERO), 0..3000, &Silent).unwrap();
    let bucket = reader.finish();
    let (statistics, looked) = bucket.look(&other, None).unwrap();
    assert!(Steps::new(&plan, std::slice::from_ref(&statistics)).is_err());
    let steps = Steps::new(&other, &[statistics]).unwrap();
    assert!(Sample::new().statistics(&plan, &steps).is_err());
    assert!(Sample::new().add(&plan, &bucket, &looked).is_err());
    let none = None::<&mut crate::packed::Refit<'_>>;
    assert!(coding.code(&plan, &bucket, &looked, none, &Silent).is_err());
}
