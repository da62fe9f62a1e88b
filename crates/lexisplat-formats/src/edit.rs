//! Changes of a whole scene: a lower SH degree, crops, scaling, rotation and translation.

use lexisplat::{Error, Offset, Result, ShDegree, Splats};

use crate::quaternion::{product, quaternion, turned};
use crate::turn_sh::ShRotation;

/// Changes of a scene, which are made in the order of the fields. Coordinates are along the axes of a trainer's PLY, in
/// the world of the scene's file: the scene's offset is part of a position.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct Edits {
    /// Highest SH degree to keep. SH of higher degrees are cut off.
    pub degree: Option<ShDegree>,
    /// Corners of a box, the lower corner first. Gaussians whose centres are outside are removed.
    pub crop_box: Option<[[f64; 3]; 2]>,
    /// Centre and radius of a sphere. Gaussians whose centres are outside are removed.
    pub crop_sphere: Option<([f64; 3], f64)>,
    /// Factor on positions and scales, above 0.
    pub scale: Option<f64>,
    /// Angles of rotations about the axes x, then y, then z, through the origin, in degrees.
    pub rotate: Option<[f64; 3]>,
    /// Vector that is added to positions, in double precision ([`Splats::translate`]).
    pub translate: Option<[f64; 3]>,
}

impl Edits {
    /// Makes the changes.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a scale that is not above 0, for values that are not finite, for changes that make a
    /// position not finite, and for a box or sphere that leaves no Gaussian.
    pub fn apply(&self, splats: &mut Splats) -> Result<()> {
        self.check()?;
        if let Some(degree) = self.degree.filter(|degree| *degree < splats.degree) {
            *splats = splats.with_degree_cut(degree);
        }
        if self.crop_box.is_some() || self.crop_sphere.is_some() {
            let offset = splats.meta.offset;
            let keep: Vec<bool> = splats.geometry.positions.iter().map(|p| self.keeps(*p, offset)).collect();
            splats.retain(&keep);
            if splats.is_empty() {
                let expected = "a box or sphere in which a Gaussian's centre is; this one leaves none";
                return Err(Error::parameter("crop", self.crops(), expected));
            }
        }
        let offset = |splats: &Splats| Offset::numbers(splats.meta.offset);
        if self.scale.is_some() || self.rotate.is_some() {
            splats.meta.view = None;
        }
        if let Some(scale) = self.scale {
            splats.meta.offset = Offset::new(offset(splats).map(|v| v * scale))?;
            scale_by(splats, scale);
        }
        if let Some(angles) = self.rotate {
            let q = quaternion(angles);
            splats.meta.offset = Offset::new(turned(q, offset(splats)))?;
            rotate_by(splats, q);
        }
        if let Some(by) = self.translate {
            splats.translate(by)?;
        }
        match splats.geometry.positions.as_flattened().iter().find(|v| !v.is_finite()) {
            Some(value) => Err(Error::parameter("changes", value, "finite positions after all changes")),
            None => Ok(()),
        }
    }

    fn check(&self) -> Result<()> {
        if let Some(scale) = self.scale.filter(|scale| !(scale.is_finite() && *scale > 0.0)) {
            return Err(Error::parameter("scale", scale, "a number above 0"));
        }
        let finite = |name, values: Option<[f64; 3]>| match values {
            Some(v) if v.iter().any(|v| !v.is_finite()) => {
                Err(Error::parameter(name, format!("{v:?}"), "three finite numbers"))
            }
            _ => Ok(()),
        };
        finite("rotate", self.rotate)?;
        finite("translate", self.translate)
    }

    /// Returns the box and the sphere as text, for messages.
    fn crops(&self) -> String {
        let crop_box = self.crop_box.map(|corners| format!("box {corners:?}"));
        let sphere = self.crop_sphere.map(|(centre, radius)| format!("sphere {centre:?} of radius {radius}"));
        crop_box.into_iter().chain(sphere).collect::<Vec<_>>().join(" and ")
    }

