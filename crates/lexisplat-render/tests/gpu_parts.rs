//! Scenes on the GPU that are made of parts.

use std::ops::Range;

use crate::adapter::gpu;
use crate::made;
use lexisplat::{Escapes, Geometry, Indices, Model, ShDegree, Silent, SparseCodes, Splats, Values};
use lexisplat_render::gpu::{Gpu, GpuRenderer, GpuScene, SceneForm, ScenePart, ShPath};
use lexisplat_render::{Camera, Error, RenderOptions, Scene};

/// Bytes of the dictionary of [`sparse`]: 90 atoms of twelve vectors.
const ATOM_BYTES: u64 = 90 * 12 * 16;

fn geometry(all: &Geometry, range: Range<usize>) -> Geometry {
    Geometry {
        positions: all.positions[range.clone()].to_vec(),
        dc: all.dc[range.clone()].to_vec(),
        opacities: all.opacities[range.clone()].to_vec(),
        scales: all.scales[range.clone()].to_vec(),
        rotations: all.rotations[range].to_vec(),
        ..Geometry::default()
    }
}

/// The Gaussians in `range` of a dense scene.
pub(crate) fn dense_run(all: &Splats, range: Range<usize>) -> Splats {
    let dim = all.degree.rest();
    Splats {
        sh_rest: all.sh_rest[range.start * dim..range.end * dim].to_vec(),
        geometry: geometry(&all.geometry, range),
        degree: all.degree,
        meta: all.meta.clone(),
    }
}

/// The Gaussians in `range` of a compressed scene; without its exact rows unless `escapes`.
pub(crate) fn sparse_run(all: &Model, range: Range<usize>, escapes: bool) -> Model {
    let codes = all.codes();
    let sum = |counts: &[u8]| counts.iter().map(|&c| usize::from(c)).sum::<usize>();
    let (first, dim) = (sum(&codes.counts()[..range.start]), all.degree().rest());
    let counts = codes.counts()[range.clone()].to_vec();
    let own = first..first + sum(&counts);
    let indices = match codes.indices() {
        Indices::U8(v) => Indices::U8(v[own.clone()].to_vec()),
        Indices::U16(v) => Indices::U16(v[own.clone()].to_vec()),
    };
    let values = match codes.values() {
        Values::F16(v) => Values::F16(v[own].to_vec()),
        Values::F32(v) => Values::F32(v[own].to_vec()),
    };
    let mut exact = Escapes::default();
    for (k, &gaussian) in codes.escapes().gaussians.iter().enumerate() {
        if escapes && range.contains(&(gaussian as usize)) {
            exact.gaussians.push(gaussian - range.start as u32);
            exact.rows.extend_from_slice(&codes.escapes().rows[k * dim..(k + 1) * dim]);
        }
    }
    let codes = SparseCodes::new(all.dictionary(), counts, indices, values, exact).unwrap();
    let (meta, record) = (all.meta().clone(), all.record().clone());
    Model::new(geometry(all.geometry(), range), meta, all.dictionary().clone(), codes, record).unwrap()
}

pub(crate) fn sparse(seed: u64, count: usize) -> Model {
    made::model_of(made::scene(seed, count, ShDegree::THREE, true), 90, true)
}

/// Three views of `scene`, one from inside.
fn pictures(renderer: &mut GpuRenderer, scene: &GpuScene) -> Vec<Vec<u32>> {
    let mut cameras: Vec<Camera> = (0..3).map(|seed| made::camera(seed, 70, 50)).collect();
    cameras[2].position = [0.2, 0.1, 0.0];
    let options = RenderOptions::default().with_background([0.1, 0.4, 0.9]);
    let draw = |camera: &Camera| {
        let (image, _) = renderer.render(scene, camera, &options).unwrap();
        image.pixels.as_flattened().iter().map(|v| v.to_bits()).collect()
    };
    cameras.iter().map(draw).collect()
}

/// Where the parts of 3000 Gaussians begin and end. None is a whole number of blocks, and one is empty.
const RUNS: [Range<usize>; 6] = [0..700, 700..701, 701..701, 701..1700, 1700..2777, 2777..3000];

