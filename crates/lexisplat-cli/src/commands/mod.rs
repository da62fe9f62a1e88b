//! One file a command, glue only.

mod bench;
mod compare;
mod completions;
mod compress;
mod decompress;
mod demo;
mod devices;
mod eval;
mod info;
mod pack;
mod render;
mod sweep;
#[cfg(feature = "view")]
mod view;

use anyhow::{Context, Result};

use lexisplat::Error;
use lexisplat::simd::Simd;

use crate::args::{Cli, Command};

/// The environment variable that chooses vector instructions by name.
const SIMD_VARIABLE: &str = "LEXISPLAT_SIMD";

/// Sets up threads and runs the command.
pub(crate) fn run(cli: Cli) -> Result<()> {
    let Cli { common, command } = cli;
    let simd = instructions()?;
    rayon::ThreadPoolBuilder::new()
        .num_threads(common.threads)
        .build_global()
        .context("cannot start the worker threads")?;
    simd.scope(|| match command {
        Command::Compress(args) => compress::run(&args, &common),
        Command::Decompress(args) => decompress::run(&args, &common),
        Command::Info(args) => info::run(&args, &common),
        Command::Render(args) => render::run(&args, &common),
        Command::Compare(args) => compare::run(&args, &common),
        Command::Eval(args) => eval::run(&args, &common),
        Command::Sweep(args) => sweep::run(&args, &common),
        #[cfg(feature = "view")]
        Command::View(args) => view::run(&args, &common),
        Command::Bench(args) => bench::run(&args, &common),
        Command::Devices(_) => devices::run(&common),
        Command::Demo(args) => demo::run(&args, &common),
        Command::Completions(args) => completions::run(&args),
    })
}

/// The vector instructions that the environment asks for, by default the widest.
fn instructions() -> Result<Simd> {
    match std::env::var_os(SIMD_VARIABLE) {
        Some(name) if !name.is_empty() => {
            let name = name.to_string_lossy();
            let refusal = || {
                let names: Vec<&str> = Simd::available().into_iter().map(Simd::name).collect();
                let expected = format!("{}: this CPU has no other", names.join(" or "));
                Error::parameter(SIMD_VARIABLE, &name, expected)
            };
            Ok(Simd::named(&name).ok_or_else(refusal)?)
        }
        _ => Ok(Simd::widest()),
    }
}
