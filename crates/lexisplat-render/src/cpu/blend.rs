//! Draws one tile. Its splats are drawn from front to back, a block of 4 by 4 pixels at a time.

use lexisplat::simd::Simd;

use crate::conventions::{ALPHA_MAX, ALPHA_MIN, TILE, TRANSMITTANCE_MIN};

use super::lanes::{LANES, Lanes};
use super::math::{exp_in_range, mask};
use super::splat::Splat;
use super::trace::Trace;

/// Side of a block, in pixels. Most splats are small, and touch fewer blocks than rows of a tile.
pub(super) const SIDE: usize = 4;
/// Number of blocks in a row or a column of a tile.
pub(super) const BLOCKS: usize = TILE / SIDE;
/// The pixels of a block lie side by side, row by row.
const _: () = assert!(SIDE * SIDE == LANES);

/// Number of splats that are fetched together. Splats are likely not in the cache, so their latencies overlap.
const FETCHED: usize = 16;

/// A block that is being drawn.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block {
    /// Red, green and blue. They include the background only after [`Canvas::draw_over`].
    pub(super) colour: [Lanes; 3],
    /// Share of light that splats further back can add. It is 0 once the pixel is finished, and beyond the border of the
    /// picture.
    pub(super) open: Lanes,
    /// Share of light that the background adds. It stays 1 if the background is black.
    pub(super) transmittance: Lanes,
}

impl Block {
    const EMPTY: Self = Self { colour: [[0.0; LANES]; 3], open: [1.0; LANES], transmittance: [1.0; LANES] };
}

/// A tile of a picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tile {
    /// First pixel of the tile, as (column, row).
    corner: [usize; 2],
    /// Sides of the whole picture in pixels.
    size: [usize; 2],
    /// Place of the tile's first pixel in the drawn picture, as (column, row). It equals `corner` unless only some tiles
    /// are drawn.
    drawn: [usize; 2],
}

impl Tile {
    /// Returns the tile at `place`, as (column, row), of a picture of `size` pixels.
    pub(super) fn new(place: [usize; 2], size: [usize; 2]) -> Self {
        let corner = place.map(|k| k * TILE);
        Self { corner, size, drawn: corner }
    }

    /// Returns this tile as number `number` of a [`TileSet`](crate::TileSet).
    pub(super) fn of_set(self, number: usize) -> Self {
        Self { drawn: [0, number * TILE], ..self }
    }

    /// Returns the place of the tile's first pixel in the drawn picture, as (column, row).
    pub(super) fn drawn(self) -> [usize; 2] {
        self.drawn
    }

    /// Returns the x of the pixels in each column of blocks, and the y of the pixels in each row of blocks.
    #[inline(always)]
    #[expect(clippy::cast_precision_loss, reason = "pixel coordinates are far below 2^24")]
    pub(super) fn coordinates(self) -> [[Lanes; BLOCKS]; 2] {
        let coordinates = |k: usize, of: fn(usize) -> usize| {
            std::array::from_fn(|block| {
                std::array::from_fn(|lane| (self.corner[k] + block * SIDE + of(lane)) as f32)
            })
        };
        [coordinates(0, |lane| lane % SIDE), coordinates(1, |lane| lane / SIDE)]
    }

    /// Returns 1 for the pixels of a block that lie within the picture, and 0 for the others.
    #[inline(always)]
    pub(super) fn inside(self, column: usize, row: usize) -> Lanes {
        let within = |k: usize, block: usize, at: usize| self.corner[k] + block * SIDE + at < self.size[k];
        std::array::from_fn(|lane| {
            let inside = within(0, column, lane % SIDE) && within(1, row, lane / SIDE);
            if inside { 1.0 } else { 0.0 }
        })
    }

    /// Returns the blocks that a splat may touch.
    #[inline(always)]
    fn reach(self, splat: &Splat) -> BlockSet {
        let within = |pixel: u16, k: usize| usize::from(pixel).saturating_sub(self.corner[k]).min(TILE);
        let first = std::array::from_fn(|k| within(splat.pixels.min[k], k) / SIDE);
        let end = std::array::from_fn(|k| within(splat.pixels.max[k], k).div_ceil(SIDE));
        BlockSet::between(first, end)
    }
}

/// A set of blocks of a tile: bit `BLOCKS * column + row` for each.
#[derive(Debug, Clone, Copy, PartialEq)]
struct BlockSet(u32);

impl BlockSet {
    const NONE: Self = Self(0);

