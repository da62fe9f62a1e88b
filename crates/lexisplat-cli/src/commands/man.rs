//! `lexisplat man`.

use anyhow::Result;
use lexisplat::Error;

use crate::args::{Man, command};
use crate::terminal::print_unescaped;

/// The program and its version, at the foot of every page.
const SOURCE: &str = concat!("lexisplat ", env!("CARGO_PKG_VERSION"));

pub(crate) fn run(args: &Man) -> Result<()> {
    let mut program = command().disable_help_subcommand(true);
    // Hands the options of every command on to the commands, and gives these their whole names.
    program.build();
    let shown = match &args.command {
        None => &program,
        Some(name) => program.find_subcommand(name).ok_or_else(|| {
            let names: Vec<&str> = program.get_subcommands().map(clap::Command::get_name).collect();
            Error::parameter("command", name, names.join(", "))
        })?,
    };
    let mut page = Vec::new();
    clap_mangen::Man::new(shown.clone()).source(SOURCE).render(&mut page)?;
    print_unescaped(&String::from_utf8_lossy(&page))
}
