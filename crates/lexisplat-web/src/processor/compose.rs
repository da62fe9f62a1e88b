//! One or two pictures of the processor in one, as the viewer's shader shows them.

use lexisplat_render::Image;

/// How pictures are shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Layout {
    First,
    Second,
    /// Both, the first on the left.
    Side,
    /// The first left of a line, whose place is 0 (left edge) to 1, and the second right of it.
    Wipe(f32),
    /// The absolute difference times this factor.
    Difference(f32),
}

impl Layout {
    /// Returns the layout of a mode of the viewer, by its place among the modes.
    pub(crate) fn of(mode: u32, split: f32, gain: f32) -> Option<Self> {
        Some(match mode {
            0 => Self::First,
            1 => Self::Second,
            2 => Self::Side,
            3 => Self::Wipe(split),
            4 => Self::Difference(gain),
            _ => return None,
        })
    }
}

/// Returns the width and height of the pictures so laid out, and red, green, blue and opacity of each pixel, 8 bits each. Returns `None`
/// if a picture is missing, or the two differ in size.
pub(crate) fn compose(pictures: [Option<&Image>; 2], layout: Layout) -> Option<(u32, u32, Vec<u8>)> {
    let (first, second) = match (layout, pictures) {
        (Layout::First, [Some(one), _]) | (Layout::Second, [_, Some(one)]) => (one, one),
        (Layout::First | Layout::Second, _) => return None,
        (_, [Some(first), Some(second)]) => (first, second),
        _ => return None,
    };
    if (first.width, first.height) != (second.width, second.height) {
        return None;
    }
    let side = first.width as usize;
    let width = if layout == Layout::Side { 2 * side } else { side };
    let mut out = Vec::with_capacity(4 * width * first.height as usize);
    let rows = first.pixels.chunks_exact(side.max(1)).zip(second.pixels.chunks_exact(side.max(1)));
    let mut put = |pixel: &[f32; 3]| {
        out.extend(pixel.map(byte));
        out.push(u8::MAX);
    };
    for (left, right) in rows {
        match layout {
            Layout::First | Layout::Second => left.iter().for_each(&mut put),
            Layout::Side => left.iter().chain(right).for_each(&mut put),
            Layout::Wipe(split) => {
                let end = columns_before(split, side);
                left[..end].iter().chain(&right[end..]).for_each(&mut put);
            }
            Layout::Difference(gain) => left.iter().zip(right).for_each(|(a, b)| {
                put(&std::array::from_fn(|k| (clipped(a[k]) - clipped(b[k])).abs() * gain));
            }),
        }
    }
    Some((u32::try_from(width).ok()?, first.height, out))
}

/// Returns the number of the columns of `side` whose middle is left of the line.
#[expect(clippy::cast_precision_loss, reason = "sides are far below 2^24")]
fn columns_before(split: f32, side: usize) -> usize {
    (0..side).take_while(|&x| (x as f32 + 0.5) / (side as f32) < split).count()
}

fn clipped(v: f32) -> f32 {
    // A comparison with NaN is false.
    if v > 0.0 { v.min(1.0) } else { 0.0 }
}

/// Returns a channel in 8 bits, as [`Image::to_8bit`] does.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0.5 to 255.5")]
fn byte(v: f32) -> u8 {
    (clipped(v) * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(values: [f32; 4]) -> Image {
        Image { width: 4, height: 1, pixels: values.map(|v| [v, 0.0, 1.0]).to_vec() }
    }

    /// The red of each pixel.
    fn reds(pictures: [Option<&Image>; 2], layout: Layout) -> Option<Vec<u8>> {
        let (width, height, bytes) = compose(pictures, layout)?;
        assert_eq!(bytes.len(), (4 * width * height) as usize);
        assert!(bytes.iter().skip(3).step_by(4).all(|&opacity| opacity == 255));
        Some(bytes.iter().step_by(4).copied().collect())
    }

    #[test]
    fn pictures_lie_as_the_window_lays_them() {
        let (a, b) = (picture([0.0, 0.2, 0.4, 2.0]), picture([1.0, 0.2, 0.5, f32::NAN]));
        let both = [Some(&a), Some(&b)];
        assert_eq!(reds(both, Layout::First).unwrap(), [0, 51, 102, 255]);
        assert_eq!(reds(both, Layout::Second).unwrap(), [255, 51, 128, 0]);
        assert_eq!(reds(both, Layout::Side).unwrap(), [0, 51, 102, 255, 255, 51, 128, 0]);
        assert_eq!(reds(both, Layout::Wipe(0.5)).unwrap(), [0, 51, 128, 0]);
        assert_eq!(reds(both, Layout::Wipe(0.0)).unwrap(), [255, 51, 128, 0]);
        assert_eq!(reds(both, Layout::Difference(5.0)).unwrap(), [255, 0, 127, 255]);
        // 8 bits are those of a saved picture.
        assert_eq!(reds(both, Layout::Second).unwrap(), b.to_8bit().iter().map(|p| p[0]).collect::<Vec<_>>());
    }

    #[test]
    fn missing_and_unlike_pictures_are_not_shown() {
        let (a, mut b) = (picture([0.0; 4]), picture([0.0; 4]));
        assert!(reds([None, Some(&b)], Layout::First).is_none());
        assert!(reds([Some(&a), None], Layout::Wipe(0.3)).is_none());
        b.height = 2;
        assert!(reds([Some(&a), Some(&b)], Layout::Side).is_none());
        assert!(Layout::of(5, 0.0, 1.0).is_none());
    }
}
