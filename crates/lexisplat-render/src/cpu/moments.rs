//! Sums over a tile's pixels of products of derivatives: how the pixels change with the tile's splats.

use lexisplat::simd::Simd;

use crate::conventions::{TILE, TRANSMITTANCE_MIN};

use super::blend::{Lanes, TilePixels, alphas};
use super::project::{Root, Splat, Visible};

/// Number of sums that a splat has.
pub(crate) const SUMS: usize = 10;

/// Sums over pixels, for one splat. Alpha is its opacity at a pixel, T the light that the splats before it let
/// through, C the pixel's colour, and u = R (centre - pixel), where R is the conic's [`Root`]:
///
/// - `[0]`: (T alpha)^2, the squared derivative by one colour channel;
/// - `[1]`: g = |dC / d ln alpha|^2;
/// - `[2..5]`: g ux^2, g ux uy, g uy^2: the derivatives by the centre, since d ln alpha / d (R centre) = -u;
/// - `[5..10]`: g ux^4, g ux^3 uy, g ux^2 uy^2, g ux uy^3, g uy^4: the derivatives by the shape.
#[derive(Debug, Clone, Copy, Default)]
#[cfg_attr(feature = "gpu", derive(bytemuck::Pod, bytemuck::Zeroable))]
#[repr(C)]
pub(crate) struct Moments {
    pub(super) sums: [f32; SUMS],
    /// The largest change of any channel of any pixel when the splat is left out. That change is dC / d ln alpha:
    /// the light that the splat adds is lost, and the light that it covers comes back.
    pub(super) removal: f32,
}

impl Moments {
    /// Adds the moments of other pixels.
    pub(super) fn add(&mut self, other: &Self) {
        for (sum, value) in self.sums.iter_mut().zip(other.sums) {
            *sum += value;
        }
        self.removal = self.removal.max(other.removal);
    }
}

/// Returns the moments of the splats that show in the tile at `[column, row]`. `picture` is the finished tile,
/// `roots` are the roots of the splats, and `size` is that of the whole picture in pixels.
pub(super) fn tile(
    simd: Simd,
    splats: &[Visible],
    roots: &[Root],
    list: impl Iterator<Item = u32>,
    at: [usize; 2],
    size: [usize; 2],
    picture: &TilePixels,
) -> Vec<(u32, Moments)> {
    simd.dispatch(
        #[inline(always)]
        || sum(splats, roots, list, at, size, picture),
    )
}

/// A row of pixels: its coordinates, and its finished colours.
#[derive(Clone, Copy)]
struct Pixels<'a> {
    x: &'a Lanes,
    y: f32,
    picture: &'a [Lanes; 3],
}

/// A row of pixels as far as it has been drawn.
#[derive(Clone, Copy)]
struct Row {
    colour: [Lanes; 3],
    open: Lanes,
}

#[inline(always)]
#[expect(clippy::cast_precision_loss, reason = "pixel coordinates are far below 2^24")]
fn sum(
    splats: &[Visible],
    roots: &[Root],
    list: impl Iterator<Item = u32>,
    [column, row]: [usize; 2],
    [width, height]: [usize; 2],
    picture: &TilePixels,
) -> Vec<(u32, Moments)> {
    let mut out = Vec::new();
    let (left, top) = (column * TILE, row * TILE);
    let x: Lanes = std::array::from_fn(|lane| (left + lane) as f32);
    // Pixels beyond the picture's border are drawn but do not count.
    let open = std::array::from_fn(|lane| if left + lane < width { 1.0 } else { 0.0 });
    let mut rows = [Row { colour: [[0.0; TILE]; 3], open }; TILE];
    let mut row_open: [bool; TILE] = std::array::from_fn(|y| top + y < height);
    for index in list {
        let (splat, root) = (&splats[index as usize].splat, &roots[index as usize]);
        let first = usize::from(splat.rows[0]).saturating_sub(top);
        let end = usize::from(splat.rows[1]).saturating_sub(top).min(TILE);
        let mut sums = [[0.0_f32; TILE]; SUMS];
        let mut removal = [0.0_f32; TILE];
        let mut seen = false;
        for y in first..end {
            if row_open[y] {
                let pixels = Pixels { x: &x, y: (top + y) as f32, picture: &picture.0[y] };
                let drawn = add(&mut rows[y], splat, root, pixels, &mut sums, &mut removal);
                seen |= drawn;
                row_open[y] = !drawn || rows[y].open.iter().any(|&o| o > 0.0);
            }
        }
        if seen {
            let sums = sums.map(|lanes| lanes.iter().sum());
            out.push((index, Moments { sums, removal: removal.into_iter().fold(0.0, f32::max) }));
        }
        if row_open == [false; TILE] {
            break;
        }
    }
    out
}

/// Draws `splat` on a row as `blend` does, and adds to its sums. Returns whether it may show there.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "lanes of several arrays side by side")]
fn add(
    row: &mut Row,
    splat: &Splat,
    root: &Root,
    Pixels { x, y, picture }: Pixels<'_>,
    sums: &mut [Lanes; SUMS],
    removal: &mut Lanes,
) -> bool {
    let Some(alphas) = alphas(splat, x, y) else { return false };
    let dy = splat.centre[1] - y;
    for lane in 0..TILE {
        let alpha = alphas[lane];
        let left = row.open[lane] * (1.0 - alpha);
        let shows = left >= TRANSMITTANCE_MIN;
        let weight = if shows { alpha * row.open[lane] } else { 0.0 };
        row.open[lane] = if shows { left } else { 0.0 };
        // alpha / (1 - alpha) is the share of the light behind that one more unit of ln alpha takes away.
        let taken = if weight > 0.0 { alpha / (1.0 - alpha) } else { 0.0 };
        let mut g = 0.0;
        let mut largest = removal[lane];
        for channel in 0..3 {
            let own = weight * splat.colour[channel];
            row.colour[channel][lane] += own;
            let behind = picture[channel][lane] - row.colour[channel][lane];
            let change = own - behind * taken;
            g += change * change;
            largest = if change.abs() > largest { change.abs() } else { largest };
        }
        removal[lane] = largest;
        let dx = splat.centre[0] - x[lane];
        let [ux, uy] = root.of([dx, dy]);
        let (xx, xy, yy) = (ux * ux, ux * uy, uy * uy);
        let terms = [
            weight * weight,
            g,
            g * xx,
            g * xy,
            g * yy,
            g * xx * xx,
            g * xx * xy,
            g * xx * yy,
            g * xy * yy,
            g * yy * yy,
        ];
        for (sum, term) in sums.iter_mut().zip(terms) {
            sum[lane] += term;
        }
    }
    true
}
