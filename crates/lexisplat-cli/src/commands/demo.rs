//! `lexisplat demo`.

use std::path::Path;
use std::time::Instant;

use anyhow::Result;
use lexisplat::packed::PackOptions;
use lexisplat::{CompressOptions, Limits, Model, Progress, Splats, lexi, ply};
use lexisplat_compress::{Compression, CompressionReport, DrawOptions, ORBIT_SIZE, Packing};
use lexisplat_eval::{Comparison, compare, format, montage};
use lexisplat_render::{Camera, Image, Renderer, Scene, orbit};
use lexisplat_sample::{SampleOptions, scene};
use lexisplat_sweep::report::{CompressedFile, Picture, Report, jpeg, page};
use serde_json::json;

use super::compress::error_line;
use super::first_view::FirstView;
use super::html;
use crate::args::{Common, Demo};
use crate::files::{
    check_free, input, make_folder, new_output, note, tell, view_name, write_bytes, write_picture,
    write_pieces,
};
use crate::page::{Page, Poster};
use crate::progress::Bars;
use crate::stop::{self, Work};

/// Number of views drawn and compared.
const VIEWS: usize = 6;
/// Files of the demo beside the pictures: the scene, the packed file, the exact file, the report, and the page with the
/// packed file in a viewer.
const FILES: [&str; 5] = ["scene.ply", "scene.lexi", "scene-exact.lexi", "report.html", "scene.html"];
/// Words for the pictures of a view in file names.
const PARTS: [&str; 3] = ["original", "compressed", "difference"];

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
    let [ply_path, packed_path, exact_path, page_path, viewer_path] = FILES.map(|name| folder.join(name));
    let bars = Bars::new(common.quiet);

    say("1. making a scene: a still life of glossy and matt things, as a trainer would leave it");
    let splats = scene(&SampleOptions::new(args.gaussians, args.seed));
    let ply_bytes = ply::write(new_output(&ply_path, common.overwrite), &splats)?;

    say("2. packing it: measuring what pictures depend on, rounding everything to that, entropy coding");
    let packing = PackOptions::default().with_seed(args.seed);
    let write = |compression: Compression, path: &Path| -> Result<(CompressionReport, Model)> {
        let report = compression.run(&splats, new_output(path, common.overwrite), &bars)?;
        Ok((report, lexi::read(path, &Limits::default())?))
    };
    let (packed_report, packed) = write(Packing::default().with_options(packing).into(), &packed_path)?;

    say("3. compressing it with exact geometry: learning a dictionary, coding, checking every error");
    let (report, exact) = write(CompressOptions::default().with_seed(args.seed).into(), &exact_path)?;

    say("4. drawing all three, the compressed ones straight from their codes, and comparing");
    let cameras = orbit(&splats.geometry, VIEWS, ORBIT_SIZE.0, ORBIT_SIZE.1);
    let mut pictures: Vec<Picture> = Vec::new();
    let packed_scores = compared(&splats, &packed, &cameras, &bars, |name, original, compressed| {
        let difference = montage::difference(original, compressed);
        let images = [original, compressed, &difference];
        for (image, part) in images.into_iter().zip(PARTS) {
            let file = views_folder.join(view_name(pictures.len(), VIEWS, &format!("{name}_{part}")));
            // The folder belongs to the demo. Its other files did not exist or may be replaced, so the pictures may be
            // replaced too.
            write_picture(&file, image, true)?;
        }
        let [original, compressed, difference] = [jpeg(original)?, jpeg(compressed)?, jpeg(&difference)?];
        pictures.push(Picture { name: name.to_owned(), original, compressed, difference });
        Ok(())
    })?;
    let exact_scores = compared(&splats, &exact, &cameras, &bars, |_, _, _| Ok(()))?;

    say("5. writing the report, and a page with a viewer and the packed scene in it");
    let page = page(&Report {
        title: "lexisplat demo",
        command: "lexisplat demo",
        ply_bytes,
        packed: CompressedFile {
            name: FILES[1],
            bytes: packed_report.file_bytes,
            attributes: &packed_report.attribute_bytes,
            comparison: &packed_scores,
        },
        exact: CompressedFile {
            name: FILES[2],
            bytes: report.file_bytes,
            attributes: &report.attribute_bytes,
            comparison: &exact_scores,
        },
        model: &exact,
        learn_seconds: report.learn_seconds,
        code_seconds: report.code_seconds,
        pictures: &pictures,
    });
    write_bytes(&page_path, page.as_bytes(), common.overwrite)?;
    write_viewer(&viewer_path, &packed_path, &packed, common)?;

    let seconds = start.elapsed().as_secs_f64();
    let file = |name: &str, bytes: u64, scores: &Comparison| json!({ "file": name, "bytes": bytes, "psnr": scores.psnr, "ssim": scores.ssim });
    let mut exact_file = file(FILES[2], report.file_bytes, &exact_scores);
    exact_file["mean_nonzeros"] = json!(report.mean_nonzeros);
    exact_file["coefficient_ratio"] = json!(report.coefficient_ratio);
    exact_file["sh_bytes"] = json!(report.sh_bytes);
    exact_file["max_residual"] = json!(exact.record().max_residual);
    exact_file["rms_residual"] = json!(exact.record().rms_residual);
    let json = json!({
        "folder": folder.display().to_string(),
        "gaussians": exact.len(),
        "ply_bytes": ply_bytes,
        "packed": file(FILES[1], packed_report.file_bytes, &packed_scores),
        "exact": exact_file,
        "total_seconds": seconds,
    });
    let line = |name: &str, bytes: u64, what: &str, scores: &Comparison| {
        format!(
            "{name:<17} {}, {} smaller, {what}: pictures {} on average, {} at worst, over {} views\n",
            format::bytes(bytes),
            format::ratio(ply_bytes, bytes),
            format::decibels(scores.psnr.mean),
            format::decibels(scores.psnr.min),
            scores.views.len(),
        )
    };
    tell(common, json, || {
        Ok(format!(
            "\n{:<17} {}, {} Gaussians\n{}{}{:<17} SH error {}\n\nOpen {} in a browser, and {} to look around ({seconds:.0} s in all).\n",
            FILES[0],
            format::bytes(ply_bytes),
            format::count(exact.len() as u64),
            line(FILES[1], packed_report.file_bytes, "packed", &packed_scores),
            line(FILES[2], report.file_bytes, "geometry exact", &exact_scores),
            "",
            error_line(exact.record()),
            page_path.display(),
            viewer_path.display(),
        ))
    })
}

