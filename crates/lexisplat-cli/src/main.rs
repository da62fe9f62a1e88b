//! The `lexisplat` command: compress, decompress, draw and compare 3D Gaussian Splatting scenes.

mod args;
mod commands;
mod device;
mod exit;
mod files;
mod progress;
mod stop;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let cli = args::Cli::parse();
    stop::listen();
    let done = commands::run(cli);
    stop::wait_if_stopped();
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => exit::report(&error),
    }
}
