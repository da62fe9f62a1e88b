//! Measures how fast a packed file is decoded: `unpacking_speed FILE.lexi [ROUNDS]`. `RAYON_NUM_THREADS=1` restricts
//! it to one core.

use std::path::Path;
use std::time::Instant;

use lexisplat::lexi::{self, Contents};
use lexisplat::{Error, Limits};

fn main() -> Result<(), Error> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().unwrap_or_default();
    let rounds: usize = arguments.next().and_then(|a| a.parse().ok()).unwrap_or(10);
    let Contents::Packed(packed) = lexi::open(Path::new(&file), &Limits::default())? else {
        eprintln!("{file} is not packed");
        return Ok(());
    };
    let mut best = f64::INFINITY;
    for _ in 0..rounds {
        let clock = Instant::now();
        let model = packed.unpack()?;
        best = best.min(clock.elapsed().as_secs_f64());
        assert_eq!(model.len(), packed.gaussians);
    }
    println!("{:.4} s at best, {:.0} Gaussians a second", best, packed.gaussians as f64 / best);
    Ok(())
}
