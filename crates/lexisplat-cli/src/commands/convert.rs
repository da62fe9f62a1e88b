//! `lexisplat convert`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Result;
use lexisplat::lexi::{LexiReader, LexiWriter};
use lexisplat::ply::ReadOptions;
use lexisplat::{Input, Splats, unite};
use lexisplat_compress::{Compression, DrawOptions, Packing, judging_views};
use lexisplat_eval::{SceneFile, Whereabouts, compare, format};
use lexisplat_formats::{Edits, Kind, Lost, merge, open, write};
use lexisplat_render::{Device, Scene};
use serde_json::{Value, json};

use crate::args::{Common, Convert, ViewChoice};
use crate::device::open_renderer;
use crate::exit::Misuse;
use crate::files::{check_output, input, is_pipe, siblings, tell, warn, write_output};
use crate::progress::Bars;
use crate::stop::{self, Work};

/// Text for the values that are rounded when scenes are merged.
const UNITED: &str = "32-bit floats, relative to one offset for all scenes,";
/// Number of views that --psnr draws.
const VIEWS: usize = 8;

pub(crate) fn run(args: &Convert, common: &Common) -> Result<()> {
    let start = Instant::now();
    let Some((output, inputs)) = args.files.split_last() else { return Ok(()) };
    let kind = kind_of(output, args.to)?;
    let paths: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
    check_output(output, &paths, common.overwrite)?;
    stop::while_writing(if is_pipe(output) { Work::Stream } else { Work::Files(1) });
    let bars = Bars::new(common.quiet);
    let edits = args.edits()?;
    if let ([input], Kind::Lexi, Some(view), true) = (inputs, kind, args.view, edits == Edits::default())
        && let Some(bytes) = with_view(input, output, view, common, &bars)?
    {
        let json =
            json!({ "output": output.display().to_string(), "format": kind.extension(), "bytes": bytes });
        return tell(common, json, || {
            Ok(format!("wrote {}: {} with another first view\n", output.display(), format::bytes(bytes)))
        });
    }
    let (mut splats, lost_extras, bytes_in) = read_all(inputs, args, common, &bars)?;
    edits.apply(&mut splats)?;
    if let Some(view) = args.view {
        // An empty text stands for no view.
        splats.meta.view = Some(view.pose().map_or_else(String::new, |pose| pose.to_string()));
    }
    let (bytes, mut lost) = write_output(output, common.overwrite, |sink| match kind {
        Kind::Lexi => {
            let report = Compression::from(Packing::default()).run(&splats, sink, &bars)?;
            Ok::<_, anyhow::Error>((report.file_bytes, Lost::default()))
        }
        kind => Ok(write(kind, &splats, &args.write_options(), sink, &bars)?),
    })?;
    lost.extras.extend(lost_extras);
    warn(&output.display().to_string(), &lost.coarse);
    if is_pipe(output) {
        return Ok(());
    }
    let psnr = if args.psnr { Some(psnr(output, &splats, common, &bars)?) } else { None };
    let seconds = start.elapsed().as_secs_f64();
    let json = json!({
        "output": output.display().to_string(),
        "format": kind.extension(),
        "gaussians": splats.len(),
        "sh_degree": lost.sh_degree.map_or(splats.degree.get(), |[_, degree]| degree),
        "bytes_in": bytes_in,
        "bytes": bytes,
        "lost": lost,
        "psnr": psnr,
        "total_seconds": seconds,
    });
    tell(common, json, || {
        let mut out = String::new();
        let (name, count) = (output.display(), format::count(splats.len() as u64));
        let (bytes, of) = (format::bytes(bytes), format::bytes(bytes_in));
        writeln!(out, "wrote {name}: {kind}, {count} Gaussians, {bytes} of {of}, {seconds:.1} s")?;
        for line in lost_lines(&lost) {
            writeln!(out, "lost  {line}")?;
        }
        if let Some(Value::Object(psnr)) = &psnr {
            let value = |name: &str| psnr.get(name).and_then(Value::as_f64);
            let [mean, least] = ["mean", "min"].map(|name| format::decibels(value(name)));
            writeln!(out, "PSNR  {mean} on average, {least} at worst, over {VIEWS} views")?;
        }
        Ok(out)
    })
}

/// Writes the .lexi `path` with another first view to `output`. Returns the number of bytes; `None` for a file of another format.
fn with_view(
    path: &Path,
    output: &Path,
    view: ViewChoice,
    common: &Common,
    bars: &Bars,
) -> Result<Option<u64>> {
    let (name, bytes) = input(path, common)?;
    if Kind::of(&name, &bytes) != Some(Kind::Lexi) {
        return Ok(None);
    }
    let reader = LexiReader::open(&name, &bytes, &common.limits()?)?;
    let view = view.pose().map(|pose| pose.to_string());
    let write =
        |writer: LexiWriter<'_>| write_output(output, common.overwrite, |sink| writer.write(sink, bars));
    match reader.packed()? {
        Some(packed) => write(LexiWriter::packed(&packed.with_view(view))),
        None => write(LexiWriter::exact(&reader.model()?.with_view(view), reader.layout().codes())?),
    }
    .map(Some)
}

