//! Ways to change a packed file of version 3 that leave its container and the checksums of its ranges whole.

use lexisplat_testing::Random;
use serde_json::Value;

use crate::parts::Parts;

/// Tensors that are changed as they lie.
pub(crate) const TENSORS: [&str; 3] = ["packed.head", "packed.data", "packed.order"];
/// Bytes of a range in the index, which ends the head: chunk, kind, length, checksum of bytes and of integers.
const RANGE: usize = 17;
/// Bytes of a chunk before them: layer, Gaussians, first cell, bounds.
const CHUNK: usize = 37;

/// How many chunks and ranges a file has.
#[derive(Clone, Copy)]
pub(crate) struct Index {
    pub(crate) chunks: usize,
    pub(crate) ranges: usize,
}

/// The bytes of a number.
fn word(bytes: &mut [u8], at: usize) -> &mut [u8; 4] {
    bytes[at..].first_chunk_mut().unwrap()
}

impl Index {
    /// That of a file as it was written.
    pub(crate) fn of(parts: &mut Parts) -> Self {
        let data = parts.tensor("packed.data").unwrap().len();
        let head = parts.tensor("packed.head").unwrap();
        let (mut length, mut ranges, mut chunks) = (0, 0, 0);
        while length < data {
            ranges += 1;
            let at = head.len() - RANGE * ranges;
            length += u32::from_le_bytes(*word(head, at + 5)) as usize;
            chunks = chunks.max(1 + u32::from_le_bytes(*word(head, at)) as usize);
        }
        assert_eq!(length, data, "ranges cover the data");
        Self { chunks, ranges }
    }

    /// Where range `k` starts in a head, if the head is long enough.
    fn range(self, head: &[u8], k: usize) -> Option<usize> {
        head.len().checked_sub(RANGE * (self.ranges - k))
    }

    fn chunk(self, head: &[u8], c: usize) -> Option<usize> {
        head.len().checked_sub(RANGE * self.ranges + CHUNK * (self.chunks - c))
    }

    /// Makes the checksums of all ranges fit the data.
    pub(crate) fn seal(self, parts: &mut Parts) {
        let data = parts.tensor("packed.data").cloned().unwrap_or_default();
        let Some(head) = parts.tensor("packed.head") else { return };
        let mut start = 0_usize;
        for k in 0..self.ranges {
            let Some(at) = self.range(head, k) else { continue };
            let length = u32::from_le_bytes(*word(head, at + 5)) as usize;
            let bytes = data.get(start.min(data.len())..).unwrap_or_default();
            *word(head, at + 9) = crc32fast::hash(&bytes[..length.min(bytes.len())]).to_le_bytes();
            start = start.saturating_add(length);
        }
    }

    /// Changes bytes of the head before the ranges, of which most are tables.
    pub(crate) fn change_head(self, parts: &mut Parts, random: &mut Random) {
        let head = parts.tensor("packed.head").unwrap();
        let end = self.range(head, 0).unwrap();
        let several = 1 + random.below(4);
        for _ in 0..several {
            let (at, width) = (random.below(end), 1 + random.below(4));
            let noise = [random.byte(), 0, 0xff, 0x7f, 0x80][random.below(5)];
            match random.below(8) {
                0 => head[at] ^= 1 << random.below(8),
                1 => head[at] = random.byte(),
                2 => head[at] = head[at].wrapping_add(1),
                // What follows stays where it is, and all of it moves.
                3 if several == 1 => drop(head.drain(at..(at + width).min(end))),
                4 if several == 1 => drop(head.splice(at..at, vec![noise; width])),
                _ => head[at..(at + width).min(end)].fill(noise),
            }
        }
        parts.fit_shapes();
    }

    /// Changes bytes of some ranges.
    pub(crate) fn change_data(self, parts: &mut Parts, random: &mut Random) {
        let data = parts.tensor("packed.data").unwrap();
        match random.below(12) {
            0 => data.fill_with(|| random.byte()),
            1 => data.fill(0),
            2 => data.fill(0xff),
            3 => data.reverse(),
            _ => {
                for _ in 0..1 + random.below(3) {
                    let (at, several) = (random.below(data.len()), 1 + random.below(16));
                    data.iter_mut().skip(at).take(several).for_each(|b| *b ^= random.byte());
                }
            }
        }
    }

