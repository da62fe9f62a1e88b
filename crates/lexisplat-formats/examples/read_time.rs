//! Measures how fast a scene of any format is read into memory: `read_time FILE [ROUNDS]`. Prints the seconds of the
//! fastest round and the number of Gaussians. `RAYON_NUM_THREADS=1` restricts it to one core. The file is in memory before
//! the first round.

use std::path::Path;
use std::time::Instant;

use lexisplat::ply::ReadOptions;
use lexisplat::{Error, Input, Silent};
use lexisplat_formats::{Siblings, open};

/// Rounds, where none are given.
const ROUNDS: usize = 5;

fn main() -> Result<(), Error> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().unwrap_or_default();
    let rounds = arguments.next().and_then(|a| a.parse().ok()).unwrap_or(ROUNDS);
    let bytes = Input::open(Path::new(&file))?.to_vec();
    let options = ReadOptions::default();
    let (mut best, mut count) = (f64::INFINITY, 0);
    for _ in 0..rounds {
        let clock = Instant::now();
        let scene = open(&file, &bytes, Siblings::of(Path::new(&file)), &options, true, &Silent)?;
        count = scene.source().whole()?.len();
        best = best.min(clock.elapsed().as_secs_f64());
    }
    println!("{best:.4} {count}");
    Ok(())
}
