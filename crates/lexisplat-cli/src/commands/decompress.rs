//! `lexisplat decompress`.

use std::time::Instant;

use anyhow::{Context, Result};
use lexisplat::{Error, Limits, lexi, ply};
use serde_json::json;

use lexisplat_eval::text;

use crate::args::{Common, Decompress};
use crate::files::{check_output, is_pipe, output_path, print, print_json, standard_input, write_output};

pub(crate) fn run(args: &Decompress, common: &Common) -> Result<()> {
    let start = Instant::now();
    let output = output_path(&args.input, args.output.as_deref(), "ply")?;
    if is_pipe(&output) && common.json {
        let expected = "a file: with --json standard output carries the report";
        return Err(Error::parameter("output", "-", expected).into());
    }
    check_output(&output, &[&args.input], common.overwrite)?;
    let limits = Limits::default();
    let model = if is_pipe(&args.input) {
        lexi::read_bytes("standard input", &standard_input()?, &limits)?
    } else {
        lexi::read(&args.input, &limits)?
    };
    let splats = model.into_splats();
    let bytes = write_output(
        &output,
        |path| Ok(ply::write(path, &splats)?),
        |out| ply::write_to(out, &splats).context("standard output"),
    )?;
    let seconds = start.elapsed().as_secs_f64();
    let name = output.display();
    if common.json {
        print_json(&json!({
            "output": name.to_string(),
            "gaussians": splats.len(),
            "sh_degree": splats.degree.get(),
            "ply_bytes": bytes,
            "total_seconds": seconds,
        }))
    } else if common.quiet || is_pipe(&output) {
        Ok(())
    } else {
        let count = text::count(splats.len() as u64);
        print(&format!(
            "wrote {name}: {count} Gaussians, SH degree {}, {}, {seconds:.1} s\n",
            splats.degree,
            text::bytes(bytes)
        ))
    }
}
