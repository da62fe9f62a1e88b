//! Scenes of any finite values: compressed in every layout and packed, whole and a part at a time, drawn from every
//! kind of view and described, each with a result that keeps what it promises.
#![no_main]

use lexisplat::lexi::LexiWriter;
use lexisplat::packed::{PackOptions, Packer};
use lexisplat::ply::{PlySource, ReadOptions};
use lexisplat::stream::Observer;
use lexisplat::{
    CodeLayout, CompressOptions, Error, Layout, Pursuit, Sensitivity, ShDegree, Silent, Splats, compress,
    lexi, ply, stats, stream,
};
use lexisplat_fuzz::made::{Bytes, scene};
use lexisplat_fuzz::{invariants, limits, one_thread};
use lexisplat_render::{RenderOptions, Scene, interior_views, object, orbit, render, surround};
use libfuzzer_sys::fuzz_target;

/// Pixels of the pictures drawn: a few tiles, one of them cut.
const SIDES: (u32, u32) = (40, 24);
/// Atoms of most packed scenes: learning many takes most of the time.
const FEW_ATOMS: usize = 8;
/// Sums in another order differ by some units in the last place of f64.
const SUM_SLACK: f64 = 1e-12;

fuzz_target!(init: one_thread(), |data: &[u8]| {
    let mut bytes = Bytes(data);
    let (what, how) = (bytes.byte(), bytes.byte());
    let splats = scene(&mut bytes);
    let in_parts = what / 4 % 2 == 1;
    match what % 4 {
        0 => exact(splats, how, in_parts),
        1 => {
            let few = what / 8 % 4 != 3 && splats.degree != ShDegree::ZERO;
            packed(&splats, how, few.then_some(FEW_ATOMS), in_parts);
        }
        2 => drawn(&splats, how),
        _ => {
            let lint = stats::lint(&splats).expect("arrays fit");
            assert!(!format!("{lint:?}").is_empty());
        }
    }
});

fn exact(splats: Splats, how: u8, in_parts: bool) {
    let mut options = CompressOptions::default();
    let layout = [Layout::F32, Layout::F16, Layout::Paper][usize::from(how % 3)];
    options.values = layout.values();
    options.pursuit = if how & 4 == 0 { Pursuit::Ols } else { Pursuit::Omp };
    options.max_nonzeros = (how & 8 != 0).then_some(2);
    options.atoms = Some(usize::from(how >> 4) + 1);
    if in_parts {
        return exact_in_parts(splats, &options, layout.codes());
    }
    let original = splats.clone();
    let model = match compress(splats, &options, &Silent) {
        Ok((model, _)) => model,
        Err(Error::Parameter { .. }) => return,
        Err(error) => panic!("{error}"),
    };
    invariants::model(&model);
    invariants::exact_round_trip(&model, layout.codes());
    assert_eq!(*model.geometry(), original.geometry);
    let tolerance = options.tolerance.unwrap_or(f64::INFINITY);
    assert!(options.max_nonzeros.is_some() || model.record().max_residual <= tolerance);
    let dense = model.dense_rest();
    let dim = original.degree.rest().max(1);
    for (a, b) in original.sh_rest.chunks(dim).zip(dense.chunks(dim)) {
        let error = a.iter().zip(b).map(|(x, y)| (f64::from(*x) - f64::from(*y)).powi(2)).sum::<f64>().sqrt();
        let most = model.record().max_residual * (1.0 + SUM_SLACK);
        assert!(error <= most, "{error} is over {most}");
    }
}