    /// Returns the blocks from `first` to before `end`, as (column, row).
    #[inline(always)]
    fn between(first: [usize; 2], end: [usize; 2]) -> Self {
        // A bit for each row, and the lowest bit of each column.
        let below = |end: usize, step: usize| (1_u32 << (end * step)) - 1;
        let rows = below(end[1], 1) & !below(first[1], 1);
        let columns = COLUMNS & below(end[0], BLOCKS) & !below(first[0], BLOCKS);
        Self(rows * columns)
    }

    /// Includes a block if `is_in`, and otherwise excludes it.
    #[inline(always)]
    fn set(&mut self, column: usize, row: usize, is_in: bool) {
        let bit = BLOCKS * column + row;
        self.0 = self.0 & !(1 << bit) | u32::from(is_in) << bit;
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Removes the first block, column by column, and returns its column and row.
    #[inline(always)]
    fn pop(&mut self) -> Option<[usize; 2]> {
        if self.0 == 0 {
            return None;
        }
        let bit = self.0.trailing_zeros() as usize;
        self.0 &= self.0 - 1;
        Some([bit / BLOCKS % BLOCKS, bit % BLOCKS])
    }
}

/// The first block of each column.
const COLUMNS: u32 = 0x1111;
const _: () = assert!(BLOCKS == 4);

/// A tile that is being drawn. The next tile overwrites it.
#[derive(Debug)]
pub(super) struct Canvas {
    /// The blocks, column by column.
    pub(super) blocks: [[Block; BLOCKS]; BLOCKS],
    /// The blocks with a pixel that is not finished.
    open: BlockSet,
    queue: Queue,
}

/// Splats in blocks that wait to be blended.
///
/// Each step of a batch is a loop of its own. Most instructions of such a loop do not wait for each other, because
/// opacities do not depend on pixels drawn before.
#[derive(Debug)]
struct Queue {
    splats: [Splat; FETCHED],
    len: usize,
    /// For each entry: the index of the splat in the batch, and the column and row of the block.
    blocks: [[u8; 3]; QUEUED],
    /// For each entry: first the exponents of the opacities of the pixels, then the opacities.
    lanes: [Lanes; QUEUED],
}

/// Largest number of entries of a queue: every block for every splat.
const QUEUED: usize = FETCHED * BLOCKS * BLOCKS;
/// Numbers of entries are reduced to their low bits, so that no index can be out of range.
const _: () = assert!(QUEUED.is_power_of_two() && BLOCKS.is_power_of_two() && FETCHED.is_power_of_two());

impl Default for Canvas {
    fn default() -> Self {
        let queue = Queue {
            splats: [Splat::default(); FETCHED],
            len: 0,
            blocks: [[0; 3]; QUEUED],
            lanes: [[0.0; LANES]; QUEUED],
        };
        Self { blocks: [[Block::EMPTY; BLOCKS]; BLOCKS], open: BlockSet::NONE, queue }
    }
}

impl Queue {
    /// Replaces the entries by entries of the splats in `slots`, for the open blocks of `tile` that the splats may touch.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "an index in a batch or a tile")]
    fn fill(
        &mut self,
        splats: &[Splat],
        slots: &[u32],
        tile: Tile,
        [x, y]: &[[Lanes; BLOCKS]; 2],
        open: BlockSet,
    ) {
        for (to, slot) in self.splats.iter_mut().zip(slots) {
            *to = splats[*slot as usize];
        }
        self.len = 0;
        for (k, splat) in self.splats.iter().enumerate().take(slots.len()) {
            let mut reached = tile.reach(splat).and(open);
            while let Some([column, row]) = reached.pop() {
                let at = self.len % QUEUED;
                self.blocks[at] = [k as u8, column as u8, row as u8];
                let any = powers(&mut self.lanes[at], splat, &x[column], &y[row]);
                self.len += usize::from(any);
            }
        }
    }

    /// Returns the splat of an entry, and the column and row of its block.
    #[inline(always)]
    fn block(&self, at: usize) -> (&Splat, usize, usize) {
        let [k, column, row] = self.blocks[at % QUEUED].map(usize::from);
        (&self.splats[k % FETCHED], column % BLOCKS, row % BLOCKS)
    }
}

/// Receives each splat that counts in a block: a splat that shows in a pixel or finishes one.
pub(super) trait Watch {
    /// Called for `splat` with its opacities `alpha` in the block at (column, row) of the tile.
    fn counts(&mut self, splat: &Splat, block: [u8; 2], alpha: &Lanes);
}

impl Watch for () {
    #[inline(always)]
    fn counts(&mut self, _: &Splat, _: [u8; 2], _: &Lanes) {}
}

impl Watch for Trace {
    #[inline(always)]
    fn counts(&mut self, splat: &Splat, block: [u8; 2], alpha: &Lanes) {
        self.push(splat, block, alpha);
    }
}

impl Canvas {
    /// Draws a tile over `background`. `list` has slots of `splats`, from front to back.
    pub(super) fn draw<'a>(
        &mut self,
        simd: Simd,
        splats: &[Splat],
        list: impl Iterator<Item = &'a [u32]>,
        tile: Tile,
        background: [f32; 3],
    ) {
        simd.dispatch(
            #[inline(always)]
            || match background == [0.0; 3] {
                true => self.draw_watched::<false>(splats, list, tile, &mut ()),
                false => self.draw_watched::<true>(splats, list, tile, &mut ()),
            },
        );
    }