/// Writes a page with a viewer and the file `packed_path`. `packed` is the decoded file.
fn write_viewer(path: &Path, packed_path: &Path, packed: &Model, common: &Common) -> Result<()> {
    let (_, bytes) = input(packed_path, common)?;
    let view = FirstView::new(&Scene::from(packed), "")?;
    let still = html::still(&view, &Scene::from(packed))?;
    let viewer = Page {
        title: "lexisplat demo",
        poster: Some(Poster { bytes: &still, kind: html::JPEG_TYPE }),
        words: &view.words,
        tools: true,
        still: false,
        scenes: vec![(FILES[1], &bytes)],
    };
    write_pieces(path, &viewer.pieces()?, common.overwrite)?;
    Ok(())
}

/// Compares `compressed` with `original`. `draw` receives the name and both pictures of each view.
fn compared(
    original: &Splats,
    compressed: &Model,
    cameras: &[Camera],
    progress: &dyn Progress,
    mut draw: impl FnMut(&str, &Image, &Image) -> Result<()>,
) -> Result<Comparison> {
    let (original, compressed) = (Scene::from(original), Scene::from(compressed));
    let (mut renderer, options) = (Renderer::cpu(), DrawOptions::default());
    compare(&mut renderer, &original, &compressed, cameras, &options, progress, |view, a, b| {
        draw(&view.name, a, b)
    })
}