    /// Returns whether a Gaussian at `position`, relative to `offset`, is inside the box and the sphere.
    fn keeps(&self, position: [f32; 3], offset: Option<Offset>) -> bool {
        let numbers = Offset::numbers(offset);
        let position = [0, 1, 2].map(|k| f64::from(position[k]) + numbers[k]);
        // Without an offset, a limit such as 0.1 is rounded to single precision, as positions are.
        let rounded = |v: f64| if offset.is_some() { v } else { f64::from(single(v)) };
        let in_box = |[low, high]: [[f64; 3]; 2]| {
            (0..3).all(|k| (rounded(low[k])..=rounded(high[k])).contains(&position[k]))
        };
        let in_sphere = |(centre, radius): ([f64; 3], f64)| {
            let squares = (0..3).map(|k| (position[k] - rounded(centre[k])).powi(2));
            squares.sum::<f64>() <= rounded(radius).powi(2)
        };
        self.crop_box.is_none_or(in_box) && self.crop_sphere.is_none_or(in_sphere)
    }
}

#[expect(clippy::cast_possible_truncation, reason = "scenes are in single precision")]
fn single(x: f64) -> f32 {
    x as f32
}

fn scale_by(splats: &mut Splats, scale: f64) {
    let more = single(libm::log(scale));
    let geometry = &mut splats.geometry;
    geometry.positions.as_flattened_mut().iter_mut().for_each(|v| *v = single(f64::from(*v) * scale));
    geometry.scales.as_flattened_mut().iter_mut().for_each(|v| *v += more);
}

/// Rotates a scene about the origin by the quaternion `q`, of length 1.
pub(crate) fn rotate_by(splats: &mut Splats, q: [f64; 4]) {
    let geometry = &mut splats.geometry;
    for v in geometry.positions.iter_mut().chain(&mut geometry.normals) {
        *v = turned(q, v.map(f64::from)).map(single);
    }
    for rotation in &mut geometry.rotations {
        *rotation = product(q, rotation.map(f64::from)).map(single);
    }
    let (degree, rest) = (splats.degree, splats.degree.rest());
    if rest > 0 {
        let turn = ShRotation::new(q);
        splats.sh_rest.chunks_exact_mut(rest).for_each(|row| turn.apply(degree, row));
    }
}

#[cfg(test)]
mod tests {
    use lexisplat::sh::rest_basis;
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    fn sample() -> Splats {
        scene(&SampleOptions::new(200, 3))
    }

    #[test]
    fn positions_are_cut_scaled_turned_and_moved_in_this_order() {
        let mut splats = sample();
        splats.geometry.positions[7] = [1.0, 2.0, 3.0];
        splats.geometry.positions[8] = [1.0, 2.0, 3.5];
        let scales = splats.geometry.scales[7];
        let edits = Edits {
            crop_box: Some([[0.9, 1.9, 2.9], [1.1, 2.1, 3.1]]),
            crop_sphere: Some(([1.0, 2.0, 3.0], 0.2)),
            scale: Some(2.0),
            // A quarter about x takes y to z and z to -y, one about z takes x to y and y to -x.
            rotate: Some([90.0, 0.0, 90.0]),
            translate: Some([10.0, 0.0, 0.0]),
            ..Edits::default()
        };
        edits.apply(&mut splats).unwrap();
        assert_eq!(splats.len(), 1);
        let expected = [16.0, 2.0, 4.0];
        assert!((0..3).all(|k| (splats.geometry.positions[0][k] - expected[k]).abs() < 1e-5));
        assert!((splats.geometry.scales[0][0] - scales[0] - 2.0_f32.ln()).abs() < 1e-6);
    }