    /// Returns the pixel at column `x` and row `y` of the tile. `background` must be that of [`Self::draw`].
    #[inline(always)]
    pub(super) fn pixel(&self, x: usize, y: usize, background: [f32; 3]) -> [f32; 3] {
        let Block { colour, transmittance, .. } = &self.blocks[x / SIDE][y / SIDE];
        let lane = y % SIDE * SIDE + x % SIDE;
        std::array::from_fn(|channel| colour[channel][lane] + transmittance[lane] * background[channel])
    }

    /// Draws like [`Self::draw`], and calls the [`Watch`]. The colours of blocks then include the background.
    #[inline(always)]
    pub(super) fn draw_over<'a>(
        &mut self,
        splats: &[Splat],
        list: impl Iterator<Item = &'a [u32]>,
        tile: Tile,
        background: [f32; 3],
        watch: &mut impl Watch,
    ) {
        if background == [0.0; 3] {
            return self.draw_watched::<false>(splats, list, tile, watch);
        }
        self.draw_watched::<true>(splats, list, tile, watch);
        for Block { colour, transmittance, .. } in self.blocks.as_flattened_mut() {
            for (channel, behind) in colour.iter_mut().zip(background) {
                channel.iter_mut().zip(&*transmittance).for_each(|(sum, share)| *sum += share * behind);
            }
        }
    }

    /// Draws like [`Self::draw`], and calls the [`Watch`]. The background is black unless `BACKGROUND` is set.
    #[inline(always)]
    pub(super) fn draw_watched<'a, const BACKGROUND: bool>(
        &mut self,
        splats: &[Splat],
        list: impl Iterator<Item = &'a [u32]>,
        tile: Tile,
        watch: &mut impl Watch,
    ) {
        let Self { blocks, open, queue } = self;
        let coordinates = tile.coordinates();
        for (column, blocks) in blocks.iter_mut().enumerate() {
            for (row, block) in blocks.iter_mut().enumerate() {
                let inside = tile.inside(column, row);
                open.set(column, row, inside != [0.0; LANES]);
                *block = Block { open: inside, ..Block::EMPTY };
            }
        }
        for slots in list.flat_map(|piece| piece.chunks(FETCHED)) {
            queue.fill(splats, slots, tile, &coordinates, *open);
            for at in 0..queue.len {
                let opacity = queue.block(at).0.opacity;
                alphas(&mut queue.lanes[at % QUEUED], opacity);
            }
            let mut any_finished = false;
            for at in 0..queue.len {
                let (splat, column, row) = queue.block(at);
                let alpha = &queue.lanes[at % QUEUED];
                let (counts, finished) = blend::<BACKGROUND>(&mut blocks[column][row], splat, alpha);
                if counts {
                    let [_, column, row] = queue.blocks[at % QUEUED];
                    watch.counts(splat, [column, row], alpha);
                }
                open.set(column, row, !finished);
                any_finished |= finished;
            }
            if any_finished && *open == BlockSet::NONE {
                break;
            }
        }
    }
}

/// Adds `splat` to the pixels of a block. Returns two flags: whether the splat shows in a pixel or finishes one, and
/// whether all pixels are finished afterwards.
///
/// Loops are short, and conditions are masks, so that each loop becomes a few vector instructions. The compiler would
/// turn other conditions into branches.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "lanes of several arrays side by side")]
fn blend<const BACKGROUND: bool>(block: &mut Block, splat: &Splat, alpha: &Lanes) -> (bool, bool) {
    let [red, green, blue] = splat.colour;
    let mut still_open = 0;
    let mut changed = 0;
    for lane in 0..LANES {
        // Where alpha is 0 an open pixel keeps its value, which is never below the minimum. A finished pixel stays 0.
        let left = block.open[lane] * (1.0 - alpha[lane]);
        let add = mask(left >= TRANSMITTANCE_MIN);
        let weight = f32::from_bits((alpha[lane] * block.open[lane]).to_bits() & add);
        let open = left.to_bits() & add;
        block.colour[0][lane] += red * weight;
        block.colour[1][lane] += green * weight;
        block.colour[2][lane] += blue * weight;
        if BACKGROUND {
            block.transmittance[lane] = f32::from_bits(open | (block.transmittance[lane].to_bits() & !add));
        }
        still_open |= open;
        changed |= open ^ block.open[lane].to_bits();
        block.open[lane] = f32::from_bits(open);
    }
    (changed != 0, still_open == 0)
}

