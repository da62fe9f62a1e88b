//! Chunks: the pieces of a scene's parts on the GPU. Parts are cut where their arrays do not fit in a binding.

use std::ops::Range;

use crate::error::{Error, Result};

use super::buffer::Buffer;
use super::constants::{COLUMN_GROUP, COLUMN_WORDS, GROUP};
use super::device::Gpu;
use super::part::{ScenePart, word, words};
use super::part_layout::{Section, ShKind};

/// Number of words for the offset and the counts of a group of Gaussians.
const GROUP_WORDS: usize = COLUMN_WORDS as usize;

/// The buffers of a run of Gaussians, and the numbers that describe them to kernels.
#[derive(Debug)]
pub(super) struct ChunkBuffers {
    /// Number of Gaussians.
    pub(super) count: u32,
    pub(super) escapes: u32,
    /// Offset in the columns where the numbers of the escaped Gaussians begin.
    pub(super) escapes_at: u32,
    /// Offset in the nonzeros where the exact rows of the escaped Gaussians begin.
    pub(super) exact_at: u32,
    pub(super) bodies: Buffer,
    pub(super) shapes: Buffer,
    /// Buffers of the radiance kernel from binding 6 on: dense rows; or base colours, columns and nonzeros.
    pub(super) sh: Vec<Buffer>,
}

impl ChunkBuffers {
    /// Returns the number of blocks. The last block may be short.
    pub(super) fn blocks(&self) -> u32 {
        self.count.div_ceil(GROUP)
    }
}

/// A run of consecutive Gaussians of a part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Cut {
    pub(super) gaussians: Range<usize>,
    /// Words of the nonzeros of these Gaussians.
    words: Range<usize>,
    /// Escapes of these Gaussians.
    escapes: Range<usize>,
}

