//! Draws one tile: its splats from front to back, a block of 4 by 4 pixels at a time.

use lexisplat::simd::Simd;

use crate::conventions::{ALPHA_MAX, ALPHA_MIN, TILE, TRANSMITTANCE_MIN};

use super::math::exp_in_range;
use super::project::{Splat, Visible};

/// Side of a block in pixels. Most splats are small, and touch fewer blocks than rows of a tile.
pub(super) const SIDE: usize = 4;
/// Blocks of a row or a column of a tile.
pub(super) const BLOCKS: usize = TILE / SIDE;
/// Pixels of a block. Loops over them become vector instructions.
pub(super) const LANES: usize = SIDE * SIDE;

/// One value for each pixel of a block, row by row.
pub(super) type Lanes = [f32; LANES];

/// A block being drawn.
#[derive(Debug, Clone, Copy)]
struct Block {
    red: Lanes,
    green: Lanes,
    blue: Lanes,
    /// The share of light that splats further back can add; 0 once the pixel is finished.
    open: Lanes,
    /// The share of light that the background adds.
    transmittance: Lanes,
}

const EMPTY: Block = Block {
    red: [0.0; LANES],
    green: [0.0; LANES],
    blue: [0.0; LANES],
    open: [1.0; LANES],
    transmittance: [1.0; LANES],
};

/// A finished tile: its columns of blocks, each block with its three channels.
#[derive(Debug, Clone)]
pub(super) struct TilePixels(pub(super) [[[Lanes; 3]; BLOCKS]; BLOCKS]);

impl TilePixels {
    pub(super) fn pixel(&self, x: usize, y: usize) -> [f32; 3] {
        let block = &self.0[x / SIDE][y / SIDE];
        block.map(|channel| channel[y % SIDE * SIDE + x % SIDE])
    }
}

/// The blocks of the tile at `corner`, its first pixel, that a splat may touch: from `first` to before `end`, as
/// (column, row).
#[inline(always)]
pub(super) fn reach(splat: &Splat, corner: [usize; 2]) -> [[usize; 2]; 2] {
    let within = |pixel: u16, k: usize| usize::from(pixel).saturating_sub(corner[k]).min(TILE);
    let first = std::array::from_fn(|k| within(splat.pixels[k][0], k) / SIDE);
    let end = std::array::from_fn(|k| within(splat.pixels[k][1], k).div_ceil(SIDE));
    [first, end]
}

/// The x of the pixels in each column of blocks of the tile at `corner`, and the y of those in each row.
#[inline(always)]
#[expect(clippy::cast_precision_loss, reason = "pixel coordinates are far below 2^24")]
pub(super) fn coordinates(corner: [usize; 2]) -> [[Lanes; BLOCKS]; 2] {
    let coordinates = |k: usize, of: fn(usize) -> usize| {
        std::array::from_fn(|block| {
            std::array::from_fn(|lane| (corner[k] + block * SIDE + of(lane)) as f32)
        })
    };
    [coordinates(0, |lane| lane % SIDE), coordinates(1, |lane| lane / SIDE)]
}

/// Draws the tile at `[column, row]` from the splats in `list`, sorted from front to back.
pub(super) fn tile(
    simd: Simd,
    splats: &[Visible],
    list: impl Iterator<Item = u32>,
    at: [usize; 2],
    background: [f32; 3],
) -> TilePixels {
    simd.dispatch(
        #[inline(always)]
        || draw(splats, list, at, background),
    )
}

#[inline(always)]
fn draw(
    splats: &[Visible],
    list: impl Iterator<Item = u32>,
    at: [usize; 2],
    background: [f32; 3],
) -> TilePixels {
    let corner = at.map(|k| k * TILE);
    let [x, y] = coordinates(corner);
    let mut blocks = [[EMPTY; BLOCKS]; BLOCKS];
    let mut open = [[true; BLOCKS]; BLOCKS];
    let mut blocks_open = BLOCKS * BLOCKS;
    for splat in list {
        let splat = &splats[splat as usize].splat;
        let [first, end] = reach(splat, corner);
        for column in first[0]..end[0] {
            for row in first[1]..end[1] {
                if open[column][row] && blend(&mut blocks[column][row], splat, &x[column], &y[row]) {
                    open[column][row] = false;
                    blocks_open -= 1;
                }
            }
        }
        if blocks_open == 0 {
            break;
        }
    }
    TilePixels(blocks.map(|column| {
        column.map(|block| {
            let over = |colour: &Lanes, background: f32| -> Lanes {
                std::array::from_fn(|lane| colour[lane] + block.transmittance[lane] * background)
            };
            let [red, green, blue] = background;
            [over(&block.red, red), over(&block.green, green), over(&block.blue, blue)]
        })
    }))
}

