//! `lexisplat demo`.

use std::path::Path;
use std::time::Instant;

use anyhow::Result;
use lexisplat::output::Output;
use lexisplat::packed::{PackOptions, Packed, Packer, Preset};
use lexisplat::{CompressOptions, Model, Progress, Splats, compress, lexi, ply};
use lexisplat_eval::{CompareOptions, Comparison, ORBIT_SIZE, Views, compare, montage, png, text};
use lexisplat_render::{Camera, Image, Renderer, Scene, orbit};
use lexisplat_sample::{SampleOptions, scene};
use lexisplat_sweep::report::{CompressedFile, Picture, Report, jpeg, page};
use serde_json::json;

use super::compress::error_line;
use super::pack::attribute_bytes;
use crate::args::{Common, Demo};
use crate::files::{check_free, existing, make_folder, note, print, print_json, view_name, write_bytes};
use crate::progress::Bars;
use crate::stop::{self, Work};

/// Views drawn and compared.
const VIEWS: usize = 6;
/// What the demo makes beside the pictures: the scene, the packed file, the exact file, the page.
const FILES: [&str; 4] = ["scene.ply", "scene.lexi", "scene-exact.lexi", "report.html"];
/// The pictures of a view.
const PARTS: [&str; 3] = ["original", "compressed", "difference"];

/// One view: the JPEG files of its pictures, in the order of [`PARTS`].
struct Drawn {
    name: String,
    jpegs: [Vec<u8>; PARTS.len()],
}

impl Drawn {
    /// Writes the pictures of a view as PNG files to `folder`.
    fn save(folder: &Path, index: usize, name: &str, original: &Image, compressed: &Image) -> Result<Self> {
        let difference = montage::difference(original, compressed);
        let mut jpegs = [const { Vec::new() }; PARTS.len()];
        for ((image, part), bytes) in
            [original, compressed, &difference].into_iter().zip(PARTS).zip(&mut jpegs)
        {
            let file = folder.join(view_name(index, VIEWS, &format!("{name}_{part}")));
            // The folder belongs to the demo, whose other files were free or may be replaced.
            write_bytes(&file, &png(image.width, image.height, &image.to_8bit())?, true)?;
            *bytes = jpeg(image)?;
        }
        Ok(Self { name: name.to_owned(), jpegs })
    }
}

