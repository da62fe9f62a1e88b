//! `lexisplat completions`.

use anyhow::Result;
use clap::CommandFactory;

use crate::args::{Cli, Completions};
use crate::files::print;

pub(crate) fn run(args: &Completions) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "lexisplat", &mut script);
    print(&String::from_utf8_lossy(&script))
}
