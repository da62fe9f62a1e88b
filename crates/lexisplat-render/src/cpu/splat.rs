//! A Gaussian on screen.

/// A Gaussian on screen. It fills one cache line, because tiles read splats in the order of depth, which is not their
/// order in memory.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
pub(super) struct Splat {
    /// Centre in pixels; pixel centres are integers.
    pub(super) centre: [f32; 2],
    /// Inverse covariance in 1 / square pixels: xx, xy, yy.
    pub(super) conic: [f32; 3],
    /// Opacity at the centre, 0 to 1.
    pub(super) opacity: f32,
    /// Colour towards the camera, not below 0.
    pub(super) colour: [f32; 3],
    /// Smallest power that counts. Lower powers certainly give an opacity below
    /// [`ALPHA_MIN`](crate::conventions::ALPHA_MIN).
    pub(super) cutoff: f32,
    /// The pixels that the splat may touch.
    pub(super) pixels: PixelRect,
    /// The yy of the covariance, in square pixels.
    pub(super) variance_y: f32,
    /// Index of the Gaussian in the scene.
    pub(super) gaussian: u32,
}

impl Splat {
    /// Returns the root of the splat's conic.
    #[inline(always)]
    pub(super) fn root(&self) -> Root {
        Root::of_conic(self.conic, self.variance_y)
    }
}

/// Pixels from `min` to before `max`, as (column, row).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct PixelRect {
    pub(super) min: [u16; 2],
    pub(super) max: [u16; 2],
}

impl PixelRect {
    /// Returns the rectangle as two words.
    pub(super) fn to_words(self) -> (u32, u32) {
        let word = |[column, row]: [u16; 2]| u32::from(column) | u32::from(row) << u16::BITS;
        (word(self.min), word(self.max))
    }

    #[expect(clippy::cast_possible_truncation, reason = "the halves of a word")]
    pub(super) fn from_words((min, max): (u32, u32)) -> Self {
        let corner = |word: u32| [word as u16, (word >> u16::BITS) as u16];
        Self { min: corner(min), max: corner(max) }
    }
}

/// The upper triangular root R of a conic, where the conic is `R^T R`: xx, xy, yy. `R (centre - pixel)` is the offset in
/// standard deviations. Products of this offset therefore neither grow with the size of a Gaussian nor cancel in thin
/// Gaussians.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Root(pub(super) [f32; 3]);

impl Root {
    /// Returns the root of a conic. `variance_y` is the yy of the covariance.
    #[inline(always)]
    pub(super) fn of_conic(conic: [f32; 3], variance_y: f32) -> Self {
        let [xx, xy, _] = conic;
        let root = xx.sqrt();
        // The square of the last element is the determinant divided by xx. `variance_y` gives it without cancellation.
        Self([root, xy / root, 1.0 / variance_y.sqrt()])
    }

    /// Returns `R v`.
    #[inline(always)]
    pub(super) fn of(&self, v: [f32; 2]) -> [f32; 2] {
        let [xx, xy, yy] = self.0;
        [xx * v[0] + xy * v[1], yy * v[1]]
    }
}
