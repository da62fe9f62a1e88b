//! A view as numbers, which the viewer sends to the worker that draws.

#[cfg(feature = "processor")]
use lexisplat::ShDegree;
use lexisplat_render::{Camera, RenderOptions};

/// Number of numbers of a view.
const NUMBERS: usize = 23;
/// Number of an SH degree that stands for all degrees.
const ALL_DEGREES: f32 = -1.0;

/// The values on which pictures of scenes depend.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct View {
    /// The slots whose scenes are drawn.
    pub(crate) wanted: [bool; 2],
    pub(crate) camera: Camera,
    pub(crate) options: RenderOptions,
}

impl View {
    /// Returns the numbers of this view. Sides of pictures are exact, since they are far below 2^24.
    #[cfg(any(feature = "viewer", test))]
    #[expect(clippy::cast_precision_loss, reason = "sides are at most 16384")]
    pub(crate) fn to_numbers(&self) -> Vec<f32> {
        let Camera { width, height, fx, fy, position, rotation, near, .. } = &self.camera;
        let degree = self.options.max_degree.map_or(ALL_DEGREES, |degree| f32::from(degree.get()));
        let wanted = self.wanted.map(|wants| f32::from(u8::from(wants)));
        let mut numbers = vec![*width as f32, *height as f32, *fx, *fy, *near, degree];
        numbers.extend(wanted);
        numbers.extend(position);
        numbers.extend(rotation.as_flattened());
        numbers.extend(self.options.background);
        numbers.resize(NUMBERS, 0.0);
        numbers
    }

    /// Returns the view of the numbers of [`Self::to_numbers`]; `None` for another number of them or an unknown degree.
    /// Whether the camera is valid is not checked.
    #[cfg(feature = "processor")]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    pub(crate) fn from_numbers(numbers: &[f32]) -> Option<Self> {
        let &[width, height, fx, fy, near, degree, first, second, x, y, z, ref rest @ ..] = numbers else {
            return None;
        };
        let (rotation, rest) = rest.as_chunks::<3>().0.split_first_chunk::<3>()?;
        let background = *rest.first()?;
        let max_degree = match degree {
            ALL_DEGREES => None,
            _ => Some(ShDegree::new(degree as u8).ok()?),
        };
        let camera = Camera {
            name: String::new(),
            width: width as u32,
            height: height as u32,
            fx,
            fy,
            position: [x, y, z],
            rotation: *rotation,
            near,
            split: None,
            tiles: None,
            background: None,
        };
        let options = RenderOptions::default().with_background(background).with_max_degree(max_degree);
        (numbers.len() == NUMBERS).then_some(Self {
            wanted: [first, second].map(|v| v > 0.0),
            camera,
            options,
        })
    }
}

#[cfg(all(test, feature = "processor"))]
mod tests {
    use super::*;

    #[test]
    fn numbers_give_the_view_back() {
        let camera = Camera {
            name: String::new(),
            width: 640,
            height: 427,
            fx: 500.25,
            fy: 499.0,
            position: [0.1, -2.0, 1e-7],
            rotation: [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]],
            near: 0.02,
            split: None,
            tiles: None,
            background: None,
        };
        let options = RenderOptions::default().with_background([0.1, 0.2, 0.3]);
        for (degree, wanted) in [(None, [true, false]), (ShDegree::new(2).ok(), [false, true])] {
            let view = View { wanted, camera: camera.clone(), options: options.with_max_degree(degree) };
            let mut numbers = view.to_numbers();
            assert_eq!(numbers.len(), NUMBERS);
            assert_eq!(View::from_numbers(&numbers), Some(view));
            numbers[5] = 9.0;
            assert_eq!(View::from_numbers(&numbers), None);
            numbers.pop();
            assert_eq!(View::from_numbers(&numbers), None);
        }
    }
}
