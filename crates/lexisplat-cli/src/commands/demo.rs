//! `lexisplat demo`.

use std::path::Path;
use std::time::Instant;

use anyhow::Result;
use lexisplat::output::Output;
use lexisplat::{CompressOptions, Progress, compress, lexi, ply};
use lexisplat_eval::{CompareOptions, ORBIT_SIZE, compare, format, montage, png};
use lexisplat_render::{Image, Renderer, Scene, orbit};
use lexisplat_sample::{SampleOptions, scene};
use lexisplat_sweep::report::{Picture, Report, html};
use serde_json::json;

use super::compress::error_line;
use crate::args::{Common, Demo};
use crate::files::{check_free, existing, make_folder, note, print, print_json, view_name, write_bytes};
use crate::progress::Bars;
use crate::stop::{self, Work};

/// Views drawn and compared.
const VIEWS: usize = 6;
/// What the demo makes beside the pictures.
const FILES: [&str; 3] = ["scene.ply", "scene.lexi", "report.html"];

/// One view as PNG files.
struct Drawn {
    name: String,
    original: Vec<u8>,
    compressed: Vec<u8>,
    difference: Vec<u8>,
}

impl Drawn {
    fn new(name: &str, original: &Image, compressed: &Image) -> Result<Self> {
        let encode = |image: &Image| png(image.width, image.height, &image.to_8bit());
        Ok(Self {
            name: name.to_owned(),
            original: encode(original)?,
            compressed: encode(compressed)?,
            difference: encode(&montage::difference(original, compressed))?,
        })
    }

    fn parts(&self) -> [(&str, &[u8]); 3] {
        [("original", &self.original), ("compressed", &self.compressed), ("difference", &self.difference)]
    }
}

pub(crate) fn run(args: &Demo, common: &Common) -> Result<()> {
    let start = Instant::now();
    let folder = &args.output;
    for name in FILES {
        check_free(&folder.join(name), &[], common.overwrite)?;
    }
    stop::while_writing(Work::Files(FILES.len() + 3 * VIEWS));
    let views_folder = folder.join("views");
    make_folder(&views_folder)?;
    let say = |text: &str| {
        if !common.quiet && !common.json {
            note(text);
        }
    };
    let [ply_path, lexi_path, report_path] = FILES.map(|name| folder.join(name));

    say("1. making a scene: a still life of glossy and matte things, as a trainer would leave it");
    let splats = scene(&SampleOptions::new(args.gaussians, args.seed));
    let ply_bytes = ply::write(Output::new(&ply_path, existing(common.overwrite)), &splats)?;

    say("2. compressing it: learning a dictionary, coding every Gaussian, checking every error");
    let bars = Bars::new(common.quiet);
    let mut options = CompressOptions::default();
    options.seed = args.seed;
    let (model, report) = compress(splats.clone(), &options, &bars)?;
    let file_bytes = lexi::write(Output::new(&lexi_path, existing(common.overwrite)), &model)?;

    say("3. drawing both, the compressed one straight from its codes, and comparing");
    let cameras = orbit(&splats.geometry, VIEWS, ORBIT_SIZE.0, ORBIT_SIZE.1);
    bars.start("drawing", "views", cameras.len() as u64);
    let mut drawn = Vec::new();
    let mut failure = None;
    let (a, b) = (Scene::from(&splats), Scene::from(&model));
    let comparison = compare(
        &mut Renderer::cpu(),
        &a,
        &b,
        &cameras,
        &CompareOptions::default(),
        &mut |view, original, compressed| {
            match Drawn::new(&view.name, original, compressed) {
                Ok(view) => drawn.push(view),
                Err(error) => failure = failure.take().or(Some(error)),
            }
            bars.advance(1);
        },
    )?;
    bars.end();
    if let Some(error) = failure {
        return Err(error);
    }
    save(&views_folder, &drawn)?;

    say("4. writing the report");
    let pictures: Vec<Picture<'_>> = drawn
        .iter()
        .map(|d| Picture {
            name: &d.name,
            original: &d.original,
            compressed: &d.compressed,
            difference: &d.difference,
        })
        .collect();
    let page = html(&Report {
        title: "lexisplat demo",
        command: "lexisplat demo",
        model: &model,
        ply_bytes,
        file_bytes,
        attributes: &lexi::attribute_bytes(&model)?,
        learn_seconds: report.learn_seconds,
        code_seconds: report.code_seconds,
        comparison: &comparison,
        pictures: &pictures,
        amplification: montage::AMPLIFICATION,
    });
    write_bytes(&report_path, page.as_bytes(), common.overwrite)?;

    let seconds = start.elapsed().as_secs_f64();
    if common.json {
        return print_json(&json!({
            "folder": folder.display().to_string(),
            "gaussians": model.len(),
            "mean_nonzeros": report.mean_nonzeros,
            "coefficient_ratio": report.coefficient_ratio(),
            "ply_bytes": ply_bytes,
            "file_bytes": file_bytes,
            "sh_bytes": lexi::sh_bytes(&model)?,
            "max_residual": model.record.max_residual,
            "rms_residual": model.record.rms_residual,
            "psnr": comparison.psnr,
            "ssim": comparison.ssim,
            "total_seconds": seconds,
        }));
    }
    if common.quiet {
        return Ok(());
    }
    let report_name = report_path.display();
    print(&format!(
        "\nscene.ply    {}, {} Gaussians\nscene.lexi   {}: {} smaller (whole file), {:.2} of 45 nonzeros a Gaussian\nerror        {}\npictures     {} on average, {} at worst, over {} views\n\nOpen {report_name} in a browser ({seconds:.0} s in all).\n",
        format::bytes(ply_bytes),
        format::count(model.len() as u64),
        format::bytes(file_bytes),
        format::ratio(ply_bytes, file_bytes),
        report.mean_nonzeros,
        error_line(&model.record),
        format::decibels(comparison.psnr.mean),
        format::decibels(comparison.psnr.min),
        comparison.views.len(),
    ))
}

/// Writes the pictures of all views, three a view.
fn save(folder: &Path, drawn: &[Drawn]) -> Result<()> {
    for (i, view) in drawn.iter().enumerate() {
        for (part, bytes) in view.parts() {
            let name = view_name(i, drawn.len(), &format!("{}_{part}", view.name));
            // Names of pictures follow from those of the files, which were free or may be replaced.
            write_bytes(&folder.join(name), bytes, true)?;
        }
    }
    Ok(())
}
