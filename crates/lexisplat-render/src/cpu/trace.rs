//! The splats of a tile and where they count. They are recorded while the tile is drawn, so that measuring need not
//! compute them again.

use super::lanes::Lanes;
use super::splat::Splat;

/// The splats that show in a pixel of a tile or finish one, from front to back, and the blocks where they do.
///
/// A pixel is finished after at most 2,350 splats, because each splat that counts takes at least 1/255 of its light. A
/// tile's trace therefore has at most 256 times as many marks, about 40 MB. Less than one MB is common.
#[derive(Debug, Default)]
pub(super) struct Trace {
    pub(super) splats: Vec<Splat>,
    /// The marks in the order of the splats, and for each splat in the order of its blocks.
    pub(super) marks: Vec<Mark>,
}

/// One splat in one block.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mark {
    /// Index of the splat in the trace.
    pub(super) splat: u32,
    /// Column and row of the block in the tile.
    pub(super) block: [u8; 2],
    /// Opacity of the splat at each pixel; 0 where it does not count.
    pub(super) alpha: Lanes,
}

impl Trace {
    /// Adds a mark of `splat`, which is the splat of the last mark or a splat behind it.
    #[inline(always)]
    pub(super) fn push(&mut self, splat: &Splat, block: [u8; 2], alpha: &Lanes) {
        if self.splats.last().is_none_or(|last| last.gaussian != splat.gaussian) {
            self.splats.push(*splat);
        }
        // The number of splats fits in `u32`.
        let splat = u32::try_from(self.splats.len() - 1).unwrap_or(u32::MAX);
        self.marks.push(Mark { splat, block, alpha: *alpha });
    }

    /// Empties the trace. Its memory is kept for the next tile.
    pub(super) fn clear(&mut self) {
        self.splats.clear();
        self.marks.clear();
    }
}