/// Returns the format to write: the format asked for, or the format of the output's extension.
fn kind_of(output: &Path, asked: Option<Kind>) -> Result<Kind> {
    if let Some(kind) = asked {
        return Ok(kind);
    }
    let name = output.display().to_string();
    match Kind::of_extension(&name) {
        Some(Kind::Gltf) if !name.to_ascii_lowercase().ends_with(Kind::Gltf.extension()) => Err(Misuse {
            problem: format!("{name}: glTF is written as one file, a .glb"),
            help: "end the output with .glb".to_owned(),
        }
        .into()),
        Some(kind) if kind != Kind::Lexi && !Kind::WRITTEN.contains(&kind) => Err(Misuse {
            problem: format!("{name}: {kind} is not written"),
            help: "name an output of another format, such as .spz or .compressed.ply".to_owned(),
        }
        .into()),
        Some(kind) => Ok(kind),
        None => Err(Misuse {
            problem: format!("{name}: the extension names no format"),
            help:
                "end the output with .ply, .lexi, .spz, .sog, .compressed.ply, .splat or .glb, or say --to FORMAT"
                    .to_owned(),
        }
        .into()),
    }
}

/// Returns all scenes merged into one, the names of extra properties that not all of them have, and the number of bytes
/// read.
fn read_all(
    inputs: &[PathBuf],
    args: &Convert,
    common: &Common,
    bars: &Bars,
) -> Result<(Splats, Vec<String>, u64)> {
    let options = ReadOptions::default()
        .with_drop_invalid(args.drop_invalid)
        .with_drop_extras(args.drop_extras)
        .with_limits(common.limits()?);
    let (mut all, mut lost, mut bytes_in) = (None::<Splats>, Vec::new(), 0);
    for path in inputs {
        let (name, bytes) = input(path, common)?;
        bytes_in += bytes.len() as u64;
        let opened = open(&name, &bytes, siblings(&name), &options, true, bars)?;
        warn(&name, opened.source().warnings());
        let mut next = opened.some(&name)?.whole()?.into_owned();
        match &mut all {
            None => all = Some(next),
            Some(all) => {
                if all.meta.antialiased != next.meta.antialiased {
                    let said =
                        "only some of the scenes were trained with anti-aliasing; the first one decides";
                    warn(&name, &[said.to_owned()]);
                }
                warn(&name, unite(all, &mut next).warning(UNITED).as_slice());
                for name in merge(all, next) {
                    if !lost.contains(&name) {
                        lost.push(name);
                    }
                }
            }
        }
    }
    let all = all.ok_or_else(|| lexisplat::Error::parameter("files", 0, "at least one scene"))?;
    Ok((all, lost, bytes_in))
}

/// Returns the mean and the smallest PSNR of the written file against `splats`.
fn psnr(output: &Path, splats: &Splats, common: &Common, bars: &Bars) -> Result<Value> {
    let options = ReadOptions::default().with_limits(common.limits()?);
    let bytes = Input::open_within(output, &options.limits)?;
    let mut written = SceneFile::read_bytes(&output.display().to_string(), &bytes, &options)?;
    written.align(&Whereabouts::of(&Scene::from(splats)));
    let mut renderer = open_renderer(Device::Cpu)?;
    let cameras = judging_views(&mut renderer, splats, VIEWS, bars)?;
    let draw = DrawOptions::default();
    let scene = Scene::from(splats);
    let found = compare(&mut renderer, &scene, &written.scene(), &cameras, &draw, bars, |_, _, _| {
        Ok::<(), anyhow::Error>(())
    })?;
    Ok(serde_json::to_value(found.psnr)?)
}

/// Returns the properties that a file lacks, one phrase each.
fn lost_lines(lost: &Lost) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some([from, to]) = lost.sh_degree {
        lines.push(format!("SH of degree {} to {from}", to + 1));
    }
    if !lost.extras.is_empty() {
        let names: Vec<_> = lost.extras.iter().map(|name| format::escape(name)).collect();
        lines.push(format!("extra properties {}", names.join(", ")));
    }
    if lost.normals {
        lines.push("normals".to_owned());
    }
    if let Some(offset) = lost.offset {
        lines.push(format!("the offset {offset}: positions are relative to it"));
    }
    if lost.antialiased {
        lines.push("the mark that the scene was trained with anti-aliasing".to_owned());
    }
    if !lost.precision.is_empty() {
        lines.push(format!("precision: {}", lost.precision.join(", ")));
    }
    if lost.limited > 0 {
        lines.push(format!(
            "{} values out of the format's range, now at its ends",
            format::count(lost.limited)
        ));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_extension_or_an_option_names_the_format() {
        let kind = |name: &str, asked| kind_of(Path::new(name), asked);
        assert_eq!(kind("a.SPZ", None).unwrap(), Kind::Spz);
        assert_eq!(kind("a.compressed.ply", None).unwrap(), Kind::CompressedPly);
        assert_eq!(kind("a.ply", Some(Kind::CompressedPly)).unwrap(), Kind::CompressedPly);
        assert_eq!(kind("a.glb", None).unwrap(), Kind::Gltf);
        assert!(kind("a.gltf", None).unwrap_err().to_string().contains(".glb"));
        assert!(kind("a.ksplat", None).unwrap_err().to_string().contains("not written"));
        assert!(kind("a", None).is_err());
    }
}
