//! Scenes to pack, and the errors of what comes back.

use lexisplat::CompressReport;
use lexisplat::packed::{PackOptions, Packed, Packer};
use lexisplat::{Extra, ExtraValues, Geometry, Limits, Sensitivity, ShDegree, Silent, Splats, lexi};
use lexisplat_sample::{SampleOptions, scene};

/// A step whose files look like the original.
pub(crate) const STEP: f64 = 1e-5;

/// The sample scene with SH of any degree.
pub(crate) fn sample(gaussians: usize, seed: u64, degree: u8) -> Splats {
    let degree = ShDegree::new(degree).unwrap();
    let splats = scene(&SampleOptions::new(gaussians, seed));
    if degree <= splats.degree {
        return splats.with_degree_cut(degree);
    }
    // The scene ends at degree 3; what follows only has to be there and vary.
    let (from, to) = (splats.degree.rest_per_channel(), degree.rest_per_channel());
    let sh_rest = splats.sh_rest.chunks_exact(from).flat_map(|channel| {
        let more = (from..to).map(|k| 0.3 * channel[k - from] - 0.1 * channel[0]);
        channel.iter().copied().chain(more).collect::<Vec<f32>>()
    });
    Splats { sh_rest: sh_rest.collect(), degree, ..splats }
}

/// Gaussian `i`'s number as two properties no layout defines.
pub(crate) fn with_extras(mut splats: Splats) -> Splats {
    let numbers = 0..u32::try_from(splats.len()).unwrap();
    splats.geometry.extras = vec![
        Extra {
            name: "label".to_owned(),
            values: ExtraValues::U8(numbers.clone().map(|i| i.to_le_bytes()[0]).collect()),
        },
        Extra {
            name: "number".to_owned(),
            values: ExtraValues::F32(numbers.map(|i| f32::from_bits(i | 0x3f80_0000)).collect()),
        },
    ];
    splats
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
    let sh_rest = splats.rest(0).repeat(count);
    Splats { geometry, degree: splats.degree, sh_rest, meta: splats.meta.clone() }
}

pub(crate) fn options(change: impl FnOnce(&mut PackOptions)) -> PackOptions {
    let mut options = PackOptions::default();
    change(&mut options);
    options
}

pub(crate) fn pack(splats: &Splats, step: f64, options: &PackOptions) -> (Packed, CompressReport) {
    let sensitivity = Sensitivity::guess(&splats.geometry);
    Packer::new(splats, &sensitivity, options).unwrap().pack(step, &Silent).unwrap()
}

/// Packed and unpacked by way of a file, in the order of the source.
pub(crate) fn returned(splats: &Splats, step: f64, options: &PackOptions) -> Splats {
    let mut options = options.clone();
    options.keep_order = true;
    let (packed, _) = pack(splats, step, &options);
    let model = lexi::read_bytes("packed.lexi", &bytes(&packed), &Limits::default()).unwrap();
    let back = model.into_splats();
    assert_finite(&back);
    assert_eq!(back.len(), splats.len());
    back
}

pub(crate) fn bytes(packed: &Packed) -> Vec<u8> {
    let mut bytes = Vec::new();
    lexi::LexiWriter::packed(packed).write(&mut bytes, &Silent).unwrap();
    bytes
}

pub(crate) fn assert_finite(splats: &Splats) {
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

/// Distance of two rows, in f64.
pub(crate) fn distance(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (f64::from(*x) - f64::from(*y)).powi(2)).sum::<f64>().sqrt()
}

/// The SH error of every Gaussian.
pub(crate) fn row_errors(original: &Splats, back: &Splats) -> Vec<f64> {
    (0..original.len()).map(|i| distance(original.rest(i), back.rest(i))).collect()
}

/// Standard deviation along the longest axis.
pub(crate) fn size(splats: &Splats, i: usize) -> f64 {
    splats.geometry.scales[i].iter().map(|&s| f64::from(s).exp()).fold(0.0, f64::max)
}

pub(crate) fn root_mean_square(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    (values.map(|v| v * v).sum::<f64>() / count).sqrt()
}
