//! Scenes, and everything the program does to one: file, look over, compress, pack, draw and compare.

use std::sync::OnceLock;

use lexisplat::lexi::LexiWriter;
use lexisplat::packed::{PackOptions, Packer};
use lexisplat::stats::{Lint, lint};
use lexisplat::{
    CompressOptions, Geometry, Layout, Limits, Sensitivity, ShDegree, Silent, Splats, compress, lexi, ply,
};
use lexisplat_compress::DrawOptions;
use lexisplat_eval::{Scorer, compare};
use lexisplat_render::gpu::Gpu;
use lexisplat_render::{Camera, Device, RenderOptions, Renderer, Scene, orbit, sensitivity};
use lexisplat_sample::{SampleOptions, scene};
use lexisplat_testing::{Need, missing};

/// Quality that packing aims at, in dB.
const PACKED_DB: f64 = 50.0;
/// Least PSNR of a GPU's picture against the processor's, in dB: what an 8-bit picture cannot show.
const TWIN_DB: f64 = 60.0;
/// The tolerance of exact layouts.
const TOLERANCE: f64 = 0.1;

/// The sample scene with SH of any degree.
pub(crate) fn sample(gaussians: usize, degree: u8) -> Splats {
    let degree = ShDegree::new(degree).unwrap();
    let splats = scene(&SampleOptions::new(gaussians, 5));
    if degree <= splats.degree {
        return splats.with_degree_cut(degree);
    }
    // The scene ends at degree 3; what follows only has to be there and vary.
    let (from, to) = (splats.degree.rest_per_channel(), degree.rest_per_channel());
    let longer = |channel: &[f32]| channel.iter().copied().cycle().take(to).collect::<Vec<f32>>();
    let sh_rest = splats.sh_rest.chunks_exact(from).flat_map(longer).collect();
    Splats { sh_rest, degree, ..splats }
}

/// Views of the scene as it was before anything was wrong with it.
pub(crate) fn cameras() -> Vec<Camera> {
    orbit(&sample(100, 0).geometry, 2, 72, 48)
}

/// Writes `splats` to a PLY and reads it.
pub(crate) fn through_ply(splats: &Splats, drop_invalid: bool) -> lexisplat::Result<ply::PlyRead> {
    let mut bytes = Vec::new();
    ply::write(&mut bytes, splats).unwrap();
    ply::read_bytes("bad.ply", &bytes, &ply::ReadOptions::default().with_drop_invalid(drop_invalid))
}

fn renderers() -> Vec<Renderer> {
    static GPU: OnceLock<Option<Gpu>> = OnceLock::new();
    let gpu = GPU.get_or_init(|| match Device::Gpu.open_gpu() {
        Ok(gpu) => gpu,
        Err(error) => {
            missing(Need::Gpu, &format!("only the processor draws, since {error}"));
            None
        }
    });
    std::iter::once(Renderer::cpu()).chain(gpu.iter().map(|gpu| Renderer::on(gpu).unwrap())).collect()
}

/// The results of a scene.
pub(crate) struct Outcome {
    pub(crate) lint: Lint,
    /// Gaussians whose SH are stored exactly, in layout f16.
    pub(crate) escapes: u64,
    /// Least PSNR over all views and devices against the original; `None` if all pictures are identical. Of the
    /// exact layout f16, and of the packed scene.
    pub(crate) exact_db: Option<f64>,
    pub(crate) packed_db: Option<f64>,
    /// The packed scene, in the order of the source; `None` if packing refused values as too large.
    pub(crate) packed: Option<Splats>,
    /// Pixels of the original that are not background, in all views.
    pub(crate) drawn: usize,
}

/// Does everything to `splats`, which a PLY can hold.
pub(crate) fn everything(splats: &Splats) -> Outcome {
    let read = through_ply(splats, false).unwrap();
    assert_eq!(&read.splats, splats, "a PLY gives back what was written");
    let found = lint(splats).unwrap();
    assert_eq!(found.gaussians, splats.len() as u64);
    assert!(found.attributes.iter().all(|a| a.min.is_finite() && a.max.is_finite() && a.mean.is_finite()));

    let [exact, escapes] = exact(splats);
    let guessed = packed(splats, &Sensitivity::guess(&splats.geometry));
    let seen = sensitivity(&Scene::from(splats), &cameras(), &Silent).unwrap();
    let packed = packed(splats, &seen);
    assert_eq!(guessed.is_some(), packed.is_some());

    let (exact_db, packed_db, drawn) = pictures(splats, &exact.0, packed.as_ref());
    Outcome { lint: found, escapes: escapes.1, exact_db, packed_db, packed, drawn }
}

