//! Measures how fast the processor draws: `drawing_speed SCENE CAMERAS [VIEWS] [ROUNDS]`. The cameras `around` are
//! some like those that packing generates. `RAYON_NUM_THREADS=1` restricts it to one core, `LEXISPLAT_SIMD`
//! chooses the vector instructions.
//!
//! Prints the best time of a picture and of its stages, and that of a pass of sensitivity, each as the mean over the
//! views. The checksums are those of the pictures and of the sensitivities.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use lexisplat::ply::ReadOptions;
use lexisplat::simd::Simd;
use lexisplat::{Sensitivity, Silent};
use lexisplat_eval::SceneFile;
use lexisplat_render::{RenderOptions, read_views, render_measured, sensitivity, surround};

/// Size and distances of the views that packing generates to measure.
const AROUND_SIZE: [u32; 2] = [384, 256];
const AROUND_DISTANCES: [f64; 2] = [2.0, 12.0];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, cameras, rest @ ..] = arguments.as_slice() else { return Err("a scene and cameras".into()) };
    let number = |k: usize, otherwise| rest.get(k).and_then(|a| a.parse().ok()).unwrap_or(otherwise);
    let (views, rounds): (usize, usize) = (number(0, 8), number(1, 10));
    let simd = std::env::var("LEXISPLAT_SIMD").ok().and_then(|name| Simd::named(&name));
    simd.unwrap_or_else(Simd::widest).scope(|| measure(file, cameras, views, rounds))
}

fn measure(file: &str, cameras: &str, views: usize, rounds: usize) -> Result<(), Box<dyn std::error::Error>> {
    let scene_file = SceneFile::read(Path::new(file), &ReadOptions::default())?;
    let scene = scene_file.scene();
    let all = match cameras {
        "around" => surround(scene.geometry(), views, AROUND_SIZE, AROUND_DISTANCES),
        _ => read_views(Path::new(cameras), &mut |_| None)?.cameras,
    };
    let every = all.len().div_ceil(views).max(1);
    let cameras: Vec<_> = all.into_iter().step_by(every).collect();
    let options = RenderOptions::default();
    let (mut picture, mut pass) = (f64::INFINITY, f64::INFINITY);
    let mut stages: BTreeMap<&str, f64> = BTreeMap::new();
    let mut checksum = crc32fast::Hasher::new();
    let mut measured = Sensitivity::zeros(0);
    for round in 0..rounds {
        let clock = Instant::now();
        let mut times: BTreeMap<&str, f64> = BTreeMap::new();
        for camera in &cameras {
            let drawn = render_measured(&scene, camera, &options)?;
            drawn.stage_times.iter().for_each(|(stage, ms)| *times.entry(stage).or_default() += ms);
            if round == 0 {
                for value in drawn.image.pixels.as_flattened() {
                    checksum.update(&value.to_bits().to_le_bytes());
                }
            }
        }
        picture = picture.min(clock.elapsed().as_secs_f64());
        for (stage, time) in times {
            let best = stages.entry(stage).or_insert(f64::INFINITY);
            *best = best.min(time);
        }
        let clock = Instant::now();
        measured = sensitivity(&scene, &cameras, &Silent)?;
        pass = pass.min(clock.elapsed().as_secs_f64());
    }
    let mut sums = crc32fast::Hasher::new();
    let Sensitivity { position, scale, rotation, opacity, colour, removal, .. } = &measured;
    let arrays =
        [position.as_flattened(), scale.as_flattened(), rotation.as_flattened(), opacity, colour, removal];
    arrays.concat().iter().for_each(|value| sums.update(&value.to_bits().to_le_bytes()));
    let count = cameras.len() as f64;
    println!(
        "{} views, {}: {:.2} ms a picture, {:.2} ms a pass; {:08x} {:08x}",
        cameras.len(),
        Simd::current().name(),
        picture * 1e3 / count,
        pass * 1e3 / count,
        checksum.finalize(),
        sums.finalize()
    );
    for (stage, time) in stages {
        println!("  {stage}: {:.2} ms", time / count);
    }
    Ok(())
}