impl ScenePart<'_> {
    /// Cuts the part into runs. Each array of a run fits in `limit` bytes. All runs but the last consist of whole blocks.
    pub(super) fn cuts(&self, limit: u64) -> Result<Vec<Cut>> {
        let (len, block) = (self.len() as usize, GROUP as usize);
        let mut cuts: Vec<Cut> = Vec::new();
        for first in (0..len).step_by(block) {
            let next = self.run(first..(first + block).min(len));
            let found = self.largest_array(&next);
            if found > limit {
                return Err(Error::gpu_limit("bytes of 256 Gaussians on the GPU", found, limit));
            }
            if let Some(last) = cuts.last_mut() {
                let both = Cut {
                    gaussians: last.gaussians.start..next.gaussians.end,
                    words: last.words.start..next.words.end,
                    escapes: last.escapes.start..next.escapes.end,
                };
                if self.largest_array(&both) <= limit {
                    *last = both;
                    continue;
                }
            }
            cuts.push(next);
        }
        Ok(cuts)
    }

    /// Returns the run of the Gaussians in `range`, which begins at the start of a block and ends at the end of a block
    /// or of the part.
    fn run(&self, range: Range<usize>) -> Cut {
        let columns = self.section(Section::Columns);
        let offset = |i: usize| {
            let group = i.div_ceil(COLUMN_GROUP as usize);
            let offset = columns.get(4 * GROUP_WORDS * group..).and_then(word);
            offset.unwrap_or(self.outline.words) as usize
        };
        let escaped = self.section(Section::Escaped);
        let before = |end: usize| {
            let (escapes, _) = escaped.as_chunks::<4>();
            escapes.partition_point(|&number| (u32::from_le_bytes(number) as usize) < end)
        };
        Cut {
            words: offset(range.start)..offset(range.end),
            escapes: before(range.start)..before(range.end),
            gaussians: range,
        }
    }

    /// Returns the number of bytes of the largest array of a run.
    fn largest_array(&self, cut: &Cut) -> u64 {
        let [n, words, escapes] = [cut.gaussians.len(), cut.words.len(), cut.escapes.len()].map(|v| v as u64);
        let layout = self.outline.layout;
        let groups = n.div_ceil(COLUMN_GROUP.into());
        let columns = 4 * (GROUP_WORDS as u64 * groups + escapes);
        let nonzeros = 4 * words + escapes * layout.exact_bytes();
        let shapes = n * size_of::<[f32; 8]>() as u64;
        shapes.max(n * layout.colour_bytes()).max(columns).max(nonzeros)
    }

    /// Uploads a run.
    pub(super) async fn upload(&self, gpu: &Gpu, cut: &Cut) -> Result<ChunkBuffers> {
        let elements = |section, range: &Range<usize>, size: usize| {
            let bytes = self.section(section);
            bytes.get(range.start * size..range.end * size).unwrap_or_default()
        };
        let of_gaussians = |section, size| elements(section, &cut.gaussians, size);
        let layout = self.outline.layout;
        let in_memory = |bytes: u64| usize::try_from(bytes).unwrap_or(usize::MAX);
        let bodies = of_gaussians(Section::Bodies, size_of::<[f32; 4]>());
        let shapes = of_gaussians(Section::Shapes, size_of::<[f32; 8]>());
        let colours = of_gaussians(Section::Colours, in_memory(layout.colour_bytes()));
        let columns = self.columns(cut);
        let nonzeros = elements(Section::Nonzeros, &cut.words, 4);
        let exact = elements(Section::Exact, &cut.escapes, in_memory(layout.exact_bytes()));
        let mut arrays = vec![("bodies", [bodies, &[]]), ("shapes", [shapes, &[]])];
        if let ShKind::Codes { .. } = layout.kind {
            let columns = bytemuck::cast_slice(&columns);
            arrays.extend([("base colours", [colours, &[]]), ("columns", [columns, &[]])]);
            arrays.push(("nonzeros", [nonzeros, exact]));
        } else {
            arrays.push(("dense rows", [colours, &[]]));
        }
        let make = || {
            let size = |pieces: &[&[u8]; 2]| pieces.iter().map(|piece| piece.len() as u64).sum();
            arrays.iter().map(|(label, pieces)| gpu.storage(label, size(pieces))).collect::<Result<Vec<_>>>()
        };
        let buffers = gpu.checked("a part of a scene", make).await?;
        for (buffer, (_, [first, second])) in buffers.iter().zip(&arrays) {
            gpu.write(buffer, 0, first).await?;
            gpu.write(buffer, first.len() as u64, second).await?;
        }
        let mut buffers = buffers.into_iter();
        let (Some(bodies), Some(shapes)) = (buffers.next(), buffers.next()) else {
            return Err(Error::Gpu { problem: "no buffers".to_owned() });
        };
        // Numbers of Gaussians and of words fit in 32 bits.
        let number = |v: usize| u32::try_from(v).unwrap_or(u32::MAX);
        Ok(ChunkBuffers {
            count: number(cut.gaussians.len()),
            escapes: number(cut.escapes.len()),
            escapes_at: number(columns.len() - cut.escapes.len()),
            exact_at: number(cut.words.len()),
            bodies,
            shapes,
            sh: buffers.collect(),
        })
    }

    /// Returns the offsets and counts of a run, then the numbers of its escaped Gaussians, counted from the start of the
    /// run.
    fn columns(&self, cut: &Cut) -> Vec<u32> {
        let group = COLUMN_GROUP as usize;
        let groups = cut.gaussians.start / group..cut.gaussians.end.div_ceil(group);
        let bytes = self.section(Section::Columns);
        let own = bytes.get(4 * GROUP_WORDS * groups.start..4 * GROUP_WORDS * groups.end).unwrap_or_default();
        let mut columns: Vec<u32> = words(own).collect();
        let first = u32::try_from(cut.words.start).unwrap_or(u32::MAX);
        columns.iter_mut().step_by(GROUP_WORDS).for_each(|offset| *offset -= first);
        let escaped = words(self.section(Section::Escaped));
        let first = u32::try_from(cut.gaussians.start).unwrap_or(u32::MAX);
        let own = escaped.skip(cut.escapes.start).take(cut.escapes.len());
        columns.extend(own.map(|number| number - first));
        columns
    }
}
