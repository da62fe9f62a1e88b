//! Small files that other programs made of the sample scene (data/README.md) hold it, within the quantum of their format.
//! The tests of `.ksplat` and glb are beside their readers.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use lexisplat::ply::ReadOptions;
use lexisplat::{Silent, Splats};
use lexisplat_formats::{Kind, Siblings, open};
use lexisplat_sample::{SampleOptions, scene};

/// Gaussians of the scene, and its seed.
const GAUSSIANS: usize = 60;
const SEED: u64 = 1;

/// A file, and how far its values may be from those of the scene.
struct Foreign {
    bytes: &'static [u8],
    kind: Kind,
    position: f32,
    /// Of a logarithm.
    scale: f32,
    /// Of the cosine between the axes of a Gaussian in both.
    axis: f64,
    /// Of a share of 0 to 1.
    opacity: f32,
    /// Of an SH coefficient, the base colour's and the others.
    sh: [f32; 2],
}

/// SPZ as its own library writes it: SH have 5 and 4 bits from -1 to 1.
const SPZ: Foreign = Foreign {
    bytes: include_bytes!("data/nianticlabs-v4.spz"),
    kind: Kind::Spz,
    position: 0.51 / 4096.0,
    scale: 0.51 / 16.0,
    axis: 1e-4,
    opacity: 0.51 / 255.0,
    sh: [0.51 / 255.0 / 0.15, 8.6 / 128.0],
};

const FILES: [Foreign; 5] = [
    SPZ,
    Foreign { bytes: include_bytes!("data/nianticlabs-v3.spz"), ..SPZ },
    // A fourth part near 0, which is made of the others, has the root of their error.
    Foreign { bytes: include_bytes!("data/nianticlabs-v2.spz"), axis: 0.02, ..SPZ },
    // Positions have at least 10 bits between the bounds of the scene, which are less than 20 apart.
    Foreign {
        bytes: include_bytes!("data/splat-transform.compressed.ply"),
        kind: Kind::CompressedPly,
        position: 10.0 / 1023.0,
        scale: 5.0 / 1023.0,
        sh: [0.02, 0.51 * 8.0 / 256.0],
        ..SPZ
    },
    // Each of the 60 Gaussians has values of its own in the lists of 256; its SH are those of one of 32 entries.
    Foreign {
        bytes: include_bytes!("data/splat-transform.sog"),
        kind: Kind::Sog,
        position: 1e-3,
        scale: 0.1,
        axis: 1e-3,
        // It cuts shares down to whole bytes.
        opacity: 1.01 / 255.0,
        sh: [0.1, 2.0],
    },
];

fn share(opacity: f32) -> f32 {
    1.0 / (1.0 + (-opacity).exp())
}

/// The axes of a Gaussian, as the columns of its rotation matrix.
fn axes(q: [f32; 4]) -> [[f64; 3]; 3] {
    let q = q.map(f64::from);
    let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    let [w, x, y, z] = q.map(|v| v / length);
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
        [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

fn most(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn files_of_other_programs_hold_the_scene() {
    let source = scene(&SampleOptions::new(GAUSSIANS, SEED));
    for file in FILES {
        let kind = file.kind;
        let opened = open("a", file.bytes, Siblings::NONE, &ReadOptions::default(), true, &Silent).unwrap();
        assert_eq!(opened.kind(), kind);
        let read: Splats = opened.source().whole().unwrap().into_owned();
        assert_eq!((read.len(), read.degree), (GAUSSIANS, source.degree), "{kind}");
        let (g, s) = (&read.geometry, &source.geometry);
        let mut seen = [false; GAUSSIANS];
        for i in 0..GAUSSIANS {
            // The order may be another.
            let far = |j: &usize| most(&g.positions[i], &s.positions[*j]);
            let j = (0..GAUSSIANS).min_by(|a, b| far(a).total_cmp(&far(b))).unwrap();
            assert!(!std::mem::replace(&mut seen[j], true), "{kind}: Gaussian {i}");
            assert!(far(&j) <= file.position, "{kind}: Gaussian {i} is {} away", far(&j));
            assert!(most(&g.scales[i], &s.scales[j]) <= file.scale, "{kind}: scales of {i}");
            let cosine = |(a, b): ([f64; 3], [f64; 3])| -> f64 { (0..3).map(|k| a[k] * b[k]).sum() };
            let turned = axes(g.rotations[i]).into_iter().zip(axes(s.rotations[j])).map(cosine);
            let least = turned.fold(1.0, f64::min);
            assert!(least >= 1.0 - file.axis, "{kind}: rotation of {i}: {least}");
            let [a, b] = [g.opacities[i], s.opacities[j]].map(share);
            assert!((a - b).abs() <= file.opacity, "{kind}: opacity of {i}");
            assert!(most(&g.dc[i], &s.dc[j]) <= file.sh[0], "{kind}: base colour of {i}");
            assert!(most(read.rest(i), source.rest(j)) <= file.sh[1], "{kind}: SH of {i}");
        }
    }
}
