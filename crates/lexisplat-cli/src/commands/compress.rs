//! `lexisplat compress`.

use std::collections::HashSet;
use std::fmt::{Display, Write as _};
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context as _, Result};
use lexisplat::packed::{LOD_FIRST_LAYER, PackOptions, Preset, ReachedRecord, TargetRecord};
use lexisplat::ply::ReadOptions;
use lexisplat::{
    CompressOptions, DEFAULT_TOLERANCE, Error, FileKind, FormatError, Joined, Layout, Limits, Record,
    SplatSource, lexi,
};
use lexisplat_compress::views::marked;
use lexisplat_compress::{
    Compression, CompressionReport, Packing, Quality, RefineReport, SensitivitySource, Target, WithView,
    overshoot, read_beside, uncertain_by,
};
use lexisplat_eval::format;
use lexisplat_formats::{Opened, open};
use lexisplat_render::{Split, ViewSet, read_views};

use crate::args::{Common, Compress};
use crate::device::open_gpu;
use crate::exit::Misuse;
use crate::files::{
    check_output, input, is_pipe, new_output, note, output_path, resolved, siblings, tell, warn, write_output,
};
use crate::progress::Bars;
use crate::stop::{self, Work};

/// Largest amount by which a preset may fall short of its aim without a warning, in dB. In docs/results/promise.md the
/// `archive` of flowers falls short by most: 2.2 dB.
const FAR_BELOW: f64 = 3.0;