/// Checks scenes made of parts of `run` against those that `whole` uploads.
fn check<'a>(
    gpu: &Gpu,
    form: &SceneForm,
    run: impl Fn(Range<usize>) -> ScenePart<'a>,
    whole: impl Fn(&[Range<usize>]) -> GpuScene,
) {
    let mut renderer = GpuRenderer::new(gpu).unwrap();
    let mut scene = GpuScene::of_parts(gpu, form).unwrap();
    let empty = pictures(&mut renderer, &scene);
    let mut there = [false; RUNS.len()];
    let mut last = empty.clone();
    for step in [4, 0, 5, 2, 3, 1] {
        scene.put(10 * step, &run(RUNS[step].clone())).unwrap();
        there[step] = true;
        let runs: Vec<_> = (0..RUNS.len()).filter(|&k| there[k]).map(|k| RUNS[k].clone()).collect();
        let expected = whole(&runs);
        assert_eq!((scene.len(), scene.bounds()), (expected.len(), expected.bounds()));
        let found = pictures(&mut renderer, &scene);
        assert!(found == pictures(&mut renderer, &expected), "with part {step}");
        assert!(found != last || step == 2 || step == 1, "part {step} does not show");
        last = found;
    }
    // A part is replaced by a coarser one, then by that and more.
    scene.put(30, &run(701..900)).unwrap();
    let coarse = pictures(&mut renderer, &scene);
    assert!(coarse == pictures(&mut renderer, &whole(&[0..900, 1700..3000])) && coarse != last);
    scene.put(30, &run(701..1700)).unwrap();
    assert!(pictures(&mut renderer, &scene) == last);
    assert!(scene.remove(0) && !scene.remove(0) && !scene.remove(1));
    assert!(pictures(&mut renderer, &scene) == pictures(&mut renderer, &whole(&[700..1700, 1700..3000])));
    scene.clear();
    assert!((scene.len(), scene.parts(), scene.bounds()) == (0, 0, None));
    assert!(pictures(&mut renderer, &scene) == empty);
    scene.put(0, &run(0..3000)).unwrap();
    assert!(pictures(&mut renderer, &scene) == last);
}

#[test]
fn dense_parts_draw_the_picture_of_the_whole() {
    let Some(gpu) = gpu() else { return };
    let all = made::scene(5, 3000, ShDegree::new(2).unwrap(), false);
    let whole = |runs: &[Range<usize>]| {
        let runs: Vec<_> = runs.iter().map(|run| dense_run(&all, run.clone())).collect();
        let mut joined = Splats { geometry: Geometry::default(), sh_rest: Vec::new(), ..all.clone() };
        for run in runs {
            joined.geometry.positions.extend(run.geometry.positions);
            joined.geometry.dc.extend(run.geometry.dc);
            joined.geometry.opacities.extend(run.geometry.opacities);
            joined.geometry.scales.extend(run.geometry.scales);
            joined.geometry.rotations.extend(run.geometry.rotations);
            joined.sh_rest.extend(run.sh_rest);
        }
        GpuScene::new(&gpu, &Scene::from(&joined), ShPath::DenseF32).unwrap()
    };
    let run = |range| ScenePart::new(&Scene::from(&dense_run(&all, range))).unwrap();
    check(&gpu, &SceneForm::of(&Scene::from(&all)), run, whole);
}

/// The Gaussians of several runs of a compressed scene.
fn joined(all: &Model, runs: &[Range<usize>], escapes: bool) -> Model {
    let (mut geometry, mut counts, mut exact) = (Geometry::default(), Vec::new(), Escapes::default());
    let (mut indices, mut values) = (Vec::new(), Vec::new());
    for run in runs {
        let part = sparse_run(all, run.clone(), escapes);
        let (codes, g) = (part.codes(), part.geometry());
        exact.gaussians.extend(codes.escapes().gaussians.iter().map(|i| i + counts.len() as u32));
        exact.rows.extend_from_slice(&codes.escapes().rows);
        counts.extend_from_slice(codes.counts());
        let (Indices::U8(own), Values::F16(coefficients)) = (codes.indices(), codes.values()) else {
            panic!("codes of other widths")
        };
        indices.extend_from_slice(own);
        values.extend_from_slice(coefficients);
        geometry.positions.extend_from_slice(&g.positions);
        geometry.dc.extend_from_slice(&g.dc);
        geometry.opacities.extend_from_slice(&g.opacities);
        geometry.scales.extend_from_slice(&g.scales);
        geometry.rotations.extend_from_slice(&g.rotations);
    }
    let codes =
        SparseCodes::new(all.dictionary(), counts, Indices::U8(indices), Values::F16(values), exact).unwrap();
    let (meta, record) = (all.meta().clone(), all.record().clone());
    Model::new(geometry, meta, all.dictionary().clone(), codes, record).unwrap()
}