/// Writes the exponents of a splat's opacities at the pixels of a block. Exponents that cannot count become the cutoff,
/// which cannot count either. Returns whether any exponent may count.
#[inline(always)]
fn powers(powers: &mut Lanes, splat: &Splat, x: &Lanes, y: &Lanes) -> bool {
    let Splat { conic: [a, b, c], cutoff, .. } = *splat;
    let mut any = 0;
    for lane in 0..LANES {
        let dx = splat.centre[0] - x[lane];
        let dy = splat.centre[1] - y[lane];
        let p = -0.5 * (a * dx * dx + c * dy * dy) - b * dx * dy;
        powers[lane] = if p > cutoff { p } else { cutoff };
        any |= mask(p > cutoff);
    }
    any != 0
}

/// Replaces the exponents of a block's pixels by the opacities of the splat there, or by 0 where the splat does not
/// count.
#[inline(always)]
fn alphas(lanes: &mut Lanes, opacity: f32) {
    for p in lanes {
        let value = opacity * exp_in_range(*p);
        let value = if value < ALPHA_MAX { value } else { ALPHA_MAX };
        let counts = (*p <= 0.0) & (value >= ALPHA_MIN);
        *p = if counts { value } else { 0.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::super::splat::PixelRect;
    use super::*;

    #[test]
    fn sets_of_blocks_are_rectangles_column_by_column() {
        let places = || (0..=BLOCKS).flat_map(|column| (0..=BLOCKS).map(move |row| [column, row]));
        for (first, end) in places().flat_map(|first| places().map(move |end| (first, end))) {
            let mut set = BlockSet::between(first, end);
            let found: Vec<[usize; 2]> = std::iter::from_fn(|| set.pop()).collect();
            let within = |k: usize, place: &[usize; 2]| (first[k]..end[k]).contains(&place[k]);
            let expected: Vec<[usize; 2]> =
                places().filter(|place| within(0, place) && within(1, place)).collect();
            assert_eq!(found, expected, "{first:?} {end:?}");
        }
        let mut set = BlockSet::between([0, 0], [BLOCKS; 2]);
        set.set(2, 1, false);
        assert_eq!(set.and(BlockSet::between([2, 0], [3, BLOCKS])).0.count_ones(), 3);
        set.set(2, 1, true);
        assert_eq!(set, BlockSet::between([0, 0], [BLOCKS; 2]));
    }

    /// The vector instructions that this machine has round as the plain ones do.
    #[test]
    fn the_instruction_set_makes_no_difference() {
        let mut state = 7_u32;
        let mut random = |low: f32, high: f32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            low + (high - low) * f32::from(u16::try_from(state >> 16).unwrap()) / 65_536.0
        };
        let splats: Vec<Splat> = (0..300)
            .map(|_| Splat {
                centre: [random(-10.0, 60.0), random(20.0, 90.0)],
                conic: [random(0.01, 0.5), random(-0.01, 0.01), random(0.01, 0.5)],
                opacity: random(0.0, 1.0),
                colour: std::array::from_fn(|_| random(0.0, 2.0)),
                cutoff: -8.0,
                pixels: PixelRect { min: [0; 2], max: [100; 2] },
                ..Splat::default()
            })
            .collect();
        let list: Vec<u32> = (0..300).collect();
        let list = || list.chunks(70);
        let (at, background) = (Tile::new([1, 3], [100; 2]), [0.1, 0.5, 0.9]);
        let draw = |simd: Simd, background| {
            let mut canvas = Canvas::default();
            canvas.draw(simd, &splats, list(), at, background);
            let places = (0..TILE * TILE).map(|k| (k % TILE, k / TILE));
            places.map(|(x, y)| canvas.pixel(x, y, background)).collect::<Vec<_>>()
        };
        let plain = draw(Simd::PLAIN, background);
        let on_black = draw(Simd::PLAIN, [0.0; 3]);
        for simd in Simd::available() {
            let bits =
                |pixels: &[[f32; 3]]| pixels.as_flattened().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&draw(simd, background)), bits(&plain), "{simd:?}");
            assert_eq!(bits(&draw(simd, [0.0; 3])), bits(&on_black), "{simd:?}");
        }
        assert!(
            plain.iter().zip(&on_black).all(|(a, b)| *a != background && a.iter().zip(b).all(|(a, b)| a > b))
        );
    }
}
