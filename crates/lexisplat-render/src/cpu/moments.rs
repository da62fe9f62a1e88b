//! Sums over a tile's pixels of products of derivatives. They measure how the pixels change with the tile's splats.

use lexisplat::simd::Simd;

use crate::conventions::TRANSMITTANCE_MIN;

use super::blend::{BLOCKS, Canvas, SIDE, Tile};
use super::lanes::{LANES, Lanes};
use super::measured_tiles::Scratch;
use super::splat::{Root, Splat};
use super::trace::Trace;

/// Number of sums of a splat.
pub(crate) const SUMS: usize = 10;

/// Sums over pixels for one splat. `alpha` is the opacity of the splat at a pixel, `T` the light that the splats before
/// it let through, `C` the colour of the pixel, and `u = R (centre - pixel)`, where `R` is the [`Root`] of the conic:
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
    /// Largest change of any channel of any pixel when the splat is removed. The change is dC / d ln alpha: the light
    /// that the splat adds is lost, and the light that it covers returns.
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

/// Returns the moments of the splats that show in a tile over `background`, with the indices of their Gaussians. `list` has
/// slots of `splats` from front to back.
pub(super) fn tile<'a>(
    simd: Simd,
    splats: &[Splat],
    list: impl Iterator<Item = &'a [u32]>,
    tile: Tile,
    background: [f32; 3],
    Scratch { canvas, trace }: &mut Scratch,
) -> Vec<(u32, Moments)> {
    trace.clear();
    simd.dispatch(
        #[inline(always)]
        || {
            canvas.draw_over(splats, list, tile, background, trace);
            sum(trace, tile, canvas)
        },
    )
}

/// The state of a block while it is drawn.
#[derive(Clone, Copy)]
struct Block {
    colour: [Lanes; 3],
    open: Lanes,
}

/// The sums of one splat, for each pixel column.
struct Columns {
    /// Sums over a column of blocks.
    sums: [[f32; SIDE]; SUMS],
    /// Largest changes so far, over all columns of blocks.
    removal: [f32; SIDE],
}

impl Columns {
    const ZERO: Self = Self { sums: [[0.0; SIDE]; SUMS], removal: [0.0; SIDE] };

    /// Adds the sums to `moments` and resets them for the next column of blocks.
    #[inline(always)]
    fn flush(&mut self, moments: &mut Moments) {
        // The sums are independent of each other, so they are advanced together, pixel column by pixel column.
        for k in 0..SIDE {
            moments.sums.iter_mut().zip(&self.sums).for_each(|(sum, column)| *sum += column[k]);
        }
        self.sums = Self::ZERO.sums;
    }
}

/// Returns the moments of the splats in `trace`. `picture` is the finished tile.
#[inline(always)]
fn sum(trace: &Trace, tile: Tile, picture: &Canvas) -> Vec<(u32, Moments)> {
    let mut out = Vec::with_capacity(trace.splats.len());
    let [x, y] = tile.coordinates();
    let mut blocks = [[Block { colour: [[0.0; LANES]; 3], open: [0.0; LANES] }; BLOCKS]; BLOCKS];
    for (column, blocks) in blocks.iter_mut().enumerate() {
        blocks.iter_mut().enumerate().for_each(|(row, block)| block.open = tile.inside(column, row));
    }
    for same in trace.marks.chunk_by(|a, b| a.splat == b.splat) {
        let splat = &trace.splats[same[0].splat as usize];
        let root = splat.root();
        let mut moments = Moments::default();
        let mut columns = Columns::ZERO;
        for same in same.chunk_by(|a, b| a.block[0] == b.block[0]) {
            for mark in same {
                let [column, row] = mark.block.map(|k| usize::from(k) % BLOCKS);
                let block = &mut blocks[column][row];
                add(
                    &mut columns,
                    block,
                    splat,
                    root,
                    &mark.alpha,
                    [&x[column], &y[row]],
                    &picture.blocks[column][row].colour,
                );
            }
            columns.flush(&mut moments);
        }
        moments.removal = columns.removal.into_iter().fold(0.0, f32::max);
        out.push((splat.gaussian, moments));
    }
    out
}

/// Draws `splat` on a block like `blend`, and adds its moments to `columns`.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "lanes of several arrays side by side")]
fn add(
    columns: &mut Columns,
    block: &mut Block,
    splat: &Splat,
    root: Root,
    alphas: &Lanes,
    [x, y]: [&Lanes; 2],
    picture: &[Lanes; 3],
) {
    let mut sums = [[0.0; LANES]; SUMS];
    let mut removal = [0.0; LANES];
    for lane in 0..LANES {
        let alpha = alphas[lane];
        let left = block.open[lane] * (1.0 - alpha);
        let shows = left >= TRANSMITTANCE_MIN;
        let weight = if shows { alpha * block.open[lane] } else { 0.0 };
        block.open[lane] = if shows { left } else { 0.0 };
        // `alpha / (1 - alpha)` is the share of the light from behind that is lost when ln alpha grows by one unit.
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
        removal[lane] = largest;
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
        for (sum, term) in sums.iter_mut().zip(terms) {
            sum[lane] = term;
        }
    }
    for (sum, lanes) in columns.sums.iter_mut().zip(&sums) {
        for row in lanes.chunks_exact(SIDE) {
            sum.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
        }
    }
    for row in removal.chunks_exact(SIDE) {
        columns
            .removal
            .iter_mut()
            .zip(row)
            .for_each(|(most, value)| *most = if value > most { *value } else { *most });
    }
}

#[cfg(test)]
mod tests {
    use super::super::splat::PixelRect;
    use super::*;
    use crate::conventions::TILE;

    /// A splat whose opacity falls off so slowly that it is the same over the tile, on these columns of pixels.
    fn flat(gaussian: u32, opacity: f32, columns: std::ops::Range<u16>) -> Splat {
        Splat {
            centre: [f32::from(columns.start), 0.0],
            conic: [1e-9, 0.0, 1e-9],
            opacity,
            colour: [1.0; 3],
            cutoff: -20.0,
            pixels: PixelRect { min: [columns.start, 0], max: [columns.end, 16] },
            variance_y: 1e9,
            gaussian,
        }
    }

    /// A splat can finish pixels without showing in any. Splats behind it show in the other pixels alone.
    #[test]
    fn what_finishes_a_pixel_without_showing_counts() {
        // Light left: 0.01, then 0.0005. 0.9 of that would leave less than the least transmittance.
        let splats = [flat(0, 0.99, 0..16), flat(1, 0.95, 0..16), flat(2, 0.9, 0..8), flat(3, 0.5, 0..16)];
        let list = [0, 1, 2, 3];
        for simd in Simd::available() {
            let mut scratch = Scratch::default();
            let place = Tile::new([0, 0], [TILE; 2]);
            let found = tile(simd, &splats, list.chunks(4), place, [0.0; 3], &mut scratch);
            let sum = |gaussian| found.iter().find(|(g, _)| *g == gaussian).map_or(0.0, |(_, m)| m.sums[0]);
            assert_eq!(sum(2), 0.0);
            // Half of 256 pixels, each with the square of half the light left.
            let expected = 128.0 * (0.5 * 5e-4_f32).powi(2);
            assert!((sum(3) / expected - 1.0).abs() < 1e-3, "{simd:?}: {} {expected}", sum(3));
        }
    }
}
