//! Many copies of a compressed scene side by side, drawn on a GPU as one: what it takes of its memory.
//!
//! `cargo run --release -p lexisplat-eval --example gpu_large -- SCENE.lexi COPIES [PATH] [FRAMES]`: PATH is
//! `sparse-ordered` unless given, FRAMES 3. Copies lie on a square grid in x and z, as far apart as nine
//! tenths of the scene are wide, and are seen from two views of an orbit. Prints one JSON object. Takes the
//! best adapter, software included.

use std::error::Error;
use std::time::Instant;

use lexisplat::{Escapes, Geometry, Indices, Limits, Model, SparseCodes, Values, lexi};
use lexisplat_eval::Spread;
use lexisplat_render::gpu::{GpuRenderer, GpuScene, ShPath};
use lexisplat_render::{Device, RenderOptions, Scene, orbit};
use serde_json::json;

/// Views, and their size in pixels.
const VIEWS: usize = 2;
const SIZE: (u32, u32) = (1600, 1064);

fn repeated<T: Clone>(list: &[T], times: usize) -> Vec<T> {
    list.iter().cloned().cycle().take(list.len() * times).collect()
}

/// Width of nine tenths of the positions along `axis`.
fn width(geometry: &Geometry, axis: usize) -> f32 {
    let mut coordinates: Vec<f32> = geometry.positions.iter().map(|p| p[axis]).collect();
    coordinates.sort_by(f32::total_cmp);
    let at =
        |twentieths: usize| coordinates.get(twentieths * coordinates.len().saturating_sub(1) / 20).copied();
    at(19).zip(at(1)).map_or(0.0, |(high, low)| high - low)
}

fn tiled(model: &Model, copies: usize) -> Result<Model, lexisplat::Error> {
    let (n, g, codes) = (model.len(), model.geometry(), model.codes());
    let side = copies.isqrt().max(1);
    let step = [width(g, 0), width(g, 2)];
    let mut geometry = Geometry {
        positions: Vec::with_capacity(n * copies),
        dc: repeated(&g.dc, copies),
        opacities: repeated(&g.opacities, copies),
        scales: repeated(&g.scales, copies),
        rotations: repeated(&g.rotations, copies),
        ..Geometry::default()
    };
    let mut escapes = Escapes { rows: repeated(&codes.escapes().rows, copies), ..Escapes::default() };
    for copy in 0..copies {
        #[expect(clippy::cast_precision_loss, reason = "a few thousand copies")]
        let [x, z] = [(copy % side) as f32 * step[0], (copy / side) as f32 * step[1]];
        geometry.positions.extend(g.positions.iter().map(|p| [p[0] + x, p[1], p[2] + z]));
        let first = u32::try_from(copy * n).unwrap_or(u32::MAX);
        escapes.gaussians.extend(codes.escapes().gaussians.iter().map(|e| first + e));
    }
    let indices = match codes.indices().clone() {
        Indices::U8(v) => Indices::U8(repeated(&v, copies)),
        Indices::U16(v) => Indices::U16(repeated(&v, copies)),
    };
    let values = match codes.values().clone() {
        Values::F16(v) => Values::F16(repeated(&v, copies)),
        Values::F32(v) => Values::F32(repeated(&v, copies)),
    };
    let counts = repeated(codes.counts(), copies);
    let codes = SparseCodes::new(model.dictionary(), counts, indices, values, escapes)?;
    Model::new(geometry, model.meta().clone(), model.dictionary().clone(), codes, model.record().clone())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, copies, rest @ ..] = arguments.as_slice() else {
        return Err("give SCENE.lexi COPIES [PATH] [FRAMES]".into());
    };
    let path: ShPath = rest.first().map_or(Ok(ShPath::SparseOrdered), |name| name.parse())?;
    let frames: usize = rest.get(1).map_or(Ok(3), |n| n.parse())?;
    let model = tiled(&lexi::read(file, &Limits::default())?, copies.parse()?)?;
    let scene = Scene::from(&model);
    let cameras = orbit(model.geometry(), VIEWS, SIZE.0, SIZE.1);
    let gpu = Device::Gpu.open_gpu()?.ok_or("there is no GPU")?;
    let mut renderer = GpuRenderer::new(&gpu)?;
    let clock = Instant::now();
    let uploaded = GpuScene::new(&gpu, &scene, path)?;
    let upload_seconds = clock.elapsed().as_secs_f64();
    let (mut totals, mut radiance, mut visible, mut entries, mut bands) = (Vec::new(), Vec::new(), 0, 0, 0);
    for camera in &cameras {
        for _ in 0..frames.max(1) {
            let clock = Instant::now();
            let stats = renderer.draw(&uploaded, camera, &RenderOptions::default())?.stats;
            totals.push(stats.total.unwrap_or(clock.elapsed().as_secs_f64() * 1e3));
            radiance.extend(stats.stages.iter().filter(|(s, _)| s.name() == "radiance").map(|(_, ms)| *ms));
            visible = visible.max(stats.visible);
            entries = entries.max(stats.entries);
            bands = bands.max(stats.bands);
        }
    }
    let bytes = uploaded.bytes();
    println!(
        "{}",
        json!({
            "file": file, "gaussians": model.len(), "path": path.name(),
            "device": gpu.summary().name, "driver": gpu.summary().driver,
            "upload_seconds": upload_seconds,
            "geometry_bytes": bytes.geometry, "sh_bytes": bytes.sh,
            "most_gpu_bytes": gpu.most_bytes(),
            "visible": visible, "entries": entries, "bands": bands,
            "frame_ms": Spread::of(totals), "radiance_ms": Spread::of(radiance),
        })
    );
    Ok(())
}
