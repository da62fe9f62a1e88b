//! How far compressed scenes are from their original, over views that were not there when they were made.
//!
//! `promise ORIGINAL.ply CAMERAS.json|orbit WIDTH[,WIDTH ...] FILE.lexi ...` prints one JSON object a file. Views are those
//! marked `test`, else every 8th by name; `orbit` is 12 views from around the scene. They are at most WIDTH pixels wide. The
//! first width counts for all; at others there are views on the path alone. They are over black, and at the first width also over
//! white. Each kind of views off the path is made of these: at half and at a quarter of the distance, four times as far, from above,
//! and turned back.
//! Views that the original covers by less than 5 % do not count. A view's PSNR is at most 60 dB. Tiles are whole
//! squares of 32 pixels.

use std::error::Error;
use std::path::Path;

use lexisplat::Geometry;
use lexisplat::ply::ReadOptions;
use lexisplat_compress::{SplitFilter, choose_views};
use lexisplat_eval::SceneFile;
use lexisplat_render::{Camera, Image, RenderOptions, Renderer, orbit};
use serde_json::{Map, Value, json};

const ORBIT_VIEWS: usize = 12;
const TILE: usize = 32;
/// Largest PSNR of a view, in dB.
const MOST: f64 = 60.0;
const LEAST_COVERED: f64 = 0.05;
/// Half the width of the middle of a picture, as a tangent, in which depth is looked for.
const MIDDLE: f32 = 0.15;
/// Turn of views from above, in radians.
const ABOVE: f64 = std::f64::consts::FRAC_PI_3;

type Vector = [f64; 3];

/// How a view off the path is made of one on it.
#[derive(Debug, Clone, Copy)]
enum Kind {
    Path,
    /// On the path, over white.
    White,
    /// At this share of the distance.
    Distance(f64),
    Above,
    Back,
}

const KINDS: [(&str, Kind); 7] = [
    ("path", Kind::Path),
    ("white", Kind::White),
    ("half", Kind::Distance(0.5)),
    ("quarter", Kind::Distance(0.25)),
    ("far", Kind::Distance(4.0)),
    ("above", Kind::Above),
    ("back", Kind::Back),
];

