//! `lexisplat demo`.

use anyhow::Result;

use crate::args::{Common, Demo};

pub(crate) fn run(_args: &Demo, _common: &Common) -> Result<()> {
    anyhow::bail!("not yet")
}
