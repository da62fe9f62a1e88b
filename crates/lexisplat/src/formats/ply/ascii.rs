//! Rows of an ASCII file. They become packed little-endian rows, a chunk at a time.

use std::ops::Range;

use super::columns::ROWS_PER_TASK;
use super::header::Header;
use super::names::shown;
use super::scalar::Scalar;
use crate::scene::extra::{ScalarType, with_scalar};
use crate::support::error::{Error, FormatError, Result};

/// The vertex lines of an ASCII file.
#[derive(Debug)]
pub(super) struct AsciiRows<'a> {
    file: &'a str,
    data: &'a [u8],
    /// The start of each chunk of [`ROWS_PER_TASK`] rows in `data`.
    starts: Vec<usize>,
    types: Vec<ScalarType>,
    row_bytes: usize,
}

impl<'a> AsciiRows<'a> {
    /// Finds the lines of element `index` of `header`, and checks that the file has as many lines as the header
    /// promises.
    pub(super) fn locate(
        file: &'a str,
        header: &Header,
        index: usize,
        row_bytes: usize,
        data: &'a [u8],
    ) -> Result<Self> {
        let vertex = &header.elements[index];
        let types: Vec<ScalarType> = vertex.properties.iter().filter_map(|p| p.kind.scalar()).collect();
        // Each value takes at least a digit and a separator. The last separator may be missing. Without this check a
        // few short lines could ask for many wide rows.
        let expected = vertex.count.saturating_mul(2 * types.len() as u64).saturating_sub(1);
        let found = data.len() as u64;
        if expected > found {
            let what = format!("element 'vertex' ({} rows of {} values)", vertex.count, types.len());
            return Err(Error::format(file, FormatError::Truncated { what, expected, found }));
        }
        // Elements without properties have no lines, because blank lines are skipped.
        let rows = |elements: &[super::header::Element]| {
            let filled = elements.iter().filter(|e| !e.properties.is_empty());
            filled.fold(0_u64, |sum, e| sum.saturating_add(e.count))
        };
        let (before, total) = (rows(&header.elements[..index]), rows(&header.elements));
        let vertices = before..before.saturating_add(vertex.count);
        let (mut starts, mut seen) = (Vec::new(), 0_u64);
        for (start, _) in lines(data, 0) {
            if vertices.contains(&seen) && (seen - before).is_multiple_of(ROWS_PER_TASK as u64) {
                starts.push(start);
            }
            seen += 1;
        }
        if seen != total {
            let what = if header.elements.len() == 1 { "vertices" } else { "rows in all its elements" };
            return Err(Error::malformed(
                file,
                format!("the header promises {total} {what}, the file holds {seen} rows"),
            ));
        }
        Ok(Self { file, data, starts, types, row_bytes })
    }

    /// Packs rows `range`. This is fastest if the range starts at a multiple of [`ROWS_PER_TASK`].
    pub(super) fn pack(&self, range: Range<usize>) -> Result<Vec<u8>> {
        let mut packed = Vec::with_capacity(range.len() * self.row_bytes);
        let start = self.starts.get(range.start / ROWS_PER_TASK).copied().unwrap_or(self.data.len());
        let before = range.start % ROWS_PER_TASK;
        for (row, (_, line)) in range.zip(lines(self.data, start).skip(before)) {
            let bad = |why: String| Error::malformed(self.file, format!("vertex {row}: {why}"));
            let line = std::str::from_utf8(line).map_err(|_| bad("not text".to_owned()))?;
            let mut words = line.split_ascii_whitespace();
            let mut found = 0;
            for (&ty, word) in self.types.iter().zip(&mut words) {
                with_scalar!(ty, T => T::push_text(word, &mut packed))
                    .ok_or_else(|| bad(format!("value {found}, '{}', is no {}", shown(word), ty.name())))?;
                found += 1;
            }
            found += words.count();
            if found != self.types.len() {
                return Err(bad(format!("{found} values, the header promises {}", self.types.len())));
            }
        }
        Ok(packed)
    }
}

/// Returns the lines from `start` on that are not blank, each with the offset of its first byte.
fn lines(data: &[u8], start: usize) -> impl Iterator<Item = (usize, &[u8])> {
    let mut at = start;
    std::iter::from_fn(move || {
        while at < data.len() {
            let start = at;
            let rest = &data[start..];
            let length = rest.iter().position(|&b| b == b'\n' || b == b'\r').unwrap_or(rest.len());
            at = start + length + 1;
            let line = &rest[..length];
            if line.iter().any(|b| !b.is_ascii_whitespace()) {
                return Some((start, line));
            }
        }
        None
    })
}