pub(crate) fn run(args: &Compress, common: &Common) -> Result<()> {
    let start = Instant::now();
    let (first, others) = args.inputs.split_first().context("no input")?;
    if args.output.is_none() && !others.is_empty() {
        return Err(several(first, others).into());
    }
    let mut seen = HashSet::new();
    let mut is_new = |path: &PathBuf| seen.insert(resolved(path).unwrap_or_else(|| path.clone()));
    if let Some(twice) = args.inputs.iter().find(|path| !is_new(path)) {
        return Err(Error::parameter("INPUT", twice.display(), "each tile once").into());
    }
    let output = output_path(first, args.output.as_deref(), "lexi", common)?;
    let mut inputs: Vec<&Path> = args.inputs.iter().map(PathBuf::as_path).collect();
    inputs.extend(args.dictionary.as_deref());
    check_output(&output, &inputs, common.overwrite)?;
    if let Some(path) = &args.save_dictionary {
        inputs.push(&output);
        check_output(path, &inputs, common.overwrite)?;
    }
    stop::while_writing(match &args.save_dictionary {
        _ if is_pipe(&output) => Work::Stream,
        None => Work::Files(1),
        Some(_) => Work::Files(2),
    });
    let limits = common.limits()?;
    let mut given = args.cameras.as_ref().map(|path| read_views(path, &mut |_| None)).transpose()?;
    if let (Some(set), Some(near)) = (&mut given, args.near) {
        set.cameras.iter_mut().for_each(|camera| camera.near = near);
    }
    warn("cameras", given.as_ref().map_or(&[][..], |set| set.warnings.as_slice()));
    let mut compression = compression(args, given.as_ref(), &limits)?;

    let files = args.inputs.iter().map(|path| input(path, common)).collect::<Result<Vec<_>>>()?;
    let read = ReadOptions::default()
        .with_drop_invalid(args.drop_invalid)
        .with_drop_extras(args.drop_extras)
        .with_limits(limits);
    let bars = Bars::new(common.quiet);
    let all_bytes = files.iter().map(|(_, bytes)| bytes.len() as u64).sum();
    // Cameras are only used for a scene that is packed whole.
    let may_look = args.looks_beside() && compression.holds_whole(all_bytes, true);
    let beside = if may_look && !is_pipe(first) { read_beside(first) } else { None };
    let whole = compression.holds_whole(all_bytes, beside.is_some());
    let opened = files.iter().map(|(name, bytes)| {
        let opened = open(name, bytes, siblings(name), &read, whole, &bars)?;
        Ok(opened.releasing_pages_of(bytes))
    });
    let opened = opened.collect::<Result<Vec<_>>>()?;
    for ((name, _), opened) in files.iter().zip(&opened) {
        warn(name, opened.source().warnings());
    }
    let named = files.iter().zip(&opened);
    let tiles = named.map(|((name, _), opened)| Ok((name.clone(), source_to_compress(name, opened)?)));
    let tiles = tiles.collect::<Result<Vec<(String, &dyn SplatSource)>>>()?;
    let joined;
    let (name, source) = match tiles.as_slice() {
        [(name, tile)] => (name.clone(), *tile),
        several => {
            joined = Joined::new(several)?;
            (output.display().to_string(), &joined as &dyn SplatSource)
        }
    };
    if let (Some(set), Some(offset)) = (given, source.empty().meta.offset) {
        compression = compression.with_cameras(set.relative_to(Some(offset)).cameras);
    }
    if let Some((_, set)) = &beside {
        let set = set.clone().relative_to(source.empty().meta.offset);
        compression = compression.with_likely_cameras(set.cameras);
    }
    let viewed = args.view.map(|view| WithView::new(source, view.pose()));
    let source = viewed.as_ref().map_or(source, |viewed| viewed as &dyn SplatSource);
    let open_seconds = start.elapsed().as_secs_f64();
    let mut report = write_output(&output, common.overwrite, |sink| {
        compression.run(source, sink, &bars).map_err(|error| match error {
            lexisplat_compress::Error::Codec(error) => anyhow::Error::from(error),
            error => error.into(),
        })
    })?;
    if let (Some(path), Some(dictionary)) = (&args.save_dictionary, &report.dictionary) {
        lexi::write_dictionary(new_output(path, common.overwrite), dictionary)?;
    }
    report.read_seconds += open_seconds;
    report.total_seconds = start.elapsed().as_secs_f64();
    if let (Some((path, set)), Some(reached), false) = (&beside, &report.reached, common.quiet) {
        note(&match reached.cameras {
            true => format!(
                "note: drawn and judged by the {} cameras of {}; --no-cameras ignores them",
                marked(&set.cameras, Split::Train).len(),
                path.display()
            ),
            false => cameras_not_used(path),
        });
    }
    warn(&name, report.reached.as_ref().and_then(uncertain).as_slice());
    warn(&name, report.target.as_ref().and_then(costly).as_slice());
    if report.target.is_none() && args.max_gaussians.is_none() {
        let preset = args.preset.unwrap_or_default();
        warn(&name, report.reached.as_ref().and_then(|reached| short(reached, preset)).as_slice());
    }
    if is_pipe(&output) {
        // Standard output carries the file, so the text goes to standard error.
        if !common.quiet {
            text(&report, &output, args.all)?.lines().for_each(note);
        }
        return Ok(());
    }
    let mut json = serde_json::to_value(&report)?;
    json["output"] = output.display().to_string().into();
    tell(common, json, || text(&report, &output, args.all))
}

/// Returns the note that the cameras of `path`, which lie beside a scene, were not used.
pub(super) fn cameras_not_used(path: &Path) -> String {
    format!(
        "note: the cameras of {} do not seem to belong to the scene and were not used; --cameras uses them all the same",
        path.display()
    )
}

/// Returns the error for several inputs without an output. The last input may have been meant as the output.
fn several(first: &Path, others: &[PathBuf]) -> Misuse {
    let count = others.len() + 1;
    let last = others.last().filter(|_| others.len() == 1);
    let output = last.filter(|path| path.extension().is_some_and(|end| end == "lexi") || !path.exists());
    let help = match output {
        Some(output) => format!(
            "the output is named by -o: lexisplat compress {} -o {}",
            first.display(),
            output.with_extension("lexi").display()
        ),
        None => "name the one file that they become: -o scene.lexi. To make a file of each, run the command for each"
            .to_owned(),
    };
    Misuse { problem: format!("{count} inputs and no output: several inputs become one file"), help }
}