#[test]
fn sparse_parts_draw_the_picture_of_the_whole() {
    let Some(gpu) = gpu() else { return };
    let all = sparse(6, 3000);
    for escapes in [true, false] {
        let whole = |runs: &[Range<usize>]| {
            let model = joined(&all, runs, escapes);
            GpuScene::new(&gpu, &Scene::from(&model), ShPath::SparseOrdered).unwrap()
        };
        // As from a worker: through bytes at an odd address.
        let run = |range| {
            let part = ScenePart::new(&Scene::from(&sparse_run(&all, range, escapes))).unwrap();
            let bytes: Vec<u8> = std::iter::once(0).chain(part.to_bytes()).collect();
            ScenePart::from_bytes(&bytes.leak()[1..]).unwrap()
        };
        let form = SceneForm::of(&Scene::from(&all));
        check(&gpu, &SceneForm::from_bytes(&form.to_bytes()).unwrap(), run, whole);
    }
}

#[test]
fn sensitivities_of_parts_are_those_of_the_whole() {
    let Some(gpu) = gpu() else { return };
    let all = made::scene(7, 900, ShDegree::ONE, false);
    let cameras = [made::camera(1, 60, 50)];
    let mut renderer = GpuRenderer::new(&gpu).unwrap();
    let mut measure =
        |scene: &GpuScene| renderer.sensitivity(scene, &all.geometry, &cameras, &Silent).unwrap();
    let whole = measure(&GpuScene::new(&gpu, &Scene::from(&all), ShPath::DenseF32).unwrap());
    let mut scene = GpuScene::of_parts(&gpu, &SceneForm::of(&Scene::from(&all))).unwrap();
    for (range, index) in [0..100, 100..611, 611..900].into_iter().zip(0..) {
        scene.put(index, &ScenePart::new(&Scene::from(&dense_run(&all, range))).unwrap()).unwrap();
    }
    assert!(measure(&scene) == whole);
}

#[test]
fn parts_share_the_dictionary() {
    let Some(gpu) = gpu() else { return };
    let all = sparse(6, 1024);
    let form = SceneForm::of(&Scene::from(&all));
    let whole = GpuScene::new(&gpu, &Scene::from(&all), ShPath::SparseOrdered).unwrap();
    let mut scene = GpuScene::of_parts(&gpu, &form).unwrap();
    assert_eq!((scene.bytes().geometry, scene.bytes().sh), (0, ATOM_BYTES));
    for k in 0..4 {
        let model = sparse_run(&all, 256 * k..256 * (k + 1), true);
        scene.put(k, &ScenePart::new(&Scene::from(&model)).unwrap()).unwrap();
    }
    assert_eq!(scene.bytes(), whole.bytes());
    scene.clear();
    assert_eq!((scene.bytes().geometry, scene.bytes().sh), (0, ATOM_BYTES));
}

#[test]
fn parts_of_another_form_are_refused() {
    let Some(gpu) = gpu() else { return };
    let all = sparse(6, 300);
    let mut scene = GpuScene::of_parts(&gpu, &SceneForm::of(&Scene::from(&all))).unwrap();
    scene.put(3, &ScenePart::new(&Scene::from(&all)).unwrap()).unwrap();
    let splats = made::scene(6, 30, ShDegree::THREE, true);
    let other = made::model_of(splats.clone(), 91, true);
    let wide = made::model_of(splats.clone(), 90, false);
    for other in [Scene::from(&splats), Scene::from(&other), Scene::from(&wide)] {
        let refused = scene.put(3, &ScenePart::new(&other).unwrap());
        assert!(matches!(refused, Err(Error::Parameter { name: "part", .. })));
    }
    assert_eq!((scene.len(), scene.parts()), (300, 1));
}

