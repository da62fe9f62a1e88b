//! Sums over a tile's pixels of products of derivatives: how the pixels change with the tile's splats.

use lexisplat::simd::Simd;

use crate::conventions::{TILE, TRANSMITTANCE_MIN};

use super::blend::{BLOCKS, LANES, Lanes, SIDE, TilePixels, alphas, coordinates, reach};
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

/// A block as far as it has been drawn.
#[derive(Clone, Copy)]
struct Block {
    colour: [Lanes; 3],
    open: Lanes,
}

/// The sums of each pixel of a block, and its largest change.
struct LaneMoments {
    sums: [Lanes; SUMS],
    removal: Lanes,
}

#[inline(always)]
fn sum(
    splats: &[Visible],
    roots: &[Root],
    list: impl Iterator<Item = u32>,
    at: [usize; 2],
    size: [usize; 2],
    picture: &TilePixels,
) -> Vec<(u32, Moments)> {
    let mut out = Vec::new();
    let corner = at.map(|k| k * TILE);
    let [x, y] = coordinates(corner);
    // Pixels beyond the picture's border are drawn but do not count.
    #[expect(clippy::cast_precision_loss, reason = "sides are far below 2^24")]
    let [width, height] = size.map(|side| side as f32);
    let mut blocks: [[Block; BLOCKS]; BLOCKS] = std::array::from_fn(|column| {
        std::array::from_fn(|row| Block {
            colour: [[0.0; LANES]; 3],
            open: std::array::from_fn(|lane| {
                let inside = x[column][lane] < width && y[row][lane] < height;
                if inside { 1.0 } else { 0.0 }
            }),
        })
    });
    let mut open = blocks.map(|column| column.map(|block| block.open != [0.0; LANES]));
    for index in list {
        let (splat, root) = (&splats[index as usize].splat, &roots[index as usize]);
        let [first, end] = reach(splat, corner);
        let mut moments = Moments { sums: [0.0; SUMS], removal: 0.0 };
        let mut seen = false;
        for column in first[0]..end[0] {
            let mut columns = [[0.0; SIDE]; SUMS];
            let mut removal = [0.0; SIDE];
            let mut touched = false;
            for row in first[1]..end[1] {
                if !open[column][row] {
                    continue;
                }
                let block = &mut blocks[column][row];
                let added = add(block, splat, root, &x[column], &y[row], &picture.0[column][row]);
                let Some(lanes) = added else { continue };
                touched = true;
                open[column][row] = block.open != [0.0; LANES];
                for (sum, lanes) in columns.iter_mut().zip(&lanes.sums) {
                    for row in lanes.chunks_exact(SIDE) {
                        sum.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
                    }
                }
                for row in lanes.removal.chunks_exact(SIDE) {
                    removal.iter_mut().zip(row).for_each(|(most, value)| *most = value.max(*most));
                }
            }
            if touched {
                seen = true;
                // The sums are independent, so they advance together, pixel column by pixel column.
                for k in 0..SIDE {
                    moments.sums.iter_mut().zip(&columns).for_each(|(sum, column)| *sum += column[k]);
                }
                moments.removal = removal.into_iter().fold(moments.removal, f32::max);
            }
        }
        if seen {
            out.push((index, moments));
        }
        if open == [[false; BLOCKS]; BLOCKS] {
            break;
        }
    }
    out
}

/// Draws `splat` on a block as `blend` does. Returns its moments; `None` if it shows nowhere.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "lanes of several arrays side by side")]
fn add(
    block: &mut Block,
    splat: &Splat,
    root: &Root,
    x: &Lanes,
    y: &Lanes,
    picture: &[Lanes; 3],
) -> Option<LaneMoments> {
    let alphas = alphas(splat, x, y)?;
    let mut moments = LaneMoments { sums: [[0.0; LANES]; SUMS], removal: [0.0; LANES] };
    for lane in 0..LANES {
        let alpha = alphas[lane];
        let left = block.open[lane] * (1.0 - alpha);
        let shows = left >= TRANSMITTANCE_MIN;
        let weight = if shows { alpha * block.open[lane] } else { 0.0 };
        block.open[lane] = if shows { left } else { 0.0 };
        // alpha / (1 - alpha) is the share of the light behind that one more unit of ln alpha takes away.
        let taken = if weight > 0.0 { alpha / (1.0 - alpha) } else { 0.0 };
        let mut g = 0.0;
        let mut largest = 0.0;
        for channel in 0..3 {
            let own = weight * splat.colour[channel];
            block.colour[channel][lane] += own;
            let behind = picture[channel][lane] - block.colour[channel][lane];
            let change = own - behind * taken;
            g += change * change;
            largest = if change.abs() > largest { change.abs() } else { largest };
        }
        moments.removal[lane] = largest;
        let [ux, uy] = root.of([splat.centre[0] - x[lane], splat.centre[1] - y[lane]]);
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
        for (sum, term) in moments.sums.iter_mut().zip(terms) {
            sum[lane] = term;
        }
    }
    Some(moments)
}