/// Returns the scene of `opened`, which messages call `name`. Returns an error if it is compressed already or has no
/// Gaussians.
pub(crate) fn source_to_compress<'a>(name: &str, opened: &'a Opened<'_>) -> Result<&'a dyn SplatSource> {
    match opened {
        Opened::Lexi(_) => {
            let problem = FormatError::OtherKind { found: FileKind::Lexi, expected: FileKind::Ply };
            Err(Error::format(name, problem).into())
        }
        opened => Ok(opened.some(name)?),
    }
}

/// Returns the library's choices for these options.
fn compression(args: &Compress, given: Option<&ViewSet>, limits: &Limits) -> Result<Compression> {
    let layout = args.chosen_layout()?;
    if layout != Layout::Packed {
        return Ok(Compression::Exact(exact(args, layout, limits)?, layout.codes()));
    }
    let options = PackOptions::default()
        .with_tolerance(args.tol)
        .with_atoms(args.atoms)
        .with_keep_order(args.keep_order)
        .with_lod(args.lod.then_some(LOD_FIRST_LAYER))
        .with_keep_all(args.keep_all)
        .with_seed(args.seed);
    let preset = args.preset.unwrap_or_default();
    if args.guess {
        return Ok(Compression::Guessed(preset, options));
    }
    let target = Target::chosen(args.psnr, args.min_psnr, args.size, args.ratio);
    let mut packing = Packing::new(target.map_or(Quality::Preset(preset), Quality::Target))
        .with_options(options)
        .with_gpu(open_gpu(args.device)?)
        .with_viewpoints(args.views.unwrap_or_default())
        .with_max_gaussians(args.max_gaussians)
        .with_refine(args.refine)
        .with_memory(args.memory);
    if let Some(set) = given {
        packing = packing.with_cameras(set.cameras.clone());
    }
    Ok(packing.into())
}

fn exact(args: &Compress, layout: Layout, limits: &Limits) -> Result<CompressOptions> {
    let mut options = CompressOptions::default();
    options.tolerance = args.tol.or_else(|| args.max_nonzeros.is_none().then_some(DEFAULT_TOLERANCE));
    options.max_nonzeros = args.max_nonzeros;
    options.atoms = args.atoms;
    options.pursuit = args.pursuit.unwrap_or(options.pursuit);
    options.values = layout.values();
    options.sample = args.sample.unwrap_or(options.sample);
    options.seed = args.seed;
    let read = |path| lexi::read_dictionary(path, limits);
    options.dictionary = args.dictionary.as_deref().map(read).transpose()?;
    Ok(options)
}

/// Returns three lines for people, and the details if `all` is set.
fn text(report: &CompressionReport, output: &Path, all: bool) -> Result<String> {
    let CompressionReport { gaussians, removed, .. } = report;
    let mut out = String::new();
    let count = format::count(*gaussians as u64);
    let count = match removed {
        0 => count,
        _ => format!("{count} of {}", format::count(*gaussians as u64 + removed)),
    };
    writeln!(out, "wrote {}: {count} Gaussians, SH degree {}", output.display(), report.sh_degree)?;
    let bytes = [report.file_bytes, report.source_bytes].map(format::bytes);
    let ratio = format::ratio(report.source_bytes, report.file_bytes);
    writeln!(out, "{} of {}: {ratio} smaller, in {:.1} s", bytes[0], bytes[1], report.total_seconds)?;
    let quality = match report.reached.as_ref().filter(|_| report.record.tolerance.is_none()) {
        Some(reached) => format!("pictures: {}", reached_line(reached)),
        None if report.record.tolerance.is_some() => format!("SH error: {}", error_line(&report.record)),
        None if report.sensitivity == Some(SensitivitySource::Guess) => {
            "pictures: not looked at; what shows was guessed from each Gaussian alone".to_owned()
        }
        None if report.in_parts => {
            "pictures: looked at part by part, for the scene is large; the finished file was not judged"
                .to_owned()
        }
        None => format!("SH error: {}", error_line(&report.record)),
    };
    writeln!(out, "{quality}")?;
    if all {
        writeln!(out)?;
        out.push_str(&details(report)?);
    }
    Ok(out)
}