/// Adds `splat` to the pixels of a block. Returns whether all of them are finished then.
///
/// Loops are short, and their conditions select values instead of branching, so that each loop becomes a few
/// vector instructions.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "lanes of several arrays side by side")]
fn blend(block: &mut Block, splat: &Splat, x: &Lanes, y: &Lanes) -> bool {
    let [red, green, blue] = splat.colour;
    let Some(alpha) = alphas(splat, x, y) else { return false };
    let mut still_open = 0;
    for lane in 0..LANES {
        // Where alpha is 0 an open pixel stays as it is, since it is never below the minimum. A finished one
        // stays 0.
        let left = block.open[lane] * (1.0 - alpha[lane]);
        let add = left >= TRANSMITTANCE_MIN;
        let weight = if add { alpha[lane] * block.open[lane] } else { 0.0 };
        let open = if add { left } else { 0.0 };
        let transmittance = if add { left } else { block.transmittance[lane] };
        block.red[lane] += red * weight;
        block.green[lane] += green * weight;
        block.blue[lane] += blue * weight;
        block.transmittance[lane] = transmittance;
        block.open[lane] = open;
        still_open |= open.to_bits();
    }
    still_open == 0
}

/// Returns the opacities of `splat` at the pixels of a block, 0 where it does not count; `None` if it counts
/// nowhere.
#[inline(always)]
pub(super) fn alphas(splat: &Splat, x: &Lanes, y: &Lanes) -> Option<Lanes> {
    let Splat { conic: [a, b, c], opacity, cutoff, .. } = *splat;
    let mut power = [0.0; LANES];
    let mut any = false;
    for lane in 0..LANES {
        let (dx, dy) = (splat.centre[0] - x[lane], splat.centre[1] - y[lane]);
        let p = -0.5 * (a * dx * dx + c * dy * dy) - b * dx * dy;
        power[lane] = p;
        any |= p >= cutoff;
    }
    if !any {
        return None;
    }
    let mut alpha = [0.0; LANES];
    for lane in 0..LANES {
        let p = power[lane];
        let value = opacity * exp_in_range(p);
        let value = if value < ALPHA_MAX { value } else { ALPHA_MAX };
        let counts = (p >= cutoff) & (p <= 0.0) & (value >= ALPHA_MIN);
        alpha[lane] = if counts { value } else { 0.0 };
    }
    Some(alpha)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The vector instructions that this machine has round as the plain ones do.
    #[test]
    fn the_instruction_set_makes_no_difference() {
        let mut state = 7_u32;
        let mut random = |low: f32, high: f32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            low + (high - low) * f32::from(u16::try_from(state >> 16).unwrap()) / 65_536.0
        };
        let splats: Vec<Visible> = (0..300)
            .map(|_| Splat {
                centre: [random(-10.0, 60.0), random(20.0, 90.0)],
                conic: [random(0.01, 0.5), random(-0.01, 0.01), random(0.01, 0.5)],
                opacity: random(0.0, 1.0),
                colour: std::array::from_fn(|_| random(0.0, 2.0)),
                cutoff: -8.0,
                pixels: [[0, 100]; 2],
            })
            .map(|splat| Visible { splat, ..Visible::default() })
            .collect();
        let (at, background) = ([1, 3], [0.1, 0.5, 0.9]);
        let plain = draw(&splats, 0..300, at, background);
        for simd in Simd::available() {
            let wide = simd.dispatch(
                #[inline(always)]
                || draw(&splats, 0..300, at, background),
            );
            let chosen = tile(simd, &splats, 0..300, at, background);
            for (x, y) in (0..TILE * TILE).map(|k| (k % TILE, k / TILE)) {
                let bits = plain.pixel(x, y).map(f32::to_bits);
                assert_eq!(wide.pixel(x, y).map(f32::to_bits), bits, "{simd:?}");
                assert_eq!(chosen.pixel(x, y).map(f32::to_bits), bits);
                assert_ne!(chosen.pixel(x, y), background);
            }
        }
    }
}
