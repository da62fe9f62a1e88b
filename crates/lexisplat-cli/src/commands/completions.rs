//! `lexisplat completions`.

use anyhow::Result;

use crate::args::{Completions, command};
use crate::terminal::print_unescaped;

pub(crate) fn run(args: &Completions) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command(), "lexisplat", &mut script);
    print_unescaped(&String::from_utf8_lossy(&script))
}
