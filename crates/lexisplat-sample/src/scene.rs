//! Makes the Gaussians of the scene.

use lexisplat::sh::CHANNELS;
use lexisplat::{Geometry, SceneMeta, ShDegree, Splats};
use rayon::prelude::*;

use crate::fit::{self, Fit, REST};
use crate::light::{Studio, tone};
use crate::material::Material;
use crate::math::{ln, sin_cos_turns, tangent};
use crate::random::Random;
use crate::shapes::{self, Edge, quaternion};
use crate::still_life::{self, Thing};

/// Number of Gaussians of the default scene.
pub const DEFAULT_GAUSSIANS: usize = 60_000;
/// Standard deviation along the surface, in units of the mean distance between neighbours. Smaller values leave holes in
/// the surface, and larger values blur it.
const SPREAD: f64 = 0.60;
/// Standard deviation across the surface, in units of the standard deviation along it.
const THICKNESS: f64 = 0.12;
/// Largest stretch. One axis is multiplied by 1 plus the stretch, and the other is divided by it.
const STRETCH: f64 = 0.35;
/// Smallest distance between a Gaussian's centre and an edge of the surface or of its pattern, in standard deviations.
const REACH: f64 = 1.3;
/// Smallest axis at an edge, in units of the standard deviation elsewhere.
const MIN_SHORT: f64 = 0.2;
/// Largest random offset of centres along each axis, in units of the distance between neighbours.
const STRAY: f64 = 0.12;
/// Standard deviation of the tilt of normals, as a tangent. The tilt is there because training does not find normals
/// exactly.
const TILT: f64 = 0.03;
/// Factor on the noise of the wall. Training sees the wall from few directions and learns those well.
const WALL_NOISE: f64 = 0.5;
/// Largest relative variation of roughness between Gaussians.
const UNEVEN: f64 = 0.35;

/// Options of [`scene`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct SampleOptions {
    /// Number of Gaussians. The default is [`DEFAULT_GAUSSIANS`].
    pub gaussians: usize,
    /// Seed of all random numbers. The default is 0.
    pub seed: u64,
}

impl Default for SampleOptions {
    fn default() -> Self {
        Self { gaussians: DEFAULT_GAUSSIANS, seed: 0 }
    }
}

impl SampleOptions {
    /// Returns options for `gaussians` Gaussians with `seed`.
    #[must_use]
    pub fn new(gaussians: usize, seed: u64) -> Self {
        Self { gaussians, seed }
    }
}

/// A finished Gaussian.
struct Gaussian {
    position: [f32; 3],
    dc: [f32; CHANNELS],
    opacity: f32,
    scales: [f32; 3],
    rotation: [f32; 4],
    rest: [f32; REST],
}

/// Makes the sample scene, of SH degree 3.
#[must_use]
pub fn scene(options: &SampleOptions) -> Splats {
    let things = still_life::things();
    let studio = still_life::studio(&things);
    let fit = Fit::new();
    let counts = shares(&things, options.gaussians);
    // Index of the first Gaussian of each thing.
    let starts: Vec<usize> = (0..things.len()).map(|i| counts[..i].iter().sum()).collect();
    let make = |i: usize| {
        let which = starts.partition_point(|&start| start <= i) - 1;
        gaussian(&things[which], i - starts[which], counts[which], &studio, &fit, options.seed, i)
    };
    let gaussians: Vec<Gaussian> = (0..options.gaussians).into_par_iter().map(make).collect();
    let mut geometry = Geometry::default();
    let mut sh_rest = Vec::with_capacity(options.gaussians * REST);
    for g in gaussians {
        geometry.positions.push(g.position);
        geometry.dc.push(g.dc);
        geometry.opacities.push(g.opacity);
        geometry.scales.push(g.scales);
        geometry.rotations.push(g.rotation);
        sh_rest.extend_from_slice(&g.rest);
    }
    let comments = vec![format!("lexisplat sample scene, seed {}", options.seed)];
    Splats {
        geometry,
        degree: ShDegree::THREE,
        sh_rest,
        meta: SceneMeta { comments, ..SceneMeta::default() },
    }
}

/// Returns the number of Gaussians of each thing. The sum of the numbers is `total`.
fn shares(things: &[Thing], total: usize) -> Vec<usize> {
    let weights: Vec<f64> = things.iter().map(|t| t.shape.area() * t.density).collect();
    let sum: f64 = weights.iter().sum();
    let mut before = 0.0;
    let mut taken = 0;
    let mut counts: Vec<usize> = weights
        .iter()
        .map(|weight| {
            before += weight;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a share of a count that fits in memory"
            )]
            let end = ((before / sum * total as f64).round() as usize).clamp(taken, total);
            let count = end - taken;
            taken = end;
            count
        })
        .collect();
    if let Some(last) = counts.last_mut() {
        *last += total - taken;
    }
    counts
}

