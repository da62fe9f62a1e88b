//! The region of most of the opacity of a scene, and sizes of its Gaussians.

use glam::DVec3;
use lexisplat::Geometry;

/// Share of the opacity at either end of each axis that is outside of the bulk. Floaters and far backgrounds are many
/// Gaussians, but have little opacity.
pub(crate) const TRIM: f64 = 0.2;
/// Radius of the bulk, in half diagonals of the trimmed box. It leaves a little space around the box.
const AIR: f64 = 1.2;
/// Smallest radius, in standard deviations of a small Gaussian, for scenes whose Gaussians are all at about one place.
const LEAST_SIGMAS: f64 = 3.0;
/// Inverse of the share of the Gaussians that are smaller than the small Gaussian.
const SMALL_SHARE: usize = 10;
/// Smallest radius, as a share of the distance of the centre from the origin: 8 units in the last place of a position.
const LEAST_SHARE: f64 = 1e-6;
/// Radius of a scene without any size, in world units.
const NO_RADIUS: f64 = 1e-3;
/// Largest absolute natural logarithm of a standard deviation. Logarithms are clamped to it, so that their sums are
/// finite.
const MAX_LOG_SCALE: f64 = 60.0;

/// Returns the centre and radius, in world units, of the region of most of the opacity. The radius is above 0.
#[must_use]
pub fn bulk(geometry: &Geometry) -> ([f64; 3], f64) {
    let (centre, half) = middle(geometry, &opacity_weights(geometry), TRIM);
    (centre.to_array(), (half.length() * AIR).max(least_radius(geometry, centre)))
}

/// Returns the radius, above 0, of a scene around `centre` whose Gaussians are all at about one place.
pub(crate) fn least_radius(geometry: &Geometry, centre: DVec3) -> f64 {
    let Some(size) = size_at(geometry, SMALL_SHARE) else { return NO_RADIUS };
    (LEAST_SIGMAS * size).max(LEAST_SHARE * centre.length())
}

/// Returns the standard deviation along the longest axis, in world units, of the Gaussian at the `1 / share` quantile of
/// sizes. Returns `None` if no size is finite. `share` must be 2 or more.
pub(crate) fn size_at(geometry: &Geometry, share: usize) -> Option<f64> {
    let largest = |scales: &[f32; 3]| scales.iter().fold(f32::NEG_INFINITY, |a, &b| a.max(b));
    let mut sizes: Vec<f32> = geometry.scales.iter().map(largest).filter(|size| size.is_finite()).collect();
    if sizes.is_empty() {
        return None;
    }
    let rank = sizes.len() / share;
    let size = f64::from(*sizes.select_nth_unstable_by(rank, f32::total_cmp).1);
    Some(libm::exp(size.clamp(-MAX_LOG_SCALE, MAX_LOG_SCALE)))
}

/// Returns the opacities after the sigmoid.
pub(crate) fn opacity_weights(geometry: &Geometry) -> Vec<f64> {
    geometry.opacities.iter().map(|&o| 1.0 / (1.0 + libm::exp(f64::from(-o)))).collect()
}

/// Returns the weighted median of the positions, and half the extent along each axis. The share `trim` of the weight at
/// either end is excluded from the extent.
pub(crate) fn middle(geometry: &Geometry, weights: &[f64], trim: f64) -> (DVec3, DVec3) {
    let spans: [[f64; 3]; 3] = std::array::from_fn(|axis| {
        let values = geometry.positions.iter().map(|p| f64::from(p[axis]));
        quantiles(values.zip(weights.iter().copied()), [trim, 0.5, 1.0 - trim])
    });
    let centre = DVec3::from_array(spans.map(|[_, median, _]| median));
    (centre, DVec3::from_array(spans.map(|[low, _, high]| (high - low) / 2.0)))
}

/// Returns the values below which the given shares of the weight lie; 0 if there are no values. Pairs of a value and a
/// weight that are not finite do not count.
fn quantiles<const N: usize>(values: impl Iterator<Item = (f64, f64)>, shares: [f64; N]) -> [f64; N] {
    let mut sorted: Vec<(f64, f64)> = values.filter(|(v, w)| v.is_finite() && w.is_finite()).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = sorted.iter().map(|(_, w)| w).sum();
    shares.map(|share| {
        let mut sum = 0.0;
        let found = sorted.iter().find(|(_, weight)| {
            sum += weight;
            sum >= share * total
        });
        found.or(sorted.last()).map_or(0.0, |(value, _)| *value)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_weigh() {
        let pairs = [(3.0, 1.0), (1.0, 1.0), (2.0, 2.0), (f64::NAN, 9.0)];
        assert_eq!(quantiles(pairs.into_iter(), [0.0, 0.25, 0.5, 0.75, 1.0]), [1.0, 1.0, 2.0, 2.0, 3.0]);
    }
}
