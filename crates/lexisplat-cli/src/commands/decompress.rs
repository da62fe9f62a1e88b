//! `lexisplat decompress`.

use std::time::Instant;

use anyhow::Result;
use lexisplat::stream;
use serde_json::json;

use lexisplat_eval::format;

use crate::args::{Common, Decompress};
use crate::files::{check_output, input, is_pipe, open_lexi, output_path, tell, write_output};
use crate::progress::Bars;
use crate::stop::{self, Work};

pub(crate) fn run(args: &Decompress, common: &Common) -> Result<()> {
    let start = Instant::now();
    let output = output_path(&args.input, args.output.as_deref(), "ply", common)?;
    check_output(&output, &[&args.input], common.overwrite)?;
    stop::while_writing(if is_pipe(&output) { Work::Stream } else { Work::Files(1) });
    let (name, bytes) = input(&args.input, common)?;
    let lexi = open_lexi(&name, &bytes, &args.part, common)?;
    let bars = Bars::new(common.quiet);
    let bytes = write_output(&output, common.overwrite, |sink| stream::decompress(&lexi, sink, &bars))?;
    let seconds = start.elapsed().as_secs_f64();
    let name = output.display();
    if is_pipe(&output) {
        return Ok(());
    }
    let json = json!({
        "output": name.to_string(),
        "gaussians": lexi.len(),
        "gaussians_in_file": lexi.whole_len(),
        "sh_degree": lexi.degree().get(),
        "ply_bytes": bytes,
        "total_seconds": seconds,
    });
    tell(common, json, || {
        let mut count = format::count(lexi.len() as u64);
        if lexi.len() < lexi.whole_len() {
            count = format!("{count} of {}", format::count(lexi.whole_len() as u64));
        }
        let (degree, bytes) = (lexi.degree(), format::bytes(bytes));
        Ok(format!("wrote {name}: {count} Gaussians, SH degree {degree}, {bytes}, {seconds:.1} s\n"))
    })
}
