//! Packing of scenes that are read a part at a time, with buckets of any size.

use super::*;
use crate::packed::tiles::SHOWN;
use crate::packed::{Appearance, MOST_CHUNK};
use crate::scene::sensitivity::guessed_total;
use crate::stream::Observed;
use crate::{Extra, ExtraValues, Model, Silent, Splats, lexi, ply};

fn scene(count: usize) -> Splats {
    let mut splats = crate::support::testing::scene(count, 4);
    splats = splats.with_degree_cut(crate::ShDegree::new(1).unwrap());
    let values = ExtraValues::U32((0..u32::try_from(count).unwrap()).collect());
    splats.geometry.extras = vec![Extra { name: "number".into(), values }];
    splats
}

fn options() -> PackOptions {
    PackOptions { keep_order: true, atoms: Some(12), ..PackOptions::default() }
}

/// An observer that draws nothing. Its methods return the results of the given functions.
struct Told<J, R = fn(ToRefit<'_, '_>) -> Result<Option<Vec<Appearance>>>> {
    judge: J,
    refit: Option<R>,
}

impl<J> Told<J> {
    fn by(judge: J) -> Self {
        Self { judge, refit: None }
    }
}

impl<J, O, R> Observer for Told<J, R>
where
    J: FnMut(&Splats) -> Result<O>,
    O: Into<Observed>,
    R: FnMut(ToRefit<'_, '_>) -> Result<Option<Vec<Appearance>>>,
{
    fn observe(&mut self, part: &Splats) -> Result<Observed> {
        let memo = u64::try_from(part.len()).unwrap().to_le_bytes().to_vec();
        Ok(Observed { memo, ..(self.judge)(part)?.into() })
    }

    fn refit(&mut self, of: ToRefit<'_, '_>) -> Result<Option<Vec<Appearance>>> {
        assert_eq!(of.memo, u64::try_from(of.part.len()).unwrap().to_le_bytes());
        match &mut self.refit {
            Some(refit) => refit(of),
            None => Ok(None),
        }
    }
}

fn streamed(
    splats: &Splats,
    observer: Option<&mut dyn Observer>,
    bucket: usize,
) -> Result<(Vec<u8>, PackedFile)> {
    streamed_with(splats, observer, &options(), bucket)
}

fn streamed_with(
    splats: &Splats,
    observer: Option<&mut dyn Observer>,
    options: &PackOptions,
    bucket: usize,
) -> Result<(Vec<u8>, PackedFile)> {
    let mut bytes = Vec::new();
    ply::write(&mut bytes, splats).unwrap();
    let chunks = ply::PlySource::open("t.ply", &bytes, &ply::ReadOptions::default(), &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.lexi");
    let done = run(&chunks, observer, options, 38.0, Sink::from(&output), bucket, &Silent);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), usize::from(done.is_ok()));
    done.map(|done| (std::fs::read(output).unwrap(), done))
}

/// If all Gaussians are in one bucket, no step finds other values than the packer.
#[test]
fn a_scene_that_is_its_own_sample_gives_the_bytes_of_the_packer() {
    for count in [MOST_CHUNK + 500, 700, 0] {
        let splats = scene(count);
        let total = guessed_total(0.0, &splats.geometry) / SHOWN;
        let sensitivity = Sensitivity::guess_of_part(&splats.geometry, total);
        let (found, done) = streamed(&splats, None, BUCKET).unwrap();
        // A judge whose sensitivity of each Gaussian is the guessed one.
        let mut told = Told::by(|part: &Splats| {
            assert_eq!(part.len(), splats.len());
            Ok(Sensitivity::guess_of_part(&part.geometry, total))
        });
        assert!(streamed(&splats, Some(&mut told), BUCKET).unwrap().0 == found, "{count}");
        let packer = Packer::new(&splats, &sensitivity, &options()).unwrap();
        let (packed, _) = packer.pack(packer.step_for(38.0), &Silent).unwrap();
        let mut expected = Vec::new();
        LexiWriter::packed(&packed).write(&mut expected, &Silent).unwrap();
        assert!(found == expected, "{count}");
        assert_eq!(done.tensor_bytes, LexiWriter::packed(&packed).tensor_bytes());
        let bits = packed.stream_bits().unwrap();
        for (a, b) in done.report.stream_bits.iter().zip(&bits) {
            assert!((a.bits - b.bits).abs() <= 1e-9 * b.bits, "{a:?} {b:?}");
        }
    }
}

