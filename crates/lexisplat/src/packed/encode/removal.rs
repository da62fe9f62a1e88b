//! The choice of the Gaussians that a packed file leaves out.

use super::octaves::RoundedSensitivities;
use crate::packed::curve::MortonKey;
use crate::scene::sensitivity::{AppearanceSensitivity, Sensitivity};
use crate::scene::splats::Geometry;
use crate::support::maths::log_sigmoid;

/// Least worth of a Gaussian: it is left out if the mean squared error of pictures grows by less than `REMOVAL * step^2`
/// without it. `step` is the overall step, and a value of a Gaussian is coded to an error of about `step^2`. A Gaussian
/// that changes pictures by less than the errors of its values is not worth its bits. Found by trial (docs/METHOD.md).
const REMOVAL: f64 = 10.0;
/// Removal of a Gaussian changes pictures by `max(mean, WORST_SHARE / excess * worst)`. `mean` is the mean squared change of all
/// pictures, `worst` that of the picture that changes most, and `excess` the median of `worst / mean` over Gaussians. Found by
/// trial (docs/METHOD.md).
const WORST_SHARE: f32 = 0.8;
/// Natural logarithm of 1/255. A Gaussian of smaller opacity is drawn in no pixel, by a rule of 3DGS.
const NEVER_DRAWN: f32 = -5.541_264;

/// Returns the squared change of pictures if each Gaussian is left out; infinite if it must stay. The mean change is the
/// sensitivity to the logarithm of the opacity, since a pixel is linear in the opacity of each Gaussian. The picture that
/// changes most counts too; see [`WORST_SHARE`].
pub(in crate::packed) fn changes_without(
    geometry: &Geometry,
    sensitivity: &Sensitivity,
    may_change: bool,
) -> Vec<f32> {
    let share = WORST_SHARE / usual_excess(sensitivity);
    let change = |i: usize| {
        // A Gaussian that no measured view showed may show in others. `removal` is infinite where nothing was measured.
        let largest = sensitivity.removal[i];
        match may_change && largest.is_finite() {
            true if largest > 0.0 => sensitivity.opacity[i].max(share * sensitivity.removal_view[i]),
            true if log_sigmoid(geometry.opacities[i]) < NEVER_DRAWN => 0.0,
            _ => f32::INFINITY,
        }
    };
    (0..sensitivity.len()).map(change).collect()
}