fn gaussian(
    thing: &Thing,
    index: usize,
    count: usize,
    studio: &Studio,
    fit: &Fit,
    seed: u64,
    stream: usize,
) -> Gaussian {
    let mut random = Random::new(seed, stream as u64);
    let point = thing.shape.point(index, count);
    let spacing = (thing.shape.area() / count as f64).sqrt();
    let side = point.normal.cross(point.tangent);
    let along = |a: f64, b: f64| point.tangent * a + side * b;
    let stray = along(spacing * STRAY * random.signed(), spacing * STRAY * random.signed());
    let position = point.position + stray;
    let tilt = along(TILT * random.normal(), TILT * random.normal());
    let normal = (point.normal + tilt).normalize();

    let mut surface = thing.material.at(point.local + stray, point.normal, shapes::UP);
    surface.roughness = (surface.roughness * (1.0 + UNEVEN * random.signed())).clamp(0.02, 1.0);
    let is_wall = matches!(thing.material, Material::Backdrop);
    let (dc, mut rest) = if is_wall {
        let colour = tone(Studio::wall(position.normalize()));
        fit.project(|_| colour)
    } else {
        let lit = studio.light(position, normal, surface, &mut random);
        fit.project(|direction| lit.colour(-direction))
    };
    fit::add_training_noise(&mut rest, if is_wall { WALL_NOISE } else { 1.0 }, &mut random);

    let spread = SPREAD * spacing;
    let (sin, cos) = sin_cos_turns(random.uniform());
    let mut x = along(cos, sin);
    let stretch = 1.0 + STRETCH * random.uniform();
    let (mut long, mut short) = (spread * stretch, spread / stretch);
    let edge = Edge::nearer(point.edge, thing.material.edge(point.local));
    if let Some(edge) = edge.filter(|edge| edge.distance < REACH * short) {
        // Gaussians at an edge are long along the edge and short across it, as after training.
        x = edge.along;
        long = spread * (1.0 + STRETCH);
        short = (edge.distance / REACH).max(spread * MIN_SHORT);
    }
    let x = tangent(x, normal);
    let y = normal.cross(x);
    let opacity = opacity(&mut random);
    Gaussian {
        position: single(position.to_array()),
        dc: single(dc),
        opacity: narrow(ln(opacity / (1.0 - opacity))),
        scales: single([long, short, spread * THICKNESS].map(ln)),
        rotation: single(quaternion(x, y, normal)),
        rest: single(rest),
    }
}

/// Returns an opacity. It is mostly near 1, and sometimes well below, as in trained models.
fn opacity(random: &mut Random) -> f64 {
    let u = random.uniform();
    let solid = 0.90 + 0.095 * random.uniform();
    if u < 0.12 { solid - 0.6 * random.uniform() } else { solid }
}

fn single<const N: usize>(values: [f64; N]) -> [f32; N] {
    values.map(narrow)
}

#[expect(clippy::cast_possible_truncation, reason = "scenes are f32 by design")]
fn narrow(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scene_is_complete_and_finite() {
        for gaussians in [0, 1, 17, 3000] {
            let splats = scene(&SampleOptions::new(gaussians, 3));
            splats.validate().unwrap();
            assert_eq!(splats.len(), gaussians);
            assert!(splats.sh_rest.iter().all(|v| v.is_finite()));
            let geometry = &splats.geometry;
            assert!(geometry.positions.iter().flatten().all(|v| v.is_finite()));
            assert!(geometry.scales.iter().flatten().chain(&geometry.opacities).all(|v| v.is_finite()));
            for q in &geometry.rotations {
                assert!((q.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn seed_decides_everything() {
        let make = |seed| scene(&SampleOptions::new(2000, seed));
        assert_eq!(make(1), make(1));
        assert_ne!(make(1), make(2));
        assert_eq!(make(7).meta.comments, ["lexisplat sample scene, seed 7"]);
    }

    /// Every platform and every number of threads gives the same bits.
    #[test]
    fn bits_are_frozen() {
        let make = || scene(&SampleOptions::new(2500, 0));
        let splats = make();
        let mut hash = crc32fast::Hasher::new();
        hash.update(bytemuck::cast_slice(&splats.geometry.positions));
        hash.update(bytemuck::cast_slice(&splats.geometry.dc));
        hash.update(bytemuck::cast_slice(&splats.geometry.opacities));
        hash.update(bytemuck::cast_slice(&splats.geometry.scales));
        hash.update(bytemuck::cast_slice(&splats.geometry.rotations));
        hash.update(bytemuck::cast_slice(&splats.sh_rest));
        assert_eq!(hash.finalize(), 807_196_572, "on purpose? then freeze the new value");
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(make), splats);
        }
    }

    /// Real models: 0.43 (bonsai) and 0.50 (leica).
    #[test]
    fn sh_norms_are_those_of_trained_models() {
        let splats = scene(&SampleOptions::new(4000, 0));
        let norms = splats.sh_rest.chunks_exact(REST).map(|r| r.iter().map(|v| v * v).sum::<f32>().sqrt());
        let mean = norms.sum::<f32>() / 4000.0;
        assert!((0.38..0.52).contains(&mean), "{mean}");
    }
}