/// The scene from layout f16, and its escapes; every layout keeps what it promises.
fn exact(splats: &Splats) -> [(Splats, u64); 2] {
    let mut kept = Vec::new();
    for layout in [Layout::F32, Layout::Paper, Layout::F16] {
        let mut options = CompressOptions::default();
        options.values = layout.values();
        let (model, report) = compress(splats.clone(), &options, &Silent).unwrap();
        let mut bytes = Vec::new();
        LexiWriter::exact(&model, layout.codes()).unwrap().write(&mut bytes, &Silent).unwrap();
        let read = lexi::read_bytes("exact.lexi", &bytes, &Limits::default()).unwrap();
        assert_eq!(read, model, "{layout}");
        let decoded = read.into_splats();
        assert_eq!(decoded.geometry, splats.geometry, "{layout}");
        let dim = splats.degree.rest().max(1);
        for (a, b) in splats.sh_rest.chunks(dim).zip(decoded.sh_rest.chunks(dim)) {
            let squares = a.iter().zip(b).map(|(x, y)| (f64::from(*x) - f64::from(*y)).powi(2));
            assert!(squares.sum::<f64>().sqrt() <= TOLERANCE, "{layout}");
        }
        kept.push((decoded, report.escapes));
    }
    [kept.pop().unwrap(), kept.pop().unwrap()]
}

fn packed(splats: &Splats, sensitivity: &Sensitivity) -> Option<Splats> {
    let mut options = PackOptions::default();
    options.keep_order = true;
    let packer = Packer::new(splats, sensitivity, &options).unwrap();
    let packed = match packer.pack(packer.step_for(PACKED_DB), &Silent) {
        Ok((packed, _)) => packed,
        Err(error) => {
            assert!(error.to_string().starts_with("values = too large"), "{error}");
            return None;
        }
    };
    let mut bytes = Vec::new();
    LexiWriter::packed(&packed).write(&mut bytes, &Silent).unwrap();
    let back = lexi::read_bytes("packed.lexi", &bytes, &Limits::default()).unwrap().into_splats();
    assert_eq!(back.len(), splats.len());
    assert_finite(&back);
    Some(back)
}

/// Least PSNR of either against `original`, and pixels of the original that are not background.
fn pictures(original: &Splats, exact: &Splats, packed: Option<&Splats>) -> (Option<f64>, Option<f64>, usize) {
    let least = |a: Option<f64>, b: Option<f64>| a.into_iter().chain(b).reduce(f64::min);
    let (mut exact_db, mut packed_db, mut drawn) = (None, None, 0);
    for mut renderer in renderers() {
        for (other, db) in [(Some(exact), &mut exact_db), (packed, &mut packed_db)] {
            let Some(other) = other else { continue };
            let on_view = |_: &_, a: &lexisplat_render::Image, b: &lexisplat_render::Image| {
                assert!(a.pixels.iter().chain(&b.pixels).flatten().all(|v| v.is_finite() && *v >= 0.0));
                Ok::<_, lexisplat_compress::Error>(())
            };
            let (a, b) = (Scene::from(original), Scene::from(other));
            let options = DrawOptions::default();
            let found = compare(&mut renderer, &a, &b, &cameras(), &options, &Silent, on_view).unwrap();
            *db = least(*db, found.psnr.min);
        }
        let prepared = renderer.prepare(Scene::from(original)).unwrap();
        for camera in cameras() {
            let options = RenderOptions::default();
            let image = renderer.render(&prepared, &camera, &options).unwrap();
            let truth = lexisplat_render::render(&Scene::from(original), &camera, &options).unwrap();
            let view = Scorer::new().score("twin", &truth, &image).unwrap();
            assert!(view.psnr.is_none_or(|db| db > TWIN_DB), "{} draws {:?}", renderer.name(), view.psnr);
            drawn += image.pixels.iter().filter(|p| **p != options.background).count();
        }
    }
    (exact_db, packed_db, drawn)
}

fn assert_finite(splats: &Splats) {
    let g = &splats.geometry;
    let arrays = [
        g.positions.as_flattened(),
        g.dc.as_flattened(),
        &g.opacities,
        g.scales.as_flattened(),
        g.rotations.as_flattened(),
        &splats.sh_rest,
    ];
    assert!(arrays.iter().all(|values| values.iter().all(|v| v.is_finite())));
}

/// One Gaussian again and again.
pub(crate) fn copies(splats: &Splats, count: usize) -> Splats {
    let g = &splats.geometry;
    let geometry = Geometry {
        positions: vec![g.positions[0]; count],
        dc: vec![g.dc[0]; count],
        opacities: vec![g.opacities[0]; count],
        scales: vec![g.scales[0]; count],
        rotations: vec![g.rotations[0]; count],
        ..Geometry::default()
    };
    Splats {
        geometry,
        degree: splats.degree,
        sh_rest: splats.rest(0).repeat(count),
        meta: splats.meta.clone(),
    }
}