/// Returns the bytes, bits, codes and seconds of each part of the work, as text.
fn details(report: &CompressionReport) -> Result<String> {
    let CompressionReport { gaussians, atoms, record, learn_seconds, code_seconds, .. } = report;
    let dim = report.nonzero_histogram.len().saturating_sub(1);
    let each = |bytes: f64| bytes / (*gaussians).max(1) as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "numbers to look at")]
    let whole = |number: f64| number.round() as u64;
    let mut out = String::new();
    let mut line = |label: &str, text: String| writeln!(out, "{label:<12} {text}");
    line("file bytes", format!("{:.2} a Gaussian", each(report.file_bytes as f64)))?;
    if dim > 0 {
        let (sh, dense) = (whole(report.sh_bytes), report.dense_sh_bytes);
        let ratio = format::ratio(dense, sh);
        let (sh, dense) = (format::bytes(sh), format::bytes(dense));
        line(
            "SH bytes",
            format!("{sh} of {dense}: {ratio} smaller (dictionary, codes, escapes; against dense f32)"),
        )?;
    }
    let bits: Vec<String> = report
        .attribute_bytes
        .iter()
        .map(|(name, bytes)| format!("{name} {:.1}", each(8.0 * bytes)))
        .collect();
    line("bits each", bits.join(", "))?;
    if report.removed > 0 {
        line("left out", removed_line(report.removed))?;
    }
    if let Some(RefineReport { steps, gaussians, before_psnr, after_psnr, .. }) = report.refined {
        let (steps, gaussians) = (format::count(steps as u64), format::count(gaussians as u64));
        let text = format!(
            "{gaussians} Gaussians in {steps} steps: {before_psnr:.2} to {after_psnr:.2} dB, before quantisation"
        );
        line("refined", text)?;
    }
    if let Some(reached) = &report.reached {
        line("pictures", reached_line(reached))?;
    }
    let dictionary = match (report.learn_sample, report.learn_rounds) {
        _ if dim == 0 => "none: the scene has no view-dependent colour".to_owned(),
        (Some(sample), Some(rounds)) => {
            let sample = format::count(sample as u64);
            format!("{atoms} atoms from {sample} Gaussians in {rounds} rounds, {learn_seconds:.1} s")
        }
        _ if report.layout == Layout::Packed => format!("{atoms} atoms, {learn_seconds:.1} s"),
        _ => format!("{atoms} atoms, given"),
    };
    line("dictionary", dictionary)?;
    if let Some(ratio) = report.coefficient_ratio {
        let rate = format::count(whole(*gaussians as f64 / code_seconds.max(1e-9)));
        let nonzeros = report.mean_nonzeros;
        line(
            "codes",
            format!(
                "{nonzeros:.2} of {dim} nonzeros a Gaussian: {ratio:.2}x fewer coefficients (the paper's ratio), {code_seconds:.1} s, {rate} a second"
            ),
        )?;
    }
    if report.layout != Layout::Packed || record.tolerance.is_some() {
        line("error", error_line(record))?;
        if report.escapes > 0 {
            line("escapes", format!("{} Gaussians' SH stored exactly", format::count(report.escapes)))?;
        }
    }
    if report.sensitivity == Some(SensitivitySource::Guess) {
        line("scene", "what shows was guessed from each Gaussian alone".to_owned())?;
    } else if report.in_parts {
        line("scene", "large, so it was measured and packed part by part".to_owned())?;
    }
    line(
        "seconds",
        format!(
            "{:.1}: reading {:.1}, looking {:.1}, packing {:.1}, writing {:.1}",
            report.total_seconds,
            report.read_seconds,
            report.look_seconds,
            report.pack_seconds,
            report.write_seconds
        ),
    )?;
    Ok(out)
}

/// Returns a line with the largest errors and the bound that was promised.
pub(crate) fn error_line(record: &Record) -> String {
    let found = format!("maximum {:.6}, RMS {:.6}", record.max_residual, record.rms_residual);
    match (record.tolerance, record.max_nonzeros) {
        (Some(tol), None) => format!("{found}; promised: at most {tol} for every Gaussian"),
        (Some(tol), Some(cap)) => format!(
            "{found}; {} Gaussians are over {tol}, because no more than {cap} nonzeros were allowed",
            format::count(record.over_tolerance)
        ),
        (None, _) => format!("{found}; nothing was promised"),
    }
}