#[test]
fn parts_and_forms_survive_as_bytes() {
    let (model, splats) = (sparse(6, 300), made::scene(6, 300, ShDegree::new(2).unwrap(), false));
    let wide = made::model_of(made::scene(6, 300, ShDegree::THREE, false), 300, false);
    let none = made::model_of(made::scene(6, 20, ShDegree::ZERO, false), 0, true);
    for scene in [Scene::from(&model), Scene::from(&wide), Scene::from(&none), Scene::from(&splats)] {
        let part = ScenePart::new(&scene).unwrap();
        let bytes = part.to_bytes();
        let again = ScenePart::from_bytes(&bytes).unwrap();
        assert_eq!((again.len() as usize, again.bounds()), (scene.len(), part.bounds()));
        assert!(again.as_bytes() == bytes && bytes.len().is_multiple_of(16));
        let form = SceneForm::of(&scene);
        assert!(SceneForm::from_bytes(&form.to_bytes()).unwrap() == form);
        for end in 0..bytes.len() {
            assert!(ScenePart::from_bytes(&bytes[..end]).is_err(), "{end} of {} bytes", bytes.len());
        }
        let form = form.to_bytes();
        for end in 0..form.len() {
            assert!(SceneForm::from_bytes(&form[..end]).is_err(), "{end} of {} bytes", form.len());
        }
    }
}

/// Whether every code of a part that was accepted stays within its arrays, worked out from the bytes alone, slowly.
fn is_sound(bytes: &[u8]) -> bool {
    let word = |at: usize| u32::from_le_bytes(bytes[4 * at..4 * at + 4].try_into().unwrap()) as usize;
    let [n, index, value, atoms, escapes, words] = [4, 5, 6, 7, 8, 9].map(word);
    let aligned = |bytes: usize| bytes.div_ceil(16) * 4;
    let columns = 16 + 12 * n + aligned(12 * n);
    let escaped = columns + aligned(20 * n.div_ceil(16));
    let nonzeros = escaped + aligned(4 * escapes);
    let mut found = 0;
    for i in 0..n {
        let group = columns + 5 * (i / 16);
        let counts = &bytes[4 * group + 4..4 * group + 20];
        let count = |byte: u8| if byte == 0x80 { 0 } else { usize::from(byte) };
        let total: usize = counts.iter().map(|&byte| count(byte)).sum();
        let before: usize = counts[..i % 16].iter().map(|&byte| count(byte)).sum();
        if counts[i % 16] == 0x80 {
            if found == escapes || word(escaped + found) != i {
                return false;
            }
            found += 1;
            continue;
        }
        let values_at = word(group) + (total * index).div_ceil(4);
        for k in before..before + usize::from(counts[i % 16]) {
            let at = 4 * (nonzeros + word(group)) + k * index;
            let atom = if index == 1 {
                bytes[at].into()
            } else {
                usize::from(bytes[at]) + 256 * usize::from(bytes[at + 1])
            };
            if atom >= atoms || values_at + (k * value) / 4 >= words {
                return false;
            }
        }
    }
    found == escapes
}

#[test]
fn changed_bytes_are_refused_or_harmless() {
    let mut random = made::Random::new(3);
    let model = sparse(6, 100);
    let wide = made::model_of(made::scene(6, 100, ShDegree::THREE, false), 300, true);
    for scene in [Scene::from(&model), Scene::from(&wide)] {
        let bytes = ScenePart::new(&scene).unwrap().to_bytes();
        assert!(is_sound(&bytes));
        let codes = 64 + 60 * scene.len();
        let (mut refused, mut accepted) = (0, 0);
        for round in 0..20_000 {
            let mut changed = bytes.clone();
            // Half of the changes are to the header and to columns, escapes and nonzeros.
            let within = match round % 4 {
                0 => 0..64,
                1 => codes..bytes.len(),
                _ => 0..bytes.len(),
            };
            for _ in 0..=round % 3 {
                changed[within.start + random.below(within.len())] = random.byte();
            }
            match ScenePart::from_bytes(&changed) {
                Err(Error::Codec(_)) => refused += 1,
                Err(error) => panic!("{error}"),
                Ok(_) => {
                    accepted += 1;
                    assert!(is_sound(&changed), "round {round}");
                }
            }
        }
        assert!(refused > 3000 && accepted > 3000, "{refused} refused, {accepted} accepted");
        let form = SceneForm::of(&scene).to_bytes();
        for round in 0..2000 {
            let mut changed = form.clone();
            let end = if round % 2 == 0 { 32 } else { form.len() };
            changed[random.below(end)] ^= 1 << random.below(8);
            if let Ok(read) = SceneForm::from_bytes(&changed) {
                assert!(read.to_bytes() == changed);
            }
        }
    }
}
