//! The subject of a scene without cameras, and the region of its detail.

use glam::DVec3;
use lexisplat::Geometry;

use crate::bulk::{bulk, middle};

/// Share of the detail at either end of each axis that is excluded from its radius.
const TRIM: f64 = 0.2;
/// Smallest ratio of the bulk's radius to the detail's radius at which the detail is the subject, as for an object before
/// a background. The ratio is 11 for bonsai, 7 for flowers, and 1 to 2 if there is only an object.
const BACKGROUND: f64 = 4.0;
/// Radius of the subject, in half diagonals of the detail's box. Photos of a centrepiece are taken from 3 to 6 half
/// diagonals; this radius makes it 4.
const AIR: f64 = 1.8;

/// Returns the centre and radius of the subject, in world units. The subject is the region of most of the small opaque
/// Gaussians if this region is a small part of the scene; otherwise it is the [`bulk`].
#[must_use]
pub fn subject(geometry: &Geometry) -> ([f64; 3], f64) {
    let (centre, radius) = bulk(geometry);
    let (finest, half) = detail(geometry);
    let fine = half.length();
    // A detail without extent is a single Gaussian or none.
    if fine > 0.0 && radius > BACKGROUND * fine { (finest.to_array(), fine * AIR) } else { (centre, radius) }
}

/// Returns the centre of the detail, and half its extent along each axis.
pub(crate) fn detail(geometry: &Geometry) -> (DVec3, DVec3) {
    let weights: Vec<f64> = geometry
        .opacities
        .iter()
        .zip(&geometry.scales)
        .map(|(&o, scales)| {
            let mut sorted = scales.map(f64::from);
            sorted.sort_by(f64::total_cmp);
            libm::exp((-sorted[1] - sorted[2]).clamp(-60.0, 60.0)) / (1.0 + libm::exp(f64::from(-o)))
        })
        .collect();
    middle(geometry, &weights, TRIM)
}