    /// The colour of a turned scene in a turned direction is the colour of the scene in that direction.
    #[test]
    fn turned_scenes_look_the_same_from_turned_directions() {
        let plain = sample();
        let mut splats = plain.clone();
        let edits = Edits { rotate: Some([30.0, -50.0, 110.0]), ..Edits::default() };
        edits.apply(&mut splats).unwrap();
        let q = quaternion([30.0, -50.0, 110.0]);
        let direction = [0.36, 0.48, 0.8];
        let seen = turned(q, direction).map(single);
        let [before, after] =
            [direction.map(single), seen].map(|direction| rest_basis(plain.degree, direction));
        let per = plain.degree.rest_per_channel();
        let colour = |splats: &Splats, i: usize, basis: &[f32], c: usize| -> f32 {
            splats.rest(i)[c * per..(c + 1) * per].iter().zip(basis).map(|(a, b)| a * b).sum()
        };
        for i in 0..plain.len() {
            for c in 0..3 {
                assert!((colour(&plain, i, &before, c) - colour(&splats, i, &after, c)).abs() < 1e-5);
            }
            // The axes of the ellipsoid turn too: that of x, and both have the same sign.
            let axis = |q: [f32; 4]| {
                let length = q.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
                turned(q.map(|v| f64::from(v) / length), [1.0, 0.0, 0.0])
            };
            let expected = turned(q, axis(plain.geometry.rotations[i]));
            let found = axis(splats.geometry.rotations[i]);
            assert!((0..3).all(|k| (expected[k] - found[k]).abs() < 1e-5));
        }
    }

    /// A change of a scene with an offset is the same change of the positions in the world.
    #[test]
    fn the_offset_counts() {
        let near = sample();
        let mut far = near.clone();
        far.meta.offset = Offset::new([5e5, 4_649_776.0, -40.0]).unwrap();
        let centre = near.geometry.positions[7].map(f64::from);
        let centre = [centre[0] + 5e5, centre[1] + 4_649_776.0, centre[2] - 40.0];
        let mut cut = far.clone();
        let crop = Edits { crop_sphere: Some((centre, 1e-4)), ..Edits::default() };
        crop.apply(&mut cut).unwrap();
        assert_eq!(cut.geometry.positions, [near.geometry.positions[7]]);
        let mut back = far.clone();
        let edits = Edits { translate: Some([-5e5, -4_649_776.0, 40.0]), ..Edits::default() };
        edits.apply(&mut back).unwrap();
        assert_eq!(back, near);
        let mut turned = far;
        let edits = Edits { scale: Some(2.0), rotate: Some([0.0, 0.0, 90.0]), ..Edits::default() };
        edits.apply(&mut turned).unwrap();
        let found = Offset::numbers(turned.meta.offset);
        let expected = [-2.0 * 4_649_776.0, 1e6, -80.0];
        assert!((0..3).all(|k| (found[k] - expected[k]).abs() < 1e-6), "{found:?}");
    }

    #[test]
    fn what_cannot_be_meant_is_refused() {
        for edits in [
            Edits { scale: Some(0.0), ..Edits::default() },
            Edits { scale: Some(f64::NAN), ..Edits::default() },
            Edits { translate: Some([f64::INFINITY, 0.0, 0.0]), ..Edits::default() },
            Edits { translate: Some([1e300, 0.0, 0.0]), ..Edits::default() },
            Edits { crop_sphere: Some(([1e6; 3], 1.0)), ..Edits::default() },
        ] {
            assert!(edits.apply(&mut sample()).is_err(), "{edits:?}");
        }
    }

    #[test]
    fn degrees_are_cut_and_never_raised() {
        let mut splats = sample();
        Edits { degree: Some(ShDegree::ONE), ..Edits::default() }.apply(&mut splats).unwrap();
        assert_eq!((splats.degree, splats.sh_rest.len()), (ShDegree::ONE, 9 * splats.len()));
        Edits { degree: Some(ShDegree::THREE), ..Edits::default() }.apply(&mut splats).unwrap();
        assert_eq!(splats.degree, ShDegree::ONE);
    }
}