pub(crate) fn run(args: &Demo, common: &Common) -> Result<()> {
    let start = Instant::now();
    let folder = &args.output;
    for name in FILES {
        check_free(&folder.join(name), &[], common.overwrite)?;
    }
    stop::while_writing(Work::Files(FILES.len() + PARTS.len() * VIEWS));
    let views_folder = folder.join("views");
    make_folder(&views_folder)?;
    let say = |text: &str| {
        if !common.quiet && !common.json {
            note(text);
        }
    };
    let [ply_path, packed_path, exact_path, page_path] = FILES.map(|name| folder.join(name));
    let bars = Bars::new(common.quiet);
    let mut renderer = Renderer::cpu();

    say("1. making a scene: a still life of glossy and matt things, as a trainer would leave it");
    let splats = scene(&SampleOptions::new(args.gaussians, args.seed));
    let ply_bytes = ply::write(Output::new(&ply_path, existing(common.overwrite)), &splats)?;

    say("2. packing it: measuring what pictures depend on, rounding everything to that, entropy coding");
    let packed = pack(&splats, args.seed, &mut renderer, &bars)?;
    let packed_bytes = lexi::write_packed(Output::new(&packed_path, existing(common.overwrite)), &packed)?;

    say("3. compressing it with exact geometry: learning a dictionary, coding, checking every error");
    let mut options = CompressOptions::default();
    options.seed = args.seed;
    let (exact, report) = compress(splats.clone(), &options, &bars)?;
    let exact_bytes = lexi::write(Output::new(&exact_path, existing(common.overwrite)), &exact)?;

    say("4. drawing all three, the compressed ones straight from their codes, and comparing");
    let cameras = orbit(&splats.geometry, VIEWS, ORBIT_SIZE.0, ORBIT_SIZE.1);
    bars.start("drawing", "views", 2 * cameras.len() as u64);
    let mut drawn: Vec<Result<Drawn>> = Vec::new();
    let packed_scores =
        compared(&mut renderer, &splats, &packed.unpack()?, &cameras, &mut |name, original, compressed| {
            drawn.push(Drawn::save(&views_folder, drawn.len(), name, original, compressed));
            bars.advance(1);
        })?;
    let drawn: Vec<Drawn> = drawn.into_iter().collect::<Result<_>>()?;
    let exact_scores = compared(&mut renderer, &splats, &exact, &cameras, &mut |_, _, _| bars.advance(1))?;
    bars.end();

    say("5. writing the report");
    let pictures: Vec<Picture<'_>> = drawn
        .iter()
        .map(|Drawn { name, jpegs: [original, compressed, difference] }| Picture {
            name,
            original,
            compressed,
            difference,
        })
        .collect();
    let packed_attributes = attribute_bytes(&lexi::packed_tensor_bytes(&packed), &packed.stream_bits()?);
    let exact_attributes: Vec<(String, f64)> =
        lexi::attribute_bytes(&exact)?.into_iter().map(|(name, bytes)| (name, bytes as f64)).collect();
    let page = page(&Report {
        title: "lexisplat demo",
        command: "lexisplat demo",
        ply_bytes,
        packed: CompressedFile {
            name: FILES[1],
            bytes: packed_bytes,
            attributes: &packed_attributes,
            comparison: &packed_scores,
        },
        exact: CompressedFile {
            name: FILES[2],
            bytes: exact_bytes,
            attributes: &exact_attributes,
            comparison: &exact_scores,
        },
        model: &exact,
        learn_seconds: report.learn_seconds,
        code_seconds: report.code_seconds,
        pictures: &pictures,
        amplification: montage::AMPLIFICATION,
    });
    write_bytes(&page_path, page.as_bytes(), common.overwrite)?;

    let seconds = start.elapsed().as_secs_f64();
    if common.json {
        let file = |name: &str, bytes: u64, scores: &Comparison| json!({ "file": name, "bytes": bytes, "psnr": scores.psnr, "ssim": scores.ssim });
        let mut exact_file = file(FILES[2], exact_bytes, &exact_scores);
        exact_file["mean_nonzeros"] = json!(report.mean_nonzeros);
        exact_file["coefficient_ratio"] = json!(report.coefficient_ratio());
        exact_file["sh_bytes"] = json!(lexi::sh_bytes(&exact)?);
        exact_file["max_residual"] = json!(exact.record.max_residual);
        exact_file["rms_residual"] = json!(exact.record.rms_residual);
        return print_json(&json!({
            "folder": folder.display().to_string(),
            "gaussians": exact.len(),
            "ply_bytes": ply_bytes,
            "packed": file(FILES[1], packed_bytes, &packed_scores),
            "exact": exact_file,
            "total_seconds": seconds,
        }));
    }
    if common.quiet {
        return Ok(());
    }
    let line = |name: &str, bytes: u64, what: &str, scores: &Comparison| {
        format!(
            "{name:<17} {}, {} smaller, {what}: pictures {} on average, {} at worst, over {} views\n",
            text::bytes(bytes),
            text::ratio(ply_bytes, bytes),
            text::decibels(scores.psnr.mean),
            text::decibels(scores.psnr.min),
            scores.views.len(),
        )
    };
    print(&format!(
        "\n{:<17} {}, {} Gaussians\n{}{}{:<17} SH error {}\n\nOpen {} in a browser ({seconds:.0} s in all).\n",
        FILES[0],
        text::bytes(ply_bytes),
        text::count(exact.len() as u64),
        line(FILES[1], packed_bytes, "packed", &packed_scores),
        line(FILES[2], exact_bytes, "geometry exact", &exact_scores),
        "",
        error_line(&exact.record),
        page_path.display(),
    ))
}

/// Packs `splats` as `lexisplat compress` does without options.
fn pack(splats: &Splats, seed: u64, renderer: &mut Renderer, bars: &Bars) -> Result<Packed> {
    let views = Views::generated(splats);
    bars.start("looking", "views", views.len() as u64);
    let sensitivity = views.sensitivity(renderer, splats, &mut || bars.advance(1))?;
    bars.end();
    let mut options = PackOptions::default();
    options.seed = seed;
    let packer = Packer::new(splats, &sensitivity, &options)?;
    Ok(packer.pack(packer.step_for(Preset::default().decibels()), bars)?.0)
}

/// Compares `compressed` with `original`. `draw` gets the name and both pictures of each view.
fn compared(
    renderer: &mut Renderer,
    original: &Splats,
    compressed: &Model,
    cameras: &[Camera],
    draw: &mut dyn FnMut(&str, &Image, &Image),
) -> Result<Comparison> {
    let (original, compressed) = (Scene::from(original), Scene::from(compressed));
    let options = CompareOptions::default();
    Ok(compare(renderer, &original, &compressed, cameras, &options, &mut |view, a, b| {
        draw(&view.name, a, b)
    })?)
}
