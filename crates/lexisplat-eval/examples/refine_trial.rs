//! A trial of refining: `refine_trial ORIGINAL.ply START.ply CAMERAS.json OUT.ply STEPS RATE`.

use std::error::Error;
use std::time::Instant;

use lexisplat::Splats;
use lexisplat::ply::ReadOptions;
use lexisplat::sh::rest_basis;
use lexisplat_compress::{SplitFilter, choose_views};
use lexisplat_render::{Camera, Differentiator, Image, RenderOptions, Scene, render};

#[derive(Clone, Copy, Default)]
struct Moments {
    first: f32,
    second: f32,
}

struct Adam {
    moments: Vec<Moments>,
    width: usize,
    steps: Vec<u16>,
}

const B1: f32 = 0.9;
const B2: f32 = 0.99;

impl Adam {
    fn step(&mut self, i: usize, k: usize, t: f32, g: f32, rate: f32) -> f32 {
        let m = &mut self.moments[i * self.width + k];
        m.first = B1 * m.first + (1.0 - B1) * g;
        m.second = B2 * m.second + (1.0 - B2) * g * g;
        let (a, b) = (1.0 - B1.powf(t), 1.0 - B2.powf(t));
        -rate * (m.first / a) / ((m.second / b).sqrt() + 1e-15)
    }
}

fn psnr(splats: &Splats, cameras: &[Camera], targets: &[Image]) -> f64 {
    let mut sum = 0.0;
    for (camera, target) in cameras.iter().zip(targets) {
        let picture = render(&Scene::from(splats), camera, &RenderOptions::default()).unwrap();
        let e: f64 = picture
            .pixels
            .as_flattened()
            .iter()
            .zip(target.pixels.as_flattened())
            .map(|(a, b)| f64::from(a.clamp(0.0, 1.0) - b.clamp(0.0, 1.0)).powi(2))
            .sum::<f64>()
            / (3.0 * f64::from(target.width * target.height));
        sum += -10.0 * e.log10();
    }
    sum / cameras.len() as f64
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().collect();
    let [_, original, start, cameras, out, steps, rate] = args.as_slice() else {
        return Err("arguments".into());
    };
    let read = |path: &str| lexisplat::ply::read(path, &ReadOptions::default()).map(|read| read.splats);
    let original = read(original)?;
    let mut splats = read(start)?;
    let steps: usize = steps.parse()?;
    let rate: f32 = rate.parse()?;
    let choose = |split| choose_views(Some(cameras.as_ref()), split, 0, 1600, &original.geometry);
    let (train, test) = (choose(SplitFilter::Train)?, choose(SplitFilter::Test)?);
    let draw = |cameras: &[Camera]| -> Vec<Image> {
        cameras
            .iter()
            .map(|c| render(&Scene::from(&original), c, &RenderOptions::default()).unwrap())
            .collect()
    };
    let (train_targets, test_targets) = (draw(&train), draw(&test));
    println!(
        "{} of {} Gaussians; {} views; start {:.2} train, {:.2} test",
        splats.len(),
        original.len(),
        train.len(),
        psnr(&splats, &train, &train_targets),
        psnr(&splats, &test, &test_targets)
    );
    // Extent: median distance of cameras from their middle.
    let middle: [f32; 3] =
        std::array::from_fn(|k| train.iter().map(|c| c.position[k]).sum::<f32>() / train.len() as f32);
    let extent = 1.1
        * train
            .iter()
            .map(|c| (0..3).map(|k| (c.position[k] - middle[k]).powi(2)).sum::<f32>().sqrt())
            .fold(0.0, f32::max);
    let width = 14 + splats.degree.rest();
    let mut adam =
        Adam { moments: vec![Moments::default(); splats.len() * width], width, steps: vec![0; splats.len()] };
    let mut d = Differentiator::default();
    let clock = Instant::now();
    let mut order: Vec<usize> = Vec::new();
    let mut seed = 1_u64;
    let per = splats.degree.rest_per_channel();
    for step in 0..steps {
        if order.is_empty() {
            order = (0..train.len()).collect();
            for k in (1..order.len()).rev() {
                seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                order.swap(k, (seed >> 33) as usize % (k + 1));
            }
        }
        let view = order.pop().unwrap();
        let g = d.gradient(&splats, &train[view], &train_targets[view])?;
        let decay = rate * (0.1_f32).powf(step as f32 / steps as f32);
        for (&i, row) in g.gaussians.iter().zip(&g.rows) {
            let i = i as usize;
            adam.steps[i] += 1;
            let t = f32::from(adam.steps[i]);
            let geo = &mut splats.geometry;
            for k in 0..3 {
                geo.positions[i][k] += adam.step(i, k, t, row.position[k], decay * 2e-5 * extent);
                geo.scales[i][k] += adam.step(i, 3 + k, t, row.scales[k], decay * 5e-3);
                geo.dc[i][k] += adam.step(i, 11 + k, t, row.dc[k], decay * 2.5e-3);
            }
            for k in 0..4 {
                geo.rotations[i][k] += adam.step(i, 6 + k, t, row.rotation[k], decay * 1e-3);
            }
            geo.opacities[i] += adam.step(i, 10, t, row.opacity, decay * 1e-2);
            let basis = rest_basis(splats.degree, row.direction);
            for c in 0..3 {
                for k in 0..per {
                    let n = c * per + k;
                    splats.sh_rest[i * 3 * per + n] +=
                        adam.step(i, 14 + n, t, row.colour[c] * basis[k], decay * 2.5e-4);
                }
            }
        }
        if (step + 1) % 250 == 0 || step + 1 == steps {
            println!(
                "{} {:.0} s: {:.2} train, {:.2} test",
                step + 1,
                clock.elapsed().as_secs_f64(),
                psnr(&splats, &train[..8], &train_targets[..8]),
                psnr(&splats, &test, &test_targets)
            );
        }
    }
    lexisplat::ply::write(out, &splats)?;
    Ok(())
}
