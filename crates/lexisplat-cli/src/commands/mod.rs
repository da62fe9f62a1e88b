//! The commands, each in a file of its own. They do not parse and do not compute: they call the libraries and print the
//! results.

mod bench;
mod compare;
mod completions;
mod compress;
mod convert;
mod decompress;
mod demo;
mod devices;
mod eval;
mod first_view;
mod html;
mod info;
mod man;
mod render;
mod scores;
mod sweep;
#[cfg(feature = "view")]
mod view;

use anyhow::{Context, Result};

use lexisplat::Error;
use lexisplat::simd::Simd;
use lexisplat_compress::views::{ViewOptions, find_views};
use lexisplat_render::{Camera, Scene};

use crate::args::{Cli, Command, Views};
use crate::progress;
use crate::terminal::{note, warn};

/// Largest number of worker threads for each core. More threads only wait for each other, and very many of them can halt
/// a machine.
const THREADS_PER_CORE: usize = 4;

/// Environment variable with the name of the vector instructions to use.
const SIMD_VARIABLE: &str = "LEXISPLAT_SIMD";

/// Sets up threads and runs the command.
pub(crate) fn run(cli: Cli) -> Result<()> {
    let Cli { common, command } = cli;
    let simd = instructions()?;
    rayon::ThreadPoolBuilder::new()
        .num_threads(allowed_threads(common.threads))
        .build_global()
        .context("cannot start the worker threads")?;
    if !common.quiet && !command.is_interactive() {
        progress::show();
    }
    simd.scope(|| match command {
        Command::Compress(args) => compress::run(&args, &common),
        Command::Decompress(args) => decompress::run(&args, &common),
        Command::Convert(args) => convert::run(&args, &common),
        Command::Info(args) => info::run(&args, &common),
        Command::Render(args) => render::run(&args, &common),
        Command::Compare(args) => compare::run(&args, &common),
        Command::Eval(args) => eval::run(&args, &common),
        Command::Sweep(args) => sweep::run(&args, &common),
        Command::Html(args) => html::run(&args, &common),
        #[cfg(feature = "view")]
        Command::View(args) => view::run(&args, &common),
        Command::Bench(args) => bench::run(&args, &common),
        Command::Devices(_) => devices::run(&common),
        Command::Demo(args) => demo::run(&args, &common),
        Command::Completions(args) => completions::run(&args),
        Command::Man(args) => man::run(&args),
    })
}

/// Returns the vector instructions that the environment asks for; by default the widest.
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

/// Returns the number of worker threads to start. It is `asked`, or the largest number allowed if that is less; in this
/// case a note is printed.
fn allowed_threads(asked: usize) -> usize {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let most = cores.saturating_mul(THREADS_PER_CORE);
    if asked > most {
        note(&format!(
            "warning: --threads {asked}: only {most} threads are started, {THREADS_PER_CORE} for each of {cores} cores"
        ));
    }
    asked.min(most)
}

/// Returns the cameras that `views` describe for a scene, and prints warnings about them.
fn cameras(views: &Views, scene: &Scene<'_>) -> lexisplat_compress::Result<Vec<Camera>> {
    let options = ViewOptions { offset: scene.meta().offset, ..views.options(None) };
    let found = find_views(&options, scene.geometry())?;
    warn("views", &found.warnings);
    Ok(found.views.into_iter().map(|view| view.camera).collect())
}
