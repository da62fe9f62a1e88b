//! Measures the coding step alone: pursuit, rounding of values, and verification of the bound.
//!
//! `cargo run --release -p lexisplat --example coding_speed -- SCENE.ply DICTIONARY.lexi TOL PURSUIT THREADS REPEATS`
//! prints one JSON object. The dictionary may be a dictionary file or a compressed scene. `LEXISPLAT_SIMD` chooses the
//! vector instructions.
//! `benches/coding_beside_spams.py` compares this program with SPAMS.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use lexisplat::pursuit::{Coder, Encoded, StopRule, ValueType};
use lexisplat::simd::Simd;
use lexisplat::{Limits, lexi, ply};
use rayon::prelude::*;

/// Gaussians that one task codes.
const GAUSSIANS_PER_TASK: usize = 2048;

fn main() -> Result<(), Box<dyn Error>> {
    let simd = std::env::var("LEXISPLAT_SIMD").ok().and_then(|name| Simd::named(&name));
    simd.unwrap_or_else(Simd::widest).scope(measure)
}

fn measure() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, dictionary, tolerance, pursuit, threads, repeats] = &arguments[..] else {
        return Err("usage: coding_speed SCENE.ply DICTIONARY.lexi TOL omp|ols THREADS REPEATS".into());
    };
    let splats = ply::read(Path::new(scene), &ply::ReadOptions::default())?.splats;
    let dictionary = lexi::read_dictionary(Path::new(dictionary), &Limits::default())?;
    let stop = StopRule::new(Some(tolerance.parse()?), None)?;
    let repeats: usize = repeats.parse()?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.parse()?).build()?;
    let signals = &splats.sh_rest;

    let run = || {
        let coder = Coder::new(&dictionary, pursuit.parse()?, stop, ValueType::F32);
        let simd = Simd::current();
        let code = |chunk: &[f32]| {
            let (mut codes, mut escapes, mut worst) = (Vec::new(), 0_usize, 0.0_f64);
            coder.encode(chunk, |visit| match visit.outcome {
                Encoded::Code { error } => {
                    worst = worst.max(error);
                    codes.extend_from_slice(visit.code);
                }
                Encoded::Escape => escapes += 1,
            });
            (codes.len(), escapes, worst)
        };
        let parts = pool.install(|| {
            signals
                .par_chunks(GAUSSIANS_PER_TASK * dictionary.dim())
                .map(|chunk| simd.scope(|| code(chunk)))
                .collect::<Vec<_>>()
        });
        Ok::<_, lexisplat::Error>(parts)
    };
    let mut seconds = Vec::new();
    let mut parts = run()?;
    for _ in 0..repeats {
        let start = Instant::now();
        parts = run()?;
        seconds.push(start.elapsed().as_secs_f64());
    }
    seconds.sort_by(f64::total_cmp);
    let median = seconds.get(repeats / 2).copied().unwrap_or(f64::NAN);
    let nonzeros: usize = parts.iter().map(|p| p.0).sum();
    let escapes: usize = parts.iter().map(|p| p.1).sum();
    let worst = parts.iter().map(|p| p.2).fold(0.0, f64::max);
    println!(
        "{{\"gaussians\": {n}, \"per_second\": {:.0}, \"mean_nonzeros\": {:.4}, \"escapes\": {escapes}, \"max_residual\": {worst}}}",
        splats.len() as f64 / median,
        nonzeros as f64 / splats.len() as f64,
        n = splats.len(),
    );
    Ok(())
}
