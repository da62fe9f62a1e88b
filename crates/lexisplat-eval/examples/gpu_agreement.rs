//! How far GPU pictures are from the CPU renderer's, and sparse ones from dense ones of the same model.
//!
//! `cargo run --release -p lexisplat-eval --example gpu_agreement -- SCENE [CAMERAS] ...`: for every PLY or
//! .lexi, with the cameras.json after it if one is, up to 13 views at most 400 pixels wide: those marked
//! `test`, else 8 spread evenly, else an orbit of 8. Prints one JSON object a line. Takes the best adapter,
//! software included.

use std::error::Error;

use lexisplat::ply::ReadOptions;
use lexisplat_compress::ORBIT_SIZE;
use lexisplat_eval::SceneFile;
use lexisplat_eval::metrics::psnr;
use lexisplat_render::gpu::{GpuRenderer, GpuScene, ShPath};
use lexisplat_render::{Camera, Device, Image, RenderOptions, Scene, Split, orbit, read_cameras, render};
use serde_json::json;

/// Views at most, and of files without marks.
const MOST: usize = 13;
const SPREAD: usize = 8;
/// Widest picture in pixels.
const WIDTH: u32 = 400;
/// Largest allowed difference of a pixel, in units of a channel.
const LEVELS: f32 = 2.0 / 255.0;

fn cameras(file: Option<&str>, scene: &Scene<'_>) -> Result<Vec<Camera>, Box<dyn Error>> {
    let all = match file {
        Some(file) => read_cameras(file)?,
        None => orbit(scene.geometry(), SPREAD, ORBIT_SIZE.0, ORBIT_SIZE.1),
    };
    let marked: Vec<&Camera> = all.iter().filter(|c| c.split == Some(Split::Test)).collect();
    let chosen: Vec<&Camera> = if marked.is_empty() {
        all.iter().step_by(all.len().div_ceil(SPREAD).max(1)).collect()
    } else {
        marked
    };
    Ok(chosen.into_iter().take(MOST).map(|c| c.with_max_width(WIDTH)).collect())
}

/// The worst of some pictures.
#[derive(Debug)]
struct Worst {
    psnr: f64,
    difference: f32,
    /// Smallest share of a picture's pixels within [`LEVELS`].
    within: f64,
}

impl Worst {
    const NONE: Self = Self { psnr: f64::INFINITY, difference: 0.0, within: 1.0 };

    fn add(&mut self, a: &Image, b: &Image) -> Result<(), Box<dyn Error>> {
        self.psnr = self.psnr.min(psnr(a, b)?.unwrap_or(f64::INFINITY));
        let mut over = 0;
        for (p, q) in a.pixels.iter().zip(&b.pixels) {
            let off = p
                .iter()
                .zip(q)
                .map(|(p, q)| (p.clamp(0.0, 1.0) - q.clamp(0.0, 1.0)).abs())
                .fold(0.0, f32::max);
            self.difference = self.difference.max(off);
            over += usize::from(off > LEVELS);
        }
        self.within = self.within.min(1.0 - over as f64 / a.pixels.len().max(1) as f64);
        Ok(())
    }

    fn json(&self) -> serde_json::Value {
        let decibels = self.psnr.is_finite().then_some(self.psnr);
        json!({ "min_psnr": decibels, "largest": self.difference * 255.0, "within_2": self.within })
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let gpu = Device::Gpu.open_gpu()?.ok_or("there is no GPU")?;
    let mut renderer = GpuRenderer::new(&gpu)?;
    let options = RenderOptions::default();
    let mut rest = arguments.iter().peekable();
    while let Some(file) = rest.next() {
        let input = SceneFile::read(file.as_ref(), &ReadOptions::default())?;
        let scene = input.scene();
        let views = cameras(rest.next_if(|next| next.ends_with(".json")).map(String::as_str), &scene)?;
        let processor: Result<Vec<Image>, _> =
            views.iter().map(|camera| render(&scene, camera, &options)).collect();
        let processor = processor?;
        let mut dense: Vec<Image> = Vec::new();
        let mut paths = serde_json::Map::new();
        for path in ShPath::ALL {
            if path.is_sparse() && matches!(scene, Scene::Dense(_)) {
                continue;
            }
            let uploaded = match GpuScene::new(&gpu, &scene, path) {
                Ok(uploaded) => uploaded,
                Err(lexisplat_render::Error::Parameter { .. }) => continue,
                Err(error) => return Err(error.into()),
            };
            let (mut to_cpu, mut to_dense) = (Worst::NONE, Worst::NONE);
            for (k, camera) in views.iter().enumerate() {
                let (picture, _) = renderer.render(&uploaded, camera, &options)?;
                to_cpu.add(&processor[k], &picture)?;
                match dense.get(k) {
                    Some(dense) => to_dense.add(dense, &picture)?,
                    None => dense.push(picture),
                }
            }
            let each = uploaded.bytes().sh as f64 / f64::from(uploaded.len().max(1));
            paths.insert(
                path.name().to_owned(),
                json!({
                    "against_cpu": to_cpu.json(),
                    "against_dense_f32": to_dense.json(),
                    "sh_bytes_per_gaussian": each,
                }),
            );
        }
        let line = json!({
            "file": file, "gaussians": scene.len(), "views": views.len(),
            "device": gpu.summary().name, "driver": gpu.summary().driver, "paths": paths,
        });
        println!("{line}");
    }
    Ok(())
}
