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
mod render;
mod sweep;
#[cfg(feature = "view")]
mod view;

use anyhow::{Context, Result};

use lexisplat::simd::Simd;

use crate::args::{Cli, Command};

/// Sets up threads and runs the command.
pub(crate) fn run(cli: Cli) -> Result<()> {
    let Cli { common, command } = cli;
    Simd::chosen()?;
    rayon::ThreadPoolBuilder::new()
        .num_threads(common.threads)
        .build_global()
        .context("cannot start the worker threads")?;
    match command {
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
    }
}