    /// Changes what the index says of chunks and ranges.
    pub(crate) fn change_index(self, parts: &mut Parts, random: &mut Random) {
        let (a, b) = (random.below(self.ranges), random.below(self.ranges));
        let (chunk, kind) = (random.below(self.chunks), random.below(10));
        let noise: Vec<u8> = (0..1 + random.below(8)).map(|_| random.byte()).collect();
        let numbers = [0, 1, 2, 3, 7, 8, 59, 61, 1024, 8000, 32_769, 65_536, 65_537, u32::MAX];
        let number = numbers[random.below(numbers.len())];
        let head = parts.tensor("packed.head").unwrap();
        let ([a, b], chunk) =
            ([a, b].map(|k| self.range(head, k).unwrap()), self.chunk(head, chunk).unwrap());
        match kind {
            0 => *word(head, a) = number.to_le_bytes(),
            1 => head[a + 4] = number.to_le_bytes()[0],
            2 => *word(head, a + 5) = number.to_le_bytes(),
            // Bytes of one range become those of another.
            3..=5 => {
                let [x, y] = [a, b].map(|at| u32::from_le_bytes(*word(head, at + 5)));
                let moved = 2 * u32::try_from(random.below(x as usize / 2 + 1)).unwrap();
                *word(head, a + 5) = (x - moved).to_le_bytes();
                if a != b {
                    *word(head, b + 5) = (y + moved).to_le_bytes();
                }
            }
            6 => (0..RANGE).for_each(|i| head.swap(a + i, b + i)),
            // Noise after the last range.
            7 => {
                let last = self.range(head, self.ranges - 1).unwrap();
                let length = u32::from_le_bytes(*word(head, last + 5)) + u32::try_from(noise.len()).unwrap();
                *word(head, last + 5) = length.to_le_bytes();
                parts.tensor("packed.data").unwrap().extend(noise);
            }
            // Another number of Gaussians of a chunk, and of all.
            8 => {
                let old = u64::from(u32::from_le_bytes(*word(head, chunk + 1)));
                *word(head, chunk + 1) = number.to_le_bytes();
                let all: u64 = parts.metadata["gaussians"].as_str().unwrap().parse().unwrap();
                let now = (all - old + u64::from(number)).to_string();
                parts.metadata.insert("gaussians".to_owned(), Value::from(now));
            }
            _ => head[chunk..][..noise.len()].copy_from_slice(&noise),
        }
        parts.fit_shapes();
    }

    /// Makes all ranges of a kind so long, and drops the bytes that they had beyond.
    pub(crate) fn shorten(self, parts: &mut Parts, kind: u8, most: u32) {
        let mut data = parts.tensor("packed.data").unwrap().as_slice().to_vec();
        let head = parts.tensor("packed.head").unwrap();
        let mut kept = Vec::new();
        for k in 0..self.ranges {
            let at = self.range(head, k).unwrap();
            let length = u32::from_le_bytes(*word(head, at + 5));
            let range: Vec<u8> = data.drain(..length as usize).collect();
            let own = if head[at + 4] == kind { length.min(most) } else { length };
            *word(head, at + 5) = own.to_le_bytes();
            kept.extend_from_slice(&range[..own as usize]);
        }
        *parts.tensor("packed.data").unwrap() = kept;
        parts.fit_shapes();
        self.seal(parts);
    }

    /// Says that all chunks have so many Gaussians.
    pub(crate) fn claim(self, parts: &mut Parts, gaussians: u32) {
        let head = parts.tensor("packed.head").unwrap();
        for c in 0..self.chunks {
            let at = self.chunk(head, c).unwrap();
            *word(head, at + 1) = gaussians.to_le_bytes();
        }
        let all = self.chunks as u64 * u64::from(gaussians);
        parts.metadata.insert("gaussians".to_owned(), Value::from(all.to_string()));
    }
}