/// The sensitivity of pictures that do not change without every fifth Gaussian.
fn shown(part: &Splats, total: f64) -> Sensitivity {
    let ExtraValues::U32(numbers) = &part.geometry.extras[0].values else { panic!("not u32") };
    let mut sensitivity = Sensitivity::guess_of_part(&part.geometry, total);
    sensitivity.removal.fill(0.5);
    for (opacity, _) in sensitivity.opacity.iter_mut().zip(numbers).filter(|(_, n)| n.is_multiple_of(5)) {
        *opacity = 1e-25;
    }
    sensitivity
}

#[test]
fn what_is_not_worth_its_bits_is_left_out() {
    let options = PackOptions { keep_order: false, ..options() };
    let splats = scene(MOST_CHUNK + 9000);
    let total = guessed_total(0.0, &splats.geometry) / SHOWN;
    let packer = Packer::new(&splats, &shown(&splats, total), &options).unwrap();
    let (packed, _) = packer.pack(packer.step_for(38.0), &Silent).unwrap();
    let mut expected = Vec::new();
    LexiWriter::packed(&packed).write(&mut expected, &Silent).unwrap();
    let mut told = Told::by(|part: &Splats| Ok(shown(part, total)));
    let (found, done) = streamed_with(&splats, Some(&mut told), &options, BUCKET).unwrap();
    assert!(found == expected);
    assert!(done.head.removed >= (splats.len() / 5) as u64, "{}", done.head.removed);
    // Chunks get Gaussians of several buckets, and the values of a Gaussian stay together.
    let small = 9000;
    let mut told = Told::by(|part: &Splats| Ok(shown(part, total)));
    let (found, done) = streamed_with(&splats, Some(&mut told), &options, small).unwrap();
    let model = lexi::read_bytes("t", &found, &Limits::default()).unwrap();
    let geometry = model.geometry();
    assert_eq!((geometry.len(), done.head.gaussians), (model.len(), model.len()));
    assert_eq!(done.head.removed, (splats.len() - model.len()) as u64);
    let ExtraValues::U32(numbers) = &geometry.extras[0].values else { panic!("not u32") };
    assert!(numbers.iter().all(|n| !n.is_multiple_of(5)));
    for (position, &number) in geometry.positions.iter().zip(numbers) {
        let original = splats.geometry.positions[number as usize];
        assert!((0..3).all(|k| (position[k] - original[k]).abs() < 0.1), "{number}");
    }
}

