//! The finer the steps, the nearer the scene and the larger the file.

use lexisplat::Geometry;
use lexisplat::lexi::LexiWriter;

use super::support::{
    distance, options, pack, returned, root_mean_square, row_errors, sample, size, with_extras,
};

/// The covariance matrix, from the definition and in f64.
fn covariance(g: &Geometry, i: usize) -> [f64; 9] {
    let q = g.rotations[i].map(f64::from);
    let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    let [w, x, y, z] = q.map(|v| v / length);
    let rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ];
    let variances = g.scales[i].map(|s| (2.0 * f64::from(s)).exp());
    std::array::from_fn(|k| (0..3).map(|a| rows[k / 3][a] * variances[a] * rows[k % 3][a]).sum())
}

fn opacity(x: f32) -> f64 {
    1.0 / (1.0 + (-f64::from(x)).exp())
}

/// The bounds are what the form cannot say more finely, whatever the step.
#[test]
fn small_steps_converge() {
    let splats = with_extras(sample(400, 21, 3));
    // Nothing of it is clamped by design.
    let all = splats.geometry.scales.as_flattened().iter().zip(splats.geometry.opacities.iter().cycle());
    assert!(all.clone().all(|(&s, &o)| opacity(o) < 0.9999 && (-9.0..2.0).contains(&s)));
    // With few atoms no step brings rows near: a code has at most as many atoms as a row has values.
    let options = options(|o| o.atoms = Some(256));
    for step in [1e-9, 1e-10, 1e-13, 1e-300] {
        let back = returned(&splats, step, &options);
        let (a, b) = (&splats.geometry, &back.geometry);
        for i in 0..splats.len() {
            let what = format!("step {step:e}, Gaussian {i}");
            // Steps end at 2^-24 for what matters most, with a class for every factor of 2 below.
            let moved = distance(&a.positions[i], &b.positions[i]) / size(&splats, i);
            assert!(moved < 1e-5, "{what}: moved by {moved} of its size");
            let faded = (opacity(a.opacities[i]) - opacity(b.opacities[i])).abs();
            assert!(faded < 1e-5, "{what}: opacity off by {faded}");
            let coloured = distance(&a.dc[i], &b.dc[i]);
            assert!(coloured < 1e-4, "{what}: base colour off by {coloured}");
            // Axes have 15 bits a coordinate and a turn, 1e-4 radians; scales are finer than that.
            let (p, q) = (covariance(a, i), covariance(b, i));
            let off = p.iter().zip(&q).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
            assert!(off < 3e-4 * size(&splats, i).powi(2), "{what}: {p:?} {q:?}");
        }
        // Up to 45 values a row, of a size of 1 or so and each an f16, which has 11 bits.
        let worst = row_errors(&splats, &back).into_iter().fold(0.0, f64::max);
        assert!(worst < 1e-2, "step {step:e}: SH off by {worst}");
    }
}

#[test]
fn finer_steps_mean_smaller_errors_and_larger_files() {
    let splats = sample(1000, 22, 3);
    let mut last: Option<[f64; 6]> = None;
    for step in [1e-3, 1e-4, 1e-5] {
        let options = options(|o| o.keep_order = true);
        let (packed, report) = pack(&splats, step, &options);
        let back = packed.unpack().unwrap().into_splats();
        let (a, b) = (&splats.geometry, &back.geometry);
        let all = 0..splats.len();
        let now = [
            root_mean_square(
                all.clone().map(|i| distance(&a.positions[i], &b.positions[i]) / size(&splats, i)),
            ),
            root_mean_square(all.clone().map(|i| opacity(a.opacities[i]) - opacity(b.opacities[i]))),
            root_mean_square(all.clone().map(|i| distance(&a.dc[i], &b.dc[i]))),
            root_mean_square(
                all.map(|i| distance_of(&covariance(a, i), &covariance(b, i)) / size(&splats, i).powi(2)),
            ),
            root_mean_square(row_errors(&splats, &back).into_iter()),
            -(LexiWriter::packed(&packed).file_bytes() as f64),
        ];
        assert!(
            (now[4] - packed.head().record.rms_residual).abs() < 1e-4 * now[4],
            "the file says so itself"
        );
        assert!(report.escapes == 0 && report.mean_nonzeros <= 45.0);
        if let Some(last) = last {
            let falls = now.iter().zip(&last).all(|(now, last)| now < last);
            assert!(falls, "step {step:e}: {now:?} after {last:?}");
        }
        last = Some(now);
    }
    let [position, opacity, dc, shape, sh, _] = last.unwrap();
    // Near, with room for other steps to be found better.
    assert!(position < 0.03 && opacity < 0.03 && dc < 0.05 && shape < 0.1 && sh < 0.15, "{last:?}");
}

fn distance_of(a: &[f64; 9], b: &[f64; 9]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt()
}
