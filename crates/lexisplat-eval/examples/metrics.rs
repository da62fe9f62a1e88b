//! Every metric of two pictures, or how long each takes.
//!
//! `cargo run --release -p lexisplat-eval --example metrics -- A.png B.png [--lpips FILE]... [--time]`: prints one
//! JSON object: each metric by name, `ssim_inner` being SSIM without the border; with `--time` the seconds each
//! took, the least of a few runs. Both pictures must have 8 bits. `--lpips` takes what
//! `scripts/lpips_weights.py` writes. `benches/metrics_beside_references.py` runs this.

use std::error::Error;
use std::time::Instant;

use lexisplat_eval::metrics::lpips::{Network, PixelRange};
use lexisplat_eval::metrics::{Lpips, Metric, flip, psnr, ssim, ssim_inner};
use lexisplat_render::Image;
use serde_json::{Map, Value, json};

/// Runs of each metric when timed, and seconds after which there are no more.
const RUNS: usize = 5;
const ENOUGH_SECONDS: f64 = 5.0;

fn read(path: &str) -> Result<Image, Box<dyn Error>> {
    let picture = image::open(path)?.into_rgb8();
    let (width, height) = picture.dimensions();
    let (pixels, _) = picture.as_raw().as_chunks();
    Ok(Image::from_8bit(width, height, pixels)?)
}

/// Returns the result of `metric`, or the least seconds it took.
fn run(
    timed: bool,
    mut metric: impl FnMut() -> lexisplat_compress::Result<Option<f64>>,
) -> Result<Value, Box<dyn Error>> {
    let mut result = metric()?;
    if timed {
        let (start, mut least) = (Instant::now(), f64::INFINITY);
        for _ in 0..RUNS {
            let run = Instant::now();
            result = metric()?;
            least = least.min(run.elapsed().as_secs_f64());
            if start.elapsed().as_secs_f64() > ENOUGH_SECONDS {
                break;
            }
        }
        result = result.map(|_| least);
    }
    Ok(json!(result))
}

fn main() -> Result<(), Box<dyn Error>> {
    let (mut files, mut networks, mut timed) = (Vec::new(), Vec::new(), false);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--lpips" => networks.push(Lpips::load(arguments.next().ok_or("--lpips needs a file")?)?),
            "--time" => timed = true,
            _ => files.push(argument),
        }
    }
    let [a, b] = files.as_slice() else {
        return Err("usage: metrics A.png B.png [--lpips FILE]... [--time]".into());
    };
    let (a, b) = (read(a)?, read(b)?);
    let mut out = Map::new();
    let mut put = |name: &str, value| out.insert(name.to_owned(), value);
    put(Metric::Psnr.name(), run(timed, || psnr(&a, &b))?);
    put(Metric::Ssim.name(), run(timed, || ssim(&a, &b).map(Some))?);
    put("ssim_inner", run(timed, || ssim_inner(&a, &b).map(Some))?);
    put(Metric::Flip.name(), run(timed, || flip(&a, &b).map(Some))?);
    for lpips in &networks {
        let [standard, inria] = match lpips.network() {
            Network::Vgg => [Metric::LpipsVgg, Metric::LpipsVggInria],
            Network::Alex => [Metric::LpipsAlex, Metric::LpipsAlexInria],
        };
        put(standard.name(), run(timed, || lpips.distance(&a, &b, PixelRange::Standard).map(Some))?);
        put(inria.name(), run(timed, || lpips.distance(&a, &b, PixelRange::Inria).map(Some))?);
    }
    println!("{}", Value::Object(out));
    Ok(())
}