#[test]
fn appearances_are_fitted_part_by_part() {
    let options = PackOptions { keep_order: false, ..options() };
    let splats = scene(MOST_CHUNK + 9000);
    let total = guessed_total(0.0, &splats.geometry) / SHOWN;
    let others = |model: &Model| -> Vec<Appearance> {
        let moved = |i| {
            let Appearance { dc, log_opacity } = Appearance::of(model.geometry(), i);
            Appearance { dc: dc.map(|v| v + 0.5), log_opacity: log_opacity - 0.3 }
        };
        (0..model.len()).map(moved).collect()
    };
    let fitted = |options: &PackOptions, bucket: usize| {
        let refit = |of: ToRefit<'_, '_>| {
            // The part also has the Gaussians that the file leaves out, and the others are in order.
            assert!(of.part.len() > of.model.len() || options.keep_order);
            assert_eq!(of.model.len(), of.sensitivities.len());
            Ok(Some(others(&of.model)))
        };
        let mut told = Told { judge: |part: &Splats| Ok(shown(part, total)), refit: Some(refit) };
        streamed_with(&splats, Some(&mut told), options, bucket).unwrap().0
    };
    let sensitivity = shown(&splats, total);
    let file = |options: &PackOptions, fitted: bool| {
        let packer = Packer::new(&splats, &sensitivity, options).unwrap();
        let quantised = packer.quantise(packer.step_for(38.0), true, &Silent).unwrap();
        let model = quantised.finish(None, None, &Silent).unwrap().0.unpack().unwrap();
        let shown = fitted.then(|| others(&model));
        let (packed, _) = quantised.finish(shown.as_deref(), None, &Silent).unwrap();
        let mut bytes = Vec::new();
        LexiWriter::packed(&packed).write(&mut bytes, &Silent).unwrap();
        bytes
    };
    assert!(fitted(&options, BUCKET) == file(&options, true));
    let keeps = PackOptions { keep_order: true, ..options.clone() };
    assert!(fitted(&keeps, BUCKET) == file(&keeps, false));
    let model = lexi::read_bytes("t", &fitted(&options, 9000), &Limits::default());
    let model = model.unwrap();
    let ExtraValues::U32(numbers) = &model.geometry().extras[0].values else { panic!("not u32") };
    let moved = model.geometry().dc.iter().zip(numbers);
    let moved = moved.map(|(dc, &number)| f64::from(dc[0] - splats.geometry.dc[number as usize][0]));
    let mean = moved.sum::<f64>() / model.len() as f64;
    assert!((0.45..0.55).contains(&mean), "{mean}");
}

/// The first half of the Gaussians of a part in another order and at other places, and the guess of all.
fn moved_half(part: &Splats) -> Observed {
    let order: Vec<u32> = (0..u32::try_from(part.len()).unwrap() / 2).rev().collect();
    let mut half = part.gathered(&order);
    half.geometry.positions.iter_mut().for_each(|position| position[1] -= 3.0);
    let sensitivity = Sensitivity::guess(&half.geometry);
    Observed { instead: Some(half), ..sensitivity.into() }
}

#[test]
fn other_gaussians_are_packed_instead_of_a_part() {
    let options = PackOptions { keep_order: false, ..options() };
    let splats = scene(12_000);
    for bucket in [3000, BUCKET] {
        let mut parts = 0;
        let refit = |of: ToRefit<'_, '_>| {
            parts += 1;
            assert!(of.part.len() >= 2 * of.model.len(), "{} {}", of.part.len(), of.model.len());
            let rows = vec![0.0; of.model.dense_rest().len()];
            of.quantised.set_sh_rest(&rows, &Silent)?;
            Ok(None)
        };
        let mut told = Told { judge: |part: &Splats| Ok(moved_half(part)), refit: Some(refit) };
        let (found, done) = streamed_with(&splats, Some(&mut told), &options, bucket).unwrap();
        assert_eq!(parts, 12_000_usize.div_ceil(bucket));
        let model = lexi::read_bytes("t", &found, &Limits::default()).unwrap();
        // A part of an odd number has one less.
        assert!((6000 - parts..=6000).contains(&model.len()), "{}", model.len());
        assert_eq!(done.head.removed, (12_000 - model.len()) as u64);
        let ExtraValues::U32(numbers) = &model.geometry().extras[0].values else { panic!("not u32") };
        for (position, &number) in model.geometry().positions.iter().zip(numbers) {
            let [x, y, z] = splats.geometry.positions[number as usize];
            assert!((0..3).all(|k| (position[k] - [x, y - 3.0, z][k]).abs() < 0.1), "{number}");
        }
        let largest = model.into_splats().sh_rest.into_iter().fold(0.0_f32, |most, v| most.max(v.abs()));
        assert!(largest < 0.1, "{largest}");
    }
    let mut told = Told::by(|part: &Splats| Ok(moved_half(part)));
    let error = streamed(&splats, Some(&mut told), 3000).unwrap_err().to_string();
    assert!(error.contains("keep_order"), "{error}");
    let mut told = Told::by(|part: &Splats| {
        let instead = part.clone().with_degree_cut(crate::ShDegree::new(0).unwrap());
        Ok(Observed { instead: Some(instead), ..Sensitivity::guess(&part.geometry).into() })
    });
    let error = streamed_with(&splats, Some(&mut told), &options, 3000).unwrap_err().to_string();
    assert!(error.contains("SH degree 0"), "{error}");
}

