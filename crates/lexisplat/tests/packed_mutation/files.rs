//! Small packed files of every kind.

use lexisplat::lexi::LexiWriter;
use lexisplat::packed::{PackOptions, Packer, ReachedRecord, TargetRecord};
use lexisplat::{Extra, ExtraValues, Sensitivity, ShDegree, Silent, Splats};
use lexisplat_sample::{SampleOptions, scene};

use crate::common;

fn packed(splats: &Splats, step: f64, change: fn(&mut PackOptions), target: Option<TargetRecord>) -> Vec<u8> {
    let mut options = PackOptions::default();
    change(&mut options);
    let sensitivity = Sensitivity::guess(&splats.geometry);
    let packer = Packer::new(splats, &sensitivity, &options).unwrap();
    let (packed, _) = packer.pack(step, &Silent).unwrap();
    let mut bytes = Vec::new();
    let reached = target.is_some().then(|| ReachedRecord::new([28.5, 31.5, 25.0], 18, false));
    let packed = packed.with_target(target).with_reached(reached);
    LexiWriter::packed(&packed).write(&mut bytes, &Silent).unwrap();
    bytes
}

/// Of 60 Gaussians or fewer, by name.
pub(crate) fn files() -> Vec<(&'static str, Vec<u8>)> {
    let mut rich = scene(&SampleOptions::new(60, 1)).with_degree_cut(ShDegree::ONE);
    rich.geometry.extras =
        vec![Extra { name: "label".to_owned(), values: ExtraValues::U8((0..60).collect()) }];
    rich.sh_rest[90..99].fill(1e6);
    let target = TargetRecord::new("size", 3000.0, [31.5, 25.0], 18, false);
    let change = |o: &mut PackOptions| {
        o.tolerance = Some(0.05);
        o.keep_order = true;
    };
    let plain = scene(&SampleOptions::new(60, 2));
    let flat = plain.with_degree_cut(ShDegree::ZERO);
    let one = scene(&SampleOptions::new(1, 4)).with_degree_cut(ShDegree::ZERO);
    vec![
        ("rich", packed(&rich, 1e-4, change, Some(target))),
        ("plain", packed(&plain, 1e-4, |_| (), None)),
        ("flat", packed(&flat, 1e-3, |_| (), None)),
        // Where one wrong value does not make all that follow it garbage, which would be refused anyway.
        ("pair", packed(&scene(&SampleOptions::new(2, 3)), 1e-3, |_| (), None)),
        ("one", packed(&one, 1e-3, |_| (), None)),
    ]
}

/// Of two layers.
pub(crate) fn layered() -> Vec<u8> {
    let mut splats = scene(&SampleOptions::new(8200, 5)).with_degree_cut(ShDegree::ONE);
    splats.sh_rest[90..99].fill(1e6);
    packed(&splats, 1e-4, |o| o.atoms = Some(8), None)
}

/// One Gaussian again and again, with a row that is stored exactly. The pursuit of its code over few atoms is short.
pub(crate) fn rows(count: usize) -> Vec<u8> {
    let degree = ShDegree::new(4).unwrap();
    let splats = Splats { degree, sh_rest: vec![1e6; count * degree.rest()], ..common::copies(count) };
    packed(&splats, 1e300, |o| o.atoms = Some(8), None)
}

/// One Gaussian again and again.
pub(crate) fn copies(count: usize) -> Vec<u8> {
    packed(&common::copies(count), 1e300, |_| (), None)
}
