//! Checks that kernels stay within the arrays of a part that was passed as bytes.

use super::constants::{COLUMN_GROUP, COLUMN_WORDS, ESCAPED};
use super::part::{ScenePart, word, words};
use super::part_layout::{Section, ShKind};

/// Number of bytes of the offset and the counts of a group of Gaussians.
const GROUP_BYTES: usize = 4 * COLUMN_WORDS as usize;

impl ScenePart<'_> {
    /// Checks the offsets, counts, atom numbers and escapes of sparse codes. The error tells what is wrong.
    pub(super) fn check_codes(&self) -> Result<(), String> {
        let ShKind::Codes { index, value, atoms } = self.outline.layout.kind else { return Ok(()) };
        let most = self.outline.layout.degree.rest();
        let nonzeros = self.section(Section::Nonzeros);
        let mut escaped = words(self.section(Section::Escaped));
        // Offset of the group's nonzeros, in words.
        let mut at = 0_usize;
        let groups = self.section(Section::Columns).chunks_exact(GROUP_BYTES);
        for (group, first) in groups.zip((0_u32..).step_by(COLUMN_GROUP as usize)) {
            if word(group).is_none_or(|offset| offset as usize != at) {
                return Err(format!("codes of Gaussian {first} begin at another word than {at}"));
            }
            let mut total = 0;
            for (&count, i) in group[4..].iter().zip(first..) {
                if u32::from(count) == ESCAPED {
                    if i >= self.outline.len || escaped.next() != Some(i) {
                        return Err(format!("Gaussian {i} is not the next of the escapes"));
                    }
                } else if usize::from(count) > most || (i >= self.outline.len && count > 0) {
                    return Err(format!("Gaussian {i} has {count} nonzeros"));
                } else {
                    total += usize::from(count);
                }
            }
            // A group has at most 16 times 72 nonzeros.
            let index_bytes = total * index as usize;
            let end = at + index_bytes.div_ceil(4) + (total * value as usize).div_ceil(4);
            let own = nonzeros.get(4 * at..4 * end);
            let own = own.ok_or_else(|| format!("codes of Gaussian {first} end after the nonzeros"))?;
            if !are_below(&own[..index_bytes], index, atoms) {
                return Err(format!(
                    "an atom of Gaussian {first} or of the 15 after it is not below {atoms}"
                ));
            }
            at = end;
        }
        let left = escaped.len();
        if at != self.outline.words as usize || left > 0 {
            return Err(format!("nonzeros end at word {at} with {left} escapes left"));
        }
        Ok(())
    }
}

/// Returns whether all numbers, of `width` bytes each, are below `atoms`.
fn are_below(numbers: &[u8], width: u32, atoms: u32) -> bool {
    match width {
        1 => numbers.iter().all(|&number| u32::from(number) < atoms),
        _ => numbers
            .chunks_exact(2)
            .all(|number| u32::from(u16::from_le_bytes([number[0], number[1]])) < atoms),
    }
}