#[test]
fn one_gaussian_stays() {
    let options = PackOptions { keep_order: false, ..options() };
    let splats = scene(9000);
    let small = 3000;
    let mut told = Told::by(|part: &Splats| {
        let mut none = Sensitivity::guess(&part.geometry);
        none.removal.fill(0.5);
        none.opacity.fill(0.0);
        Ok(none)
    });
    let (found, _) = streamed_with(&splats, Some(&mut told), &options, small).unwrap();
    assert_eq!(lexi::read_bytes("t", &found, &Limits::default()).unwrap().len(), 1);
}

#[test]
fn buckets_make_a_file_that_is_as_good() {
    let splats = scene(4 * MOST_CHUNK + 2000);
    let small = MOST_CHUNK;
    let (found, done) = streamed(&splats, None, small).unwrap();
    let (whole, _) = streamed(&splats, None, BUCKET).unwrap();
    let ratio = found.len() as f64 / whole.len() as f64;
    assert!((0.97..1.03).contains(&ratio), "{ratio}");
    let model = lexi::read_bytes("t", &found, &Limits::default()).unwrap();
    // The order was kept, so each Gaussian is at its index in the source.
    assert_eq!(model.geometry().extras, splats.geometry.extras);
    let far = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).any(|k| (a[k] - b[k]).abs() > 0.1);
    let moved = model.geometry().positions.iter().zip(&splats.geometry.positions).filter(|&p| far(p));
    assert_eq!(moved.count(), 0);
    assert_eq!(done.head.gaussians, splats.len());
    assert_eq!(done.report.nonzero_histogram.iter().sum::<u64>() + done.report.escapes, splats.len() as u64);
}

#[test]
fn every_gaussian_is_judged_once_beside_its_neighbours() {
    let splats = scene(12_000);
    let small = 3000;
    let mut seen = Vec::new();
    let mut parts = 0;
    let mut told = Told::by(|part: &Splats| {
        let ExtraValues::U32(numbers) = &part.geometry.extras[0].values else { panic!("not u32") };
        seen.extend_from_slice(numbers);
        parts += 1;
        Ok(Sensitivity::guess(&part.geometry))
    });
    let (found, _) = streamed(&splats, Some(&mut told), small).unwrap();
    assert_eq!(parts, 4);
    let model = lexi::read_bytes("t", &found, &Limits::default()).unwrap();
    assert_eq!(model.geometry().extras, splats.geometry.extras);
    seen.sort_unstable();
    assert!(seen.into_iter().eq(0..12_000));
}

#[test]
fn what_a_judge_says_is_checked_and_its_errors_are_handed_on() {
    let splats = scene(700);
    let refused = |judge: &mut dyn FnMut(&Splats) -> Result<Sensitivity>| {
        streamed(&splats, Some(&mut Told::by(judge)), BUCKET).unwrap_err().to_string()
    };
    let error = refused(&mut |part| Ok(Sensitivity::zeros(part.len() - 1)));
    assert!(error.contains("699") && error.contains("700"), "{error}");
    let mut broken = Sensitivity::zeros(700);
    broken.opacity[3] = f32::NAN;
    assert!(refused(&mut |_| Ok(broken.clone())).contains("NaN"));
    assert_eq!(refused(&mut |_| Err(Error::parameter("view", 7, "none"))), "view = 7: none");
}

#[test]
fn gaussians_in_one_place_do_not_make_one_bucket_of_all() {
    let mut splats = scene(5000);
    splats.geometry.positions.fill([1.0; 3]);
    let small = 700;
    let (found, _) = streamed(&splats, None, small).unwrap();
    let model = lexi::read_bytes("t", &found, &Limits::default()).unwrap();
    assert_eq!(model.geometry().extras, splats.geometry.extras);
}
