//! Scenes on the processor that are made of parts.

use std::ops::Range;

use crate::gpu_parts::{dense_run, sparse, sparse_run};
use crate::made;
use lexisplat::ShDegree;
use lexisplat_render::gpu::{SceneForm, ScenePart};
use lexisplat_render::{Camera, CpuScene, Drawn, Error, RenderOptions, Scene, render};

/// Where the parts of 3000 Gaussians begin and end. One is empty, and one has all places of a vector register but one.
const RUNS: [Range<usize>; 5] = [0..1100, 1100..1100, 1100..1115, 1115..2777, 2777..3000];

/// Views from outside and from inside, one of them large enough to be drawn in several steps.
fn cameras() -> Vec<Camera> {
    let mut cameras: Vec<Camera> = (0..3).map(|seed| made::camera(seed, 70, 50)).collect();
    cameras[2].position = [0.2, 0.1, 0.0];
    cameras.push(cameras[2].resized(1400, 1000));
    cameras
}

fn options() -> RenderOptions {
    RenderOptions::default().with_background([0.1, 0.4, 0.9])
}

/// The picture, and the number of steps in which it was drawn.
fn drawn(scene: &mut CpuScene, camera: &Camera) -> (Drawn, usize) {
    scene.begin(camera, &options()).unwrap();
    let mut steps = 0;
    loop {
        assert!(scene.is_drawing());
        steps += 1;
        if let Some(drawn) = scene.advance() {
            assert!(!scene.is_drawing() && scene.advance().is_none());
            return (drawn, steps);
        }
    }
}

/// Checks that a scene of parts of `run`, which pass through bytes, has the pictures of `whole`.
fn check(form: &SceneForm, run: impl Fn(Range<usize>) -> Vec<u8>, whole: &Scene<'_>) {
    let mut scene = CpuScene::new(SceneForm::from_bytes(&form.to_bytes()).unwrap());
    let empty = drawn(&mut scene, &cameras()[0]).0;
    assert!(empty.image.pixels.iter().all(|&pixel| pixel == options().background));
    let put = |scene: &mut CpuScene, index: usize, range: Range<usize>| {
        scene.put(index, &ScenePart::from_bytes(&run(range)).unwrap()).unwrap();
    };
    for step in [3, 0, 4, 2, 1] {
        put(&mut scene, 10 * step, RUNS[step].clone());
    }
    // A part is replaced by another one, and back; one is there for a while.
    put(&mut scene, 30, 5..900);
    put(&mut scene, 17, 40..90);
    assert!(drawn(&mut scene, &cameras()[0]).0.image != render(whole, &cameras()[0], &options()).unwrap());
    put(&mut scene, 30, RUNS[3].clone());
    scene.remove(17);
    scene.remove(18);
    assert_eq!((scene.len(), scene.is_empty()), (3000, false));
    assert!(scene.bytes().geometry > 0 && scene.bytes().sh > 0);
    let mut most = 0;
    for camera in &cameras() {
        // A picture that was begun does not disturb the next.
        scene.begin(&cameras()[1], &options()).unwrap();
        scene.advance();
        let (drawn, steps) = drawn(&mut scene, camera);
        most = most.max(steps);
        assert!(drawn.image == render(whole, camera, &options()).unwrap(), "{camera:?}");
    }
    assert!(most > 2, "large pictures are drawn in steps");
    // Nor does a part that comes while a picture is drawn.
    scene.begin(&cameras()[0], &options()).unwrap();
    scene.remove(0);
    assert!(!scene.is_drawing() && scene.advance().is_none());
}

#[test]
fn dense_parts_have_the_picture_of_the_whole() {
    let all = made::scene(5, 3000, ShDegree::new(2).unwrap(), true);
    let run = |range| ScenePart::new(&Scene::from(&dense_run(&all, range))).unwrap().to_bytes();
    check(&SceneForm::of(&Scene::from(&all)), run, &Scene::from(&all));
}

#[test]
fn sparse_parts_have_the_picture_of_the_whole() {
    let all = sparse(6, 3000);
    for escapes in [true, false] {
        let model = sparse_run(&all, 0..3000, escapes);
        let run = |range| ScenePart::new(&Scene::from(&sparse_run(&all, range, escapes))).unwrap().to_bytes();
        check(&SceneForm::of(&Scene::from(&all)), run, &Scene::from(&model));
    }
}

#[test]
fn wide_codes_have_the_picture_of_the_whole() {
    let all = made::model_of(made::scene(6, 3000, ShDegree::THREE, false), 300, false);
    let mut scene = CpuScene::new(SceneForm::of(&Scene::from(&all)));
    scene.put(0, &ScenePart::new(&Scene::from(&all)).unwrap()).unwrap();
    let camera = &cameras()[0];
    assert!(drawn(&mut scene, camera).0.image == render(&Scene::from(&all), camera, &options()).unwrap());
}

#[test]
fn parts_of_another_form_are_refused_on_the_processor() {
    let all = sparse(6, 300);
    let mut scene = CpuScene::new(SceneForm::of(&Scene::from(&all)));
    scene.put(3, &ScenePart::new(&Scene::from(&all)).unwrap()).unwrap();
    let splats = made::scene(6, 30, ShDegree::THREE, true);
    let other = made::model_of(splats.clone(), 91, true);
    for other in [Scene::from(&splats), Scene::from(&other)] {
        let refused = scene.put(3, &ScenePart::new(&other).unwrap());
        assert!(matches!(refused, Err(Error::Parameter { name: "part", .. })));
    }
    assert_eq!(scene.len(), 300);
    let camera = Camera { width: 0, ..cameras()[0].clone() };
    assert!(matches!(scene.begin(&camera, &options()), Err(Error::Parameter { name: "width", .. })));
}

/// Whatever bytes a part is read from, it is drawn or refused.
#[test]
fn changed_parts_are_drawn_or_refused() {
    let mut random = made::Random::new(3);
    let all = sparse(6, 100);
    let bytes = ScenePart::new(&Scene::from(&all)).unwrap().to_bytes();
    let (mut accepted, mut refused) = (0, 0);
    for _ in 0..2000 {
        let mut changed = bytes.clone();
        for _ in 0..3 {
            changed[random.below(bytes.len())] = random.byte();
        }
        let Ok(part) = ScenePart::from_bytes(&changed) else { continue };
        let mut scene = CpuScene::new(SceneForm::of(&Scene::from(&all)));
        match scene.put(0, &part) {
            Ok(()) => {
                accepted += 1;
                drawn(&mut scene, &cameras()[0]);
            }
            Err(_) => refused += 1,
        }
    }
    assert!(accepted > 300 && refused > 10, "{accepted} accepted, {refused} refused");
}
