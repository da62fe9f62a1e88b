//! A scene for unit tests.

use crate::scene::sh::ShDegree;
use crate::scene::splats::{Geometry, SceneMeta, Splats};
use crate::support::rng::SplitMix64;

/// Number of values of a Gaussian without SH-rest.
const VALUES: usize = 14;
/// Number of directions in which SH-rest vectors lie, so that a dictionary has directions to find.
const DIRECTIONS: usize = 12;
/// Number of different random values.
const FINE: usize = 1 << 20;

/// Returns `gaussians` Gaussians of SH degree 3 in a cube of side 2. The same `seed` gives the same scene.
#[expect(clippy::cast_possible_truncation, reason = "test values are f32")]
pub(crate) fn scene(gaussians: usize, seed: u64) -> Splats {
    let mut random = SplitMix64::new(seed);
    let mut signed = || (random.below(FINE) as f64 / FINE as f64 * 2.0 - 1.0) as f32;
    let dim = ShDegree::THREE.rest();
    let directions: Vec<f32> = (0..DIRECTIONS * dim).map(|_| signed()).collect();
    let mut geometry = Geometry::default();
    let mut sh_rest = Vec::with_capacity(gaussians * dim);
    for _ in 0..gaussians {
        let v: [f32; VALUES] = std::array::from_fn(|_| signed());
        geometry.positions.push([v[0], v[1], v[2]]);
        geometry.dc.push([v[3], v[4], v[5]]);
        geometry.opacities.push(3.0 * v[6]);
        geometry.scales.push([v[7] - 4.0, v[8] - 4.0, v[9] - 5.0]);
        geometry.rotations.push([v[10], v[11], v[12], v[13]]);
        let direction = (signed().abs() * DIRECTIONS as f32) as usize % DIRECTIONS;
        let length = 0.1 * signed();
        let along = &directions[direction * dim..][..dim];
        sh_rest.extend(along.iter().map(|d| length * d + 0.005 * signed()));
    }
    Splats { geometry, degree: ShDegree::THREE, sh_rest, meta: SceneMeta::default() }
}
