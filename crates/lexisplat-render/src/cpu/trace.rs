//! Where the splats of a tile count, kept from drawing it, so that measuring need not work it out again.

use super::lanes::Lanes;
use super::splat::Splat;

/// The splats that show in a pixel of a tile or finish one, from front to back, and where.
///
/// A pixel is finished after at most 2,350 splats, since each that counts takes at least 1/255 of its light. A tile's
/// trace therefore has at most 256 times as many marks, about 40 MB; less than one MB is common.
#[derive(Debug, Default)]
pub(super) struct Trace {
    pub(super) splats: Vec<Splat>,
    /// In the order of the splats, and for each in the order of its blocks.
    pub(super) marks: Vec<Mark>,
}

/// One splat in one block.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mark {
    /// The splat's place in the trace.
    pub(super) splat: u32,
    /// Column and row of the block in the tile.
    pub(super) block: [u8; 2],
    /// Its opacity at each pixel; 0 where it does not count.
    pub(super) alpha: Lanes,
}

impl Trace {
    /// Adds a mark of `splat`, which is that of the last mark or one behind it.
    #[inline(always)]
    pub(super) fn push(&mut self, splat: &Splat, block: [u8; 2], alpha: &Lanes) {
        if self.splats.last().is_none_or(|last| last.gaussian != splat.gaussian) {
            self.splats.push(*splat);
        }
        // Splats are counted in u32.
        let splat = u32::try_from(self.splats.len() - 1).unwrap_or(u32::MAX);
        self.marks.push(Mark { splat, block, alpha: *alpha });
    }

    /// Empties it. Its memory stays for the next tile.
    pub(super) fn clear(&mut self) {
        self.splats.clear();
        self.marks.clear();
    }
}