/// Returns the median of `worst / mean` over the Gaussians that pictures showed; infinite if there are none. `worst` is the
/// change of the picture that changes most without a Gaussian, `mean` that of pictures on average. The fewer of the
/// pictures show a Gaussian, the larger the ratio is, so it grows with the scene.
fn usual_excess(sensitivity: &Sensitivity) -> f32 {
    let pairs = sensitivity.opacity.iter().zip(&sensitivity.removal_view);
    let mut excess: Vec<f32> =
        pairs.filter(|p| *p.0 > 0.0 && *p.1 > 0.0).map(|(mean, most)| most / mean).collect();
    if excess.is_empty() {
        return f32::INFINITY;
    }
    let middle = excess.len() / 2;
    *excess.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// Returns whether a Gaussian stays at the overall step `step`. `change` is the squared change of pictures without it.
pub(in crate::packed) fn is_worth_its_bits(change: f32, step: f64) -> bool {
    f64::from(change) >= REMOVAL * step * step
}

/// The dependence of pictures on each Gaussian as a whole.
#[derive(Debug)]
pub(in crate::packed) struct Influence {
    /// The sensitivity to the appearance of each Gaussian, rounded as for scenes in parts.
    pub(in crate::packed) sensitivities: Vec<AppearanceSensitivity>,
    /// The result of [`changes_without`] for each Gaussian.
    left_out: Vec<f32>,
}

impl Influence {
    /// Computes the influence of the Gaussians of `geometry`, in the order of `keys`. None may be left out unless
    /// `may_change`.
    pub(in crate::packed) fn new(
        geometry: &Geometry,
        sensitivity: &Sensitivity,
        keys: &[MortonKey],
        may_change: bool,
    ) -> Self {
        let left_out = changes_without(geometry, sensitivity, may_change);
        let own: Vec<_> = keys.iter().map(|g| sensitivity.appearance(g.index())).collect();
        Self {
            sensitivities: RoundedSensitivities::of(&own).iter().collect(),
            left_out: keys.iter().map(|g| left_out[g.index()]).collect(),
        }
    }

    /// Returns the indices of the Gaussians that stay at the overall step `step`. At least one stays, if there are any.
    pub(in crate::packed) fn kept(&self, step: f64) -> Vec<usize> {
        let kept: Vec<usize> =
            (0..self.left_out.len()).filter(|&i| is_worth_its_bits(self.left_out[i], step)).collect();
        match kept.is_empty() {
            true => (0..self.left_out.len().min(1)).collect(),
            false => kept,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packed::{PackOptions, Packer};
    use crate::scene::extra::{Extra, ExtraValues};
    use crate::support::testing::scene;
    use crate::{Silent, Splats};

    /// Gaussians of the scene.
    const NUMBER: u32 = 100;

    /// A scene whose Gaussians have their number as an extra property, and a measured sensitivity. Every fifth Gaussian
    /// shows in no picture.
    fn measured() -> (Splats, Sensitivity) {
        let mut splats = scene(NUMBER as usize, 2);
        let numbers = ExtraValues::U32((0..NUMBER).collect());
        splats.geometry.extras = vec![Extra { name: "number".into(), values: numbers }];
        let mut sensitivity = Sensitivity::guess(&splats.geometry);
        sensitivity.removal.fill(0.01);
        for i in (0..NUMBER as usize).step_by(5) {
            sensitivity.opacity[i] = 1e-20;
        }
        (splats, sensitivity)
    }

    /// Packs `splats` and returns the numbers of the Gaussians of the file, in rising order.
    fn numbers(splats: &Splats, sensitivity: &Sensitivity, options: &PackOptions) -> Vec<u32> {
        let packer = Packer::new(splats, sensitivity, options).unwrap();
        let (packed, _) = packer.pack(1e-7, &Silent).unwrap();
        let geometry = packed.unpack().unwrap().into_splats().geometry;
        let ExtraValues::U32(numbers) = &geometry.extras[0].values else { panic!("not u32") };
        assert_eq!(
            (packed.len(), packed.head().removed),
            (numbers.len(), u64::from(NUMBER) - numbers.len() as u64)
        );
        let mut numbers = numbers.clone();
        numbers.sort_unstable();
        numbers
    }

    #[test]
    fn what_shows_less_than_its_bits_are_worth_goes() {
        let (mut splats, mut sensitivity) = measured();
        let options = PackOptions::default();
        let rest = |step: u32| (0..NUMBER).filter(|k| k % step != 0).collect::<Vec<u32>>();
        assert_eq!(numbers(&splats, &sensitivity, &options), rest(5));
        // A Gaussian that one picture shows much more than others do stays.
        for (most, mean) in sensitivity.removal_view.iter_mut().zip(&sensitivity.opacity) {
            *most = 3.0 * mean;
        }
        sensitivity.removal_view[5] = 1e-3;
        assert!(
            numbers(&splats, &sensitivity, &options)
                .into_iter()
                .eq((0..NUMBER).filter(|k| k % 5 != 0 || *k == 5))
        );
        sensitivity.removal_view.fill(0.0);
        // A Gaussian that no view showed stays, unless its opacity is so small that no view can show it.
        for i in (0..NUMBER as usize).step_by(10) {
            sensitivity.removal[i] = 0.0;
        }
        assert!(numbers(&splats, &sensitivity, &options).into_iter().eq((0..NUMBER).filter(|k| k % 10 != 5)));
        splats.geometry.opacities.iter_mut().step_by(10).for_each(|opacity| *opacity = -5.6);
        assert_eq!(numbers(&splats, &sensitivity, &options), rest(5));
        splats.geometry.opacities.iter_mut().step_by(10).for_each(|opacity| *opacity = -5.5);
        assert!(numbers(&splats, &sensitivity, &options).into_iter().eq((0..NUMBER).filter(|k| k % 10 != 5)));
    }

    #[test]
    fn options_and_guesses_keep_all() {
        let (splats, mut sensitivity) = measured();
        for options in [
            PackOptions::default().with_keep_all(true),
            PackOptions::default().with_keep_order(true),
            PackOptions::default().with_tolerance(0.1),
        ] {
            assert_eq!(numbers(&splats, &sensitivity, &options).len(), NUMBER as usize, "{options:?}");
        }
        sensitivity.removal.fill(f32::INFINITY);
        assert_eq!(numbers(&splats, &sensitivity, &PackOptions::default()).len(), NUMBER as usize);
    }

    #[test]
    fn one_gaussian_stays() {
        let (splats, mut sensitivity) = measured();
        sensitivity.opacity.fill(0.0);
        assert_eq!(numbers(&splats, &sensitivity, &PackOptions::default()).len(), 1);
    }
}
