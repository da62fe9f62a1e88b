//! Draws one tile: its splats from front to back, a row of 16 pixels at a time.

use lexisplat::simd::Simd;

use crate::conventions::{ALPHA_MAX, ALPHA_MIN, TILE, TRANSMITTANCE_MIN};

use super::math::exp_in_range;
use super::project::{Splat, Visible};

/// One value for each pixel of a row of a tile.
pub(super) type Lanes = [f32; TILE];

/// A row of pixels being drawn.
#[derive(Debug, Clone, Copy)]
struct Row {
    red: Lanes,
    green: Lanes,
    blue: Lanes,
    /// The share of light that splats further back can add; 0 once the pixel is finished.
    open: Lanes,
    /// The share of light that the background adds.
    transmittance: Lanes,
}

const EMPTY: Row = Row {
    red: [0.0; TILE],
    green: [0.0; TILE],
    blue: [0.0; TILE],
    open: [1.0; TILE],
    transmittance: [1.0; TILE],
};

/// A finished tile.
#[derive(Debug, Clone)]
pub(super) struct TilePixels(pub(super) [[Lanes; 3]; TILE]);

impl TilePixels {
    pub(super) fn pixel(&self, x: usize, y: usize) -> [f32; 3] {
        std::array::from_fn(|c| self.0[y][c][x])
    }
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
    [column, row]: [usize; 2],
    background: [f32; 3],
) -> TilePixels {
    let mut rows = [EMPTY; TILE];
    let mut row_open = [true; TILE];
    let mut rows_open = TILE;
    // Pixel coordinates are below 2^24, so they are exact.
    #[expect(clippy::cast_precision_loss, reason = "far below 2^24")]
    let x: Lanes = std::array::from_fn(|lane| (column * TILE + lane) as f32);
    let top = row * TILE;
    for splat in list {
        let splat = &splats[splat as usize].splat;
        let first = usize::from(splat.rows[0]).saturating_sub(top);
        let end = usize::from(splat.rows[1]).saturating_sub(top).min(TILE);
        for y in first..end {
            if !row_open[y] {
                continue;
            }
            #[expect(clippy::cast_precision_loss, reason = "far below 2^24")]
            let finished = blend(&mut rows[y], splat, &x, (top + y) as f32);
            if finished {
                row_open[y] = false;
                rows_open -= 1;
            }
        }
        if rows_open == 0 {
            break;
        }
    }
    TilePixels(std::array::from_fn(|y| {
        let row = &rows[y];
        let over = |colour: &Lanes, background: f32| -> Lanes {
            std::array::from_fn(|lane| colour[lane] + row.transmittance[lane] * background)
        };
        [over(&row.red, background[0]), over(&row.green, background[1]), over(&row.blue, background[2])]
    }))
}

/// Adds `splat` to the pixels of a row. Returns whether all of them are finished then.
///
/// Loops are short, and their conditions select values instead of branching, so that each loop becomes a few
/// vector instructions.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "lanes of several arrays side by side")]
fn blend(row: &mut Row, splat: &Splat, x: &Lanes, y: f32) -> bool {
    let [red, green, blue] = splat.colour;
    let Some(alpha) = alphas(splat, x, y) else { return false };
    let mut still_open = 0;
    for lane in 0..TILE {
        // Where alpha is 0 an open pixel stays as it is, since it is never below the minimum. A finished one
        // stays 0.
        let left = row.open[lane] * (1.0 - alpha[lane]);
        let add = left >= TRANSMITTANCE_MIN;
        let weight = if add { alpha[lane] * row.open[lane] } else { 0.0 };
        let open = if add { left } else { 0.0 };
        let transmittance = if add { left } else { row.transmittance[lane] };
        row.red[lane] += red * weight;
        row.green[lane] += green * weight;
        row.blue[lane] += blue * weight;
        row.transmittance[lane] = transmittance;
        row.open[lane] = open;
        still_open |= open.to_bits();
    }
    still_open == 0
}

/// Returns the opacities of `splat` at the pixels of a row, 0 where it does not count; `None` if it counts
/// nowhere.
#[inline(always)]
pub(super) fn alphas(splat: &Splat, x: &Lanes, y: f32) -> Option<Lanes> {
    let Splat { conic: [a, b, c], opacity, cutoff, .. } = *splat;
    let dy = splat.centre[1] - y;
    let mut power = [0.0; TILE];
    let mut any = false;
    for lane in 0..TILE {
        let dx = splat.centre[0] - x[lane];
        let p = -0.5 * (a * dx * dx + c * dy * dy) - b * dx * dy;
        power[lane] = p;
        any |= p >= cutoff;
    }
    if !any {
        return None;
    }
    let mut alpha = [0.0; TILE];
    for lane in 0..TILE {
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
                rows: [0, 100],
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
