//! Measures how fast a packed file is decoded: `unpacking_speed FILE.lexi [ROUNDS]`. `RAYON_NUM_THREADS=1` restricts
//! it to one core, and `LEXISPLAT_SIMD` chooses the vector instructions.

use std::path::Path;
use std::time::Instant;

use lexisplat::lexi::LexiReader;
use lexisplat::simd::Simd;
use lexisplat::{Error, Input, Limits};

fn main() -> Result<(), Error> {
    let simd = std::env::var("LEXISPLAT_SIMD").ok().and_then(|name| Simd::named(&name));
    simd.unwrap_or_else(Simd::widest).scope(measure)
}

fn measure() -> Result<(), Error> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().unwrap_or_default();
    let rounds: usize = arguments.next().and_then(|a| a.parse().ok()).unwrap_or(10);
    let bytes = Input::open(Path::new(&file))?;
    let Some(packed) = LexiReader::open(&file, bytes, &Limits::default())?.packed()? else {
        eprintln!("{file} is not packed");
        return Ok(());
    };
    let mut best = f64::INFINITY;
    for _ in 0..rounds {
        let clock = Instant::now();
        let model = packed.unpack()?;
        best = best.min(clock.elapsed().as_secs_f64());
        assert_eq!(model.len(), packed.len());
    }
    println!("{:.4} s at best, {:.0} Gaussians a second", best, packed.len() as f64 / best);
    Ok(())
}