fn packed(splats: &Splats, how: u8, atoms: Option<usize>, in_parts: bool) {
    let mut options = PackOptions::default();
    options.atoms = atoms;
    options.keep_order = how & 1 == 1;
    options.tolerance = (how & 2 != 0).then_some(0.1);
    let decibels = f64::from(how >> 3) * 3.0;
    if in_parts {
        return packed_in_parts(splats, &options, decibels);
    }
    let measured = how & 4 != 0;
    let sensitivity = if measured {
        let cameras = orbit(&splats.geometry, 2, SIDES.0, SIDES.1);
        lexisplat_render::sensitivity(&Scene::from(splats), &cameras, &Silent).expect("measured")
    } else {
        Sensitivity::guess(&splats.geometry)
    };
    let packer = match Packer::new(splats, &sensitivity, &options) {
        Ok(packer) => packer,
        Err(Error::Parameter { .. }) => return,
        Err(error) => panic!("{error}"),
    };
    let step = packer.step_for(decibels);
    let packed = match packer.pack(step, &Silent) {
        Ok((packed, _)) => packed,
        // Sums that f32 cannot hold.
        Err(Error::Parameter { name: "values", .. }) => return,
        Err(error) => panic!("{error}"),
    };
    let mut bytes = Vec::new();
    LexiWriter::packed(&packed).write(&mut bytes, &Silent).expect("written");
    let model = lexi::read_bytes("packed.lexi", &bytes, &limits()).expect("what was packed can be read");
    let removed = packed.head().removed;
    assert_eq!(model.len() as u64 + removed, splats.len() as u64);
    assert!(removed == 0 || measured && options.may_change(), "{removed} removed");
    invariants::model(&model);
}

fn as_ply(splats: &Splats) -> Vec<u8> {
    let mut bytes = Vec::new();
    ply::write(&mut bytes, splats).expect("written");
    bytes
}

fn exact_in_parts(splats: Splats, options: &CompressOptions, codes: CodeLayout) {
    let file = as_ply(&splats);
    let parts = PlySource::open("scene.ply", &file, &ReadOptions::default(), &Silent).expect("just written");
    let (mut streamed, mut whole) = (Vec::new(), Vec::new());
    let done = stream::compress(&parts, options, codes, &mut streamed, &Silent);
    match compress(Splats { meta: parts.meta().clone(), ..splats }, options, &Silent) {
        Ok((model, _)) => {
            let writer = LexiWriter::exact(&model, codes).expect("few nonzeros");
            writer.write(&mut whole, &Silent).expect("written");
        }
        Err(Error::Parameter { .. }) => return assert!(done.is_err(), "refused when held whole only"),
        Err(error) => panic!("{error}"),
    }
    done.expect("not refused when held whole");
    assert!(whole == streamed, "compressed in parts differs");
}

fn packed_in_parts(splats: &Splats, options: &PackOptions, decibels: f64) {
    let file = as_ply(splats);
    let parts = PlySource::open("scene.ply", &file, &ReadOptions::default(), &Silent).expect("just written");
    let mut bytes = Vec::new();
    match stream::pack(&parts, None::<&mut dyn Observer<Error>>, options, decibels, &mut bytes, &Silent) {
        Ok(done) => assert_eq!(done.file_bytes(), bytes.len() as u64),
        Err(Error::Parameter { .. }) => return,
        Err(error) => panic!("{error}"),
    }
    let model = lexi::read_bytes("parts.lexi", &bytes, &limits()).expect("what was packed can be read");
    assert_eq!(model.len(), splats.len());
    invariants::model(&model);
}

fn drawn(splats: &Splats, how: u8) {
    let geometry = &splats.geometry;
    let (width, height) = SIDES;
    let cameras = match how % 4 {
        0 => orbit(geometry, 2, width, height),
        1 => surround(geometry, 2, [width, height], [1.0, 2.0]),
        2 => interior_views(geometry, 2, width, height),
        _ => object(geometry, 2, width, height),
    };
    for camera in cameras {
        // A scene as wide as f32 has no view that shows it.
        if camera.validate().is_err() {
            continue;
        }
        let image = render(&Scene::from(splats), &camera, &RenderOptions::default()).expect("drawn");
        assert!(image.pixels.iter().flatten().all(|v| v.is_finite()), "pixels not finite");
    }
}
