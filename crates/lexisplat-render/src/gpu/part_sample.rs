//! Samples Gaussians of a part, for callers that need to know where a scene is.

use lexisplat::Geometry;

use super::part::ScenePart;
use super::part_layout::Section;

/// Number of values of a Gaussian in [`Section::Bodies`] and in [`Section::Shapes`].
pub(super) const BODY: usize = 4;
pub(super) const SHAPE: usize = 8;

impl ScenePart<'_> {
    /// Returns every `step`-th of the Gaussians that can be drawn, with base colours of zero. A `step` of 0 counts as 1.
    #[must_use]
    pub fn sample(&self, step: usize) -> Geometry {
        let mut sample = Geometry::default();
        let bodies = rows::<BODY>(self.section(Section::Bodies));
        let shapes = rows::<SHAPE>(self.section(Section::Shapes));
        for ([x, y, z, largest], shape) in bodies.zip(shapes).step_by(step.max(1)) {
            if largest < 0.0 {
                continue;
            }
            let [a, b, c, opacity, rotation @ ..] = shape;
            sample.positions.push([x, y, z]);
            sample.scales.push([a, b, c]);
            sample.opacities.push(opacity);
            sample.rotations.push(rotation);
            sample.dc.push([0.0; 3]);
        }
        sample
    }
}

/// Returns the rows of `N` numbers in `bytes`.
pub(super) fn rows<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = [f32; N]> {
    let number = |bytes: &[u8; 4]| f32::from_ne_bytes(*bytes);
    bytes.chunks_exact(4 * N).map(move |row| {
        let (words, _) = row.as_chunks::<4>();
        std::array::from_fn(|k| words.get(k).map_or(0.0, number))
    })
}

#[cfg(test)]
mod tests {
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;
    use crate::scene::Scene;

    #[test]
    fn a_sample_has_what_the_scene_has() {
        let mut splats = scene(&SampleOptions::new(1000, 0));
        splats.geometry.opacities[4] = -50.0;
        let part = ScenePart::new(&Scene::from(&splats)).unwrap();
        let all = part.sample(0);
        let mut expected = splats.geometry.clone();
        expected.positions.remove(4);
        assert_eq!(all.positions, expected.positions);
        let some = part.sample(7);
        assert_eq!(some.len(), 1000_usize.div_ceil(7));
        assert_eq!(some.rotations[1], splats.geometry.rotations[7]);
        assert_eq!(some.scales[1], splats.geometry.scales[7]);
        assert!(some.validate().is_ok());
    }
}