/// The distance of what the camera looks at: that of the nearer half of the opacity in the middle of the picture,
/// weighted by area on screen.
fn distance(camera: &Camera, geometry: &Geometry) -> f64 {
    let mut found: Vec<(f32, f32)> = Vec::new();
    for i in 0..geometry.len() {
        let [x, y, z] = camera.to_view(geometry.positions[i]);
        if z > 0.2 && x.abs() < MIDDLE * z && y.abs() < MIDDLE * z {
            let mut scales = geometry.scales[i];
            scales.sort_by(f32::total_cmp);
            let size = (scales[1] + scales[2]).exp() / (z * z);
            found.push((z, size.min(0.1) / (1.0 + (-geometry.opacities[i]).exp())));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f32 = found.iter().map(|f| f.1).sum();
    let mut sum = 0.0;
    for (z, weight) in found {
        sum += weight;
        if sum >= 0.5 * total {
            return f64::from(z);
        }
    }
    1.0
}

#[expect(clippy::cast_possible_truncation, reason = "cameras are f32")]
fn rounded(v: f64) -> f32 {
    v as f32
}

fn moved(camera: &Camera, kind: Kind, distance: f64) -> Camera {
    let column = |k: usize| -> Vector { std::array::from_fn(|row| f64::from(camera.rotation[row][k])) };
    let [right, down, forward] = [0, 1, 2].map(column);
    let eye = camera.position.map(f64::from);
    let (eye, axes) = match kind {
        Kind::Path | Kind::White => (eye, [right, down, forward]),
        Kind::Distance(share) => {
            let eye = std::array::from_fn(|k| eye[k] + forward[k] * distance * (1.0 - share));
            (eye, [right, down, forward])
        }
        Kind::Above => {
            let (s, c) = ABOVE.sin_cos();
            let new: Vector = std::array::from_fn(|k| c * forward[k] + s * down[k]);
            let new_down: Vector = std::array::from_fn(|k| c * down[k] - s * forward[k]);
            let eye = std::array::from_fn(|k| eye[k] + distance * (forward[k] - new[k]));
            (eye, [right, new_down, new])
        }
        Kind::Back => (eye, [right.map(|v| -v), down, forward.map(|v| -v)]),
    };
    let rotation = std::array::from_fn(|row| axes.map(|axis| rounded(axis[row])));
    let background = matches!(kind, Kind::White).then_some([1.0; 3]);
    Camera { position: eye.map(rounded), rotation, background, ..camera.clone() }
}

fn covered(image: &Image) -> f64 {
    let lit = image.pixels.iter().filter(|p| p.iter().any(|v| *v > 0.0)).count();
    lit as f64 / image.pixels.len().max(1) as f64
}

fn decibels(squares: f64, values: usize) -> f64 {
    (-10.0 * (squares / values.max(1) as f64).max(1e-12).log10()).min(MOST)
}

/// PSNR of the picture, and of its worst tile.
fn scores(a: &Image, b: &Image) -> (f64, f64) {
    let width = a.width as usize;
    let square = |k: usize| -> f64 {
        let difference =
            |c: usize| f64::from(a.pixels[k][c].clamp(0.0, 1.0) - b.pixels[k][c].clamp(0.0, 1.0));
        (0..3).map(|c| difference(c).powi(2)).sum()
    };
    let all: f64 = (0..a.pixels.len()).map(square).sum();
    let mut worst = MOST;
    for row in 0..a.height as usize / TILE {
        for column in 0..width / TILE {
            let pixels = (0..TILE * TILE).map(|k| (row * TILE + k / TILE) * width + column * TILE + k % TILE);
            worst = worst.min(decibels(pixels.map(square).sum(), 3 * TILE * TILE));
        }
    }
    (decibels(all, 3 * a.pixels.len()), worst)
}

fn test_views(file: &str, width: u32, geometry: &Geometry) -> Result<Vec<Camera>, Box<dyn Error>> {
    if file == "orbit" {
        return Ok(orbit(geometry, ORBIT_VIEWS, width, width / 4 * 3));
    }
    Ok(choose_views(Some(Path::new(file)), SplitFilter::Test, 0, width, geometry)?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [original, cameras, widths, files @ ..] = arguments.as_slice() else {
        return Err("ORIGINAL.ply CAMERAS.json|orbit WIDTH[,WIDTH ...] FILE ...".into());
    };
    let widths: Vec<u32> = widths.split(',').map(str::parse).collect::<Result<_, _>>()?;
    let original = SceneFile::read(Path::new(original), &ReadOptions::default())?;
    let geometry = original.scene().geometry();
    let mut renderer = Renderer::cpu();
    let options = RenderOptions::default();
    let mut references: Vec<(String, Vec<(Camera, Image)>)> = Vec::new();
    let prepared = renderer.prepare(original.scene())?;
    let all = KINDS.map(|(name, kind)| (name.to_owned(), widths[0], kind));
    let others = widths[1..].iter().map(|&width| (format!("path_{width}"), width, Kind::Path));
    for (name, width, kind) in all.into_iter().chain(others) {
        let views = test_views(cameras, width, geometry)?;
        let distances: Vec<f64> = views.iter().map(|view| distance(view, geometry)).collect();
        let mut drawn = Vec::new();
        for (view, distance) in views.iter().zip(&distances) {
            let camera = moved(view, kind, *distance);
            let image = renderer.render(&prepared, &camera, &options)?;
            if covered(&image) >= LEAST_COVERED {
                drawn.push((camera, image));
            }
        }
        references.push((name, drawn));
    }
    drop(prepared);
    for file in files {
        let scene = SceneFile::read(Path::new(file), &ReadOptions::default())?;
        let prepared = renderer.prepare(scene.scene())?;
        let mut out = Map::new();
        out.insert("file".into(), json!(file));
        out.insert("bytes".into(), json!(std::fs::metadata(file)?.len()));
        for (name, views) in &references {
            let (mut all, mut worst_tile) = (Vec::new(), MOST);
            for (camera, image) in views {
                let (view, tile) = scores(image, &renderer.render(&prepared, camera, &options)?);
                all.push(view);
                worst_tile = worst_tile.min(tile);
            }
            let mean = all.iter().sum::<f64>() / all.len().max(1) as f64;
            let worst = all.iter().copied().fold(MOST, f64::min);
            let of = json!({"views": all.len(), "mean": mean, "worst": worst, "worst_tile": worst_tile});
            out.insert(name.clone(), if all.is_empty() { Value::Null } else { of });
        }
        println!("{}", Value::Object(out));
    }
    Ok(())
}
