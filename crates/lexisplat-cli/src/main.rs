//! The `lexisplat` command: compress, decompress, draw and compare 3D Gaussian Splatting scenes.

mod args;
mod bar;
mod commands;
mod device;
mod exit;
mod files;
mod page;
mod progress;
mod stop;
mod terminal;

use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = match args::parse() {
        Ok(cli) => cli,
        Err(error) => return exit::report_usage(&error, args::asks_for_json()),
    };
    let json = cli.common.json;
    stop::listen();
    let done = commands::run(cli);
    bar::clear();
    stop::wait_if_stopped();
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => exit::report(&error, json),
    }
}
