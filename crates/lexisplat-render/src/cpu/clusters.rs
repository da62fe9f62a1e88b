//! Groups of Gaussians. A picture need not project the groups that are outside of it.

use lexisplat::Geometry;

use super::lanes::LANES;

/// A sphere around the centres of some Gaussians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sphere {
    pub(super) centre: [f32; 3],
    pub(super) radius: f32,
    /// The largest standard deviation of the Gaussians.
    pub(super) scale: f32,
}

/// The Gaussians of a scene in clusters of [`LANES`] consecutive Gaussians. If consecutive Gaussians are neighbours, as
/// in packed files, most clusters are outside of most pictures from inside a scene.
#[derive(Debug)]
pub(super) struct Clusters {
    /// One sphere for each cluster.
    spheres: Vec<Sphere>,
    /// Number of Gaussians.
    len: usize,
}

impl Clusters {
    /// Returns the clusters of `geometry`.
    pub(super) fn of(geometry: &Geometry) -> Self {
        let clusters = geometry.positions.chunks(LANES).zip(geometry.scales.chunks(LANES));
        let spheres = clusters.map(|(positions, scales)| Sphere::around(positions, scales)).collect();
        Self { spheres, len: geometry.len() }
    }

    /// Returns the number of Gaussians.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// Returns the sphere of the cluster that begins with Gaussian `first`, a multiple of [`LANES`].
    #[inline(always)]
    pub(super) fn at(&self, first: usize) -> Option<&Sphere> {
        self.spheres.get(first / LANES)
    }
}

impl Sphere {
    /// Positions that are not finite do not count, because such Gaussians are not drawn.
    fn around(positions: &[[f32; 3]], scales: &[[f32; 3]]) -> Self {
        let finite = || positions.iter().filter(|p| p.iter().all(|v| v.is_finite()));
        let (mut least, mut most) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for p in finite() {
            (0..3).for_each(|k| (least[k], most[k]) = (least[k].min(p[k]), most[k].max(p[k])));
        }
        let centre: [f32; 3] = std::array::from_fn(|k| 0.5 * least[k] + 0.5 * most[k]);
        let squared = |p: &[f32; 3]| (0..3).map(|k| (p[k] - centre[k]).powi(2)).sum::<f32>();
        let radius = finite().map(squared).fold(0.0, f32::max).sqrt();
        let scale = scales.as_flattened().iter().copied().fold(f32::NEG_INFINITY, f32::max).exp();
        Self { centre, radius, scale }
    }
}

#[cfg(test)]
mod tests {
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    #[test]
    fn spheres_hold_their_gaussians() {
        let mut geometry = scene(&SampleOptions::new(100, 1)).geometry;
        geometry.positions[3] = [f32::NAN; 3];
        geometry.positions[50][1] = f32::INFINITY;
        let clusters = Clusters::of(&geometry);
        assert_eq!((clusters.len(), clusters.spheres.len()), (100, 7));
        for (i, (p, scales)) in geometry.positions.iter().zip(&geometry.scales).enumerate() {
            let sphere = clusters.at(i / LANES * LANES).unwrap();
            let distance = (0..3).map(|k| (p[k] - sphere.centre[k]).powi(2)).sum::<f32>().sqrt();
            assert!(!distance.is_finite() || distance <= sphere.radius * 1.001 + 1e-6);
            assert!(scales.iter().all(|s| s.exp() <= sphere.scale * 1.001));
        }
        let all = Sphere::around(&geometry.positions, &geometry.scales);
        assert!(all.radius.is_finite() && all.radius > 0.0);
    }
}
