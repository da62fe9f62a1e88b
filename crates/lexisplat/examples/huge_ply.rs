//! Makes a scene of any size from copies of a model, to measure time and memory:
//!
//! `cargo run --release -p lexisplat --example huge_ply -- MODEL.ply GAUSSIANS OUT.ply [SEED]`
//!
//! Copies lie on a square grid in x and z. Their distance is the width of nine tenths of the model's Gaussians. Every
//! value gets seeded noise, so that no two Gaussians are alike. Memory: a few times the model.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use lexisplat::{Splats, ply};
use rayon::prelude::*;

/// Standard deviations of the noise: on SH-rest as a share of the value; on base colour; on opacity before the sigmoid
/// and on the logarithms of scales.
const NOISE: [f32; 3] = [0.05, 0.02, 0.03];
/// Standard deviation of the noise on positions, in standard deviations of the Gaussian's longest axis.
const POSITION_NOISE: f32 = 0.3;
/// Gaussians that one task changes.
const GAUSSIANS_PER_TASK: usize = 4096;

/// `splitmix64` (Vigna).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// An approximately normal number of variance 1: a sum of four uniform numbers.
    #[expect(clippy::cast_precision_loss, reason = "16 bits")]
    fn normal(&mut self) -> f32 {
        let bits = self.bits();
        let sum: f32 = (0..4).map(|k| (bits >> (16 * k) & 0xffff) as f32 / 65_536.0 - 0.5).sum();
        sum * 3.0_f32.sqrt()
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, count, output, rest @ ..] = arguments.as_slice() else {
        return Err("usage: huge_ply MODEL.ply GAUSSIANS OUT.ply [SEED]".into());
    };
    let (count, seed): (usize, u64) = (count.parse()?, rest.first().map_or(Ok(0), |s| s.parse())?);
    let model = ply::read(Path::new(model), &ply::ReadOptions::default())?.splats;
    let copies = count.div_ceil(model.len().max(1));
    let side = (1..).find(|side| side * side >= copies).unwrap_or(1);
    let pitch = [0, 2].map(|axis| width(&model, axis));
    let mut out = BufWriter::with_capacity(1 << 20, File::create(output)?);
    for copy in 0..copies {
        let mut part = noisy(&model, seed ^ (copy as u64) << 32);
        let (row, column) = (copy / side, copy % side);
        for position in &mut part.geometry.positions {
            position[0] += pitch[0] * column as f32;
            position[2] += pitch[1] * row as f32;
        }
        let keep: Vec<bool> = (0..part.len()).map(|i| copy * model.len() + i < count).collect();
        part.retain(&keep);
        let mut bytes = Vec::new();
        ply::write(&mut bytes, &part)?;
        let end = b"end_header\n";
        let data = bytes.windows(end.len()).position(|w| w == end).ok_or("no header")? + end.len();
        if copy == 0 {
            let header = String::from_utf8(bytes[..data].to_vec())?;
            let (own, all) = (format!("vertex {}\n", part.len()), format!("vertex {count}\n"));
            out.write_all(header.replace(&own, &all).as_bytes())?;
        }
        out.write_all(&bytes[data..])?;
    }
    out.flush()?;
    Ok(())
}

/// The width along `axis` of the middle nine tenths of the model's Gaussians.
fn width(model: &Splats, axis: usize) -> f32 {
    let mut values: Vec<f32> = model.geometry.positions.iter().map(|p| p[axis]).collect();
    values.sort_by(f32::total_cmp);
    let at = |share: usize| values.get(values.len() * share / 20).copied().unwrap_or(0.0);
    at(19) - at(1)
}

/// Returns `model` with noise on all its values.
fn noisy(model: &Splats, seed: u64) -> Splats {
    let mut out = model.clone();
    let dim = model.degree.rest().max(1);
    let random = |chunk: usize, stream: u64| Random(seed ^ stream << 56 ^ chunk as u64);
    out.sh_rest.par_chunks_mut(GAUSSIANS_PER_TASK * dim).enumerate().for_each(|(chunk, values)| {
        let mut random = random(chunk, 1);
        values.iter_mut().for_each(|v| *v *= 1.0 + NOISE[0] * random.normal());
    });
    let g = &mut out.geometry;
    let mut random = random(0, 2);
    for i in 0..g.positions.len() {
        let longest = g.scales[i].iter().copied().fold(f32::NEG_INFINITY, f32::max).exp().min(1.0);
        g.positions[i].iter_mut().for_each(|v| *v += POSITION_NOISE * longest * random.normal());
        g.dc[i].iter_mut().for_each(|v| *v += NOISE[1] * random.normal());
        g.opacities[i] += NOISE[2] * random.normal();
        g.scales[i].iter_mut().for_each(|v| *v += NOISE[2] * random.normal());
    }
    out
}
