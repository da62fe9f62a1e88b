//! `lexisplat view`.

use anyhow::Result;
use lexisplat_view::Options;

use crate::args::{Common, View};
use crate::files::outputs;

pub(crate) fn run(args: &View, common: &Common) -> Result<()> {
    let views = &args.views;
    let options = Options {
        files: args.files.clone(),
        cameras: views.cameras.clone(),
        split: views.split.unwrap_or_default(),
        orbit: views.generated(),
        max_width: views.width,
        near: views.near,
        background: views.background,
        device: views.device,
        overwrite: common.overwrite,
        limits: common.limits()?,
        script: args.actions.clone(),
        outputs: outputs().clone(),
    };
    Ok(lexisplat_view::run(options)?)
}
