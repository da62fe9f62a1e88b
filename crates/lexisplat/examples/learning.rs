//! Measures the effect of learning options on mean nonzeros, which learning minimises.
//!
//! `cargo run --release -p lexisplat --example learning -- SCENE.ply [tol=0.1] [pursuit=ols] [atoms=90]
//! [sample=65536] [momentum=0.9] [seed=0]` prints one line.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use lexisplat::learn::{LearnOptions, learn};
use lexisplat::pursuit::{Coder, StopRule, ValueType};
use lexisplat::{Silent, ply};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let scene = arguments.next().ok_or("usage: learning SCENE.ply [option=value ...]")?;
    let mut tolerance = 0.1;
    let mut options = LearnOptions::new(StopRule::new(Some(tolerance), None)?);
    for argument in arguments {
        let (name, value) = argument.split_once('=').ok_or("options are name=value")?;
        match name {
            "tol" => tolerance = value.parse()?,
            "pursuit" => options.pursuit = value.parse()?,
            "atoms" => options.atoms = Some(value.parse()?),
            "sample" => options.sample = value.parse()?,
            "momentum" => options.momentum = value.parse()?,
            "seed" => options.seed = value.parse()?,
            _ => return Err(format!("no option '{name}'").into()),
        }
    }
    options.stop = StopRule::new(Some(tolerance), None)?;
    let splats = ply::read(Path::new(&scene), &ply::ReadOptions::default())?.splats;
    let start = Instant::now();
    let learned = learn(splats.degree, &splats.sh_rest, &options, &Silent)?;
    let seconds = start.elapsed().as_secs_f64();
    let mut nonzeros = 0;
    Coder::new(&learned.dictionary, options.pursuit, options.stop, ValueType::F32)
        .encode(&splats.sh_rest, |visit| nonzeros += visit.code.len());
    println!(
        "tol {tolerance} {} atoms {} sample {} momentum {} seed {}: {:.3} nonzeros (held out {:.3}), {} rounds, {seconds:.1} s",
        options.pursuit,
        learned.dictionary.len(),
        learned.sample,
        options.momentum,
        options.seed,
        nonzeros as f64 / splats.len() as f64,
        learned.held_out_nonzeros,
        learned.rounds,
    );
    Ok(())
}
