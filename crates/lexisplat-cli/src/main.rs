//! The `lexisplat` command: compress, decompress, draw and compare 3D Gaussian Splatting scenes.

mod args;
mod commands;
mod exit;
mod files;
mod progress;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let cli = args::Cli::parse();
    match commands::run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => exit::report(&error),
    }
}