/// Returns a warning if photographs may be much worse than the judged quality.
fn uncertain(reached: &ReachedRecord) -> Option<String> {
    uncertain_by(reached).map(|below| {
        format!(
            "one of the views that judged is {below:.0} dB worse than the hardest quarter of them: what photographs show is \
             not certain. Give --cameras if you have them"
        )
    })
}

/// Returns a warning if a file has far less PSNR than its preset aims at.
fn short(reached: &ReachedRecord, preset: Preset) -> Option<String> {
    let (found, aim) = (reached.judged_psnr, preset.decibels());
    (aim - found > FAR_BELOW).then(|| {
        format!(
            "pictures have about {found:.0} dB where the preset aims at {aim:.0}. --psnr {aim:.0} searches for a file that \
             has them"
        )
    })
}

/// Returns a warning if one hard view made a file large.
fn costly(target: &TargetRecord) -> Option<String> {
    overshoot(target).map(|above| {
        format!(
            "the views have {above:.0} dB more on average than the worst one, which alone decides --min-psnr. --psnr makes a \
             smaller file if the others matter more"
        )
    })
}

/// Returns a line with the PSNR that a file reaches.
fn reached_line(reached: &ReachedRecord) -> String {
    let ReachedRecord { judged_psnr, mean_psnr, min_psnr, views, cameras, .. } = reached;
    match cameras {
        true => psnr_line(*mean_psnr, *min_psnr, views, *cameras),
        false => format!(
            "about {judged_psnr:.1} dB in photographs; {min_psnr:.1} dB at worst over {views} generated views"
        ),
    }
}

/// Returns a line with the number of Gaussians of the source that a file lacks.
pub(crate) fn removed_line(removed: u64) -> String {
    format!("{} Gaussians, which show least", format::count(removed))
}

/// Returns a line with the PSNR that a file records, if it records any. A file may have `reached`, `target`, both or
/// neither.
pub(crate) fn record_line(reached: Option<&ReachedRecord>, target: Option<&TargetRecord>) -> Option<String> {
    let of_target = |target: &TargetRecord| {
        let TargetRecord { mean_psnr, min_psnr, views, cameras, .. } = target;
        psnr_line(*mean_psnr, *min_psnr, views, *cameras)
    };
    reached.map(reached_line).or_else(|| target.map(of_target))
}

/// Returns a line with the mean and the smallest PSNR over `views` views, which were `given` or else generated.
fn psnr_line(mean: f64, least: f64, views: impl Display, given: bool) -> String {
    let kind = if given { "given cameras" } else { "generated views" };
    format!("{mean:.2} dB on average, {least:.2} dB at worst, over {views} {kind}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_without_an_output_are_told_of_it() {
        let told = |others: &[&str]| {
            let others: Vec<PathBuf> = others.iter().map(PathBuf::from).collect();
            several(Path::new("a.ply"), &others)
        };
        let two = told(&["no such folder/b.ply"]);
        assert!(two.problem.starts_with("2 inputs and no output"), "{}", two.problem);
        assert!(two.help.ends_with("lexisplat compress a.ply -o no such folder/b.lexi"), "{}", two.help);
        let there = std::env::current_exe().unwrap();
        assert!(told(&[&there.display().to_string()]).help.contains("-o scene.lexi"));
        assert!(told(&["b.ply", "c.ply"]).help.contains("-o scene.lexi"));
    }

    #[test]
    fn a_preset_far_below_its_aim_is_warned_of() {
        let warning = |judged| short(&ReachedRecord::new([judged, 50.0, 20.0], 12, false), Preset::Balanced);
        assert!(warning(36.5).unwrap().contains("about 36 dB where the preset aims at 40. --psnr 40"));
        assert_eq!(warning(37.5), None);
        assert_eq!(warning(48.0), None);
    }
}
