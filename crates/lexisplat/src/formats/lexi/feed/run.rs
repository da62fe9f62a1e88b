//! A run of bytes of a file that arrives in pieces.

use std::ops::Range;

/// Bytes of a file, as far as they are there. Memory grows with those that came, and never beyond the run.
#[derive(Debug)]
pub(super) struct Run {
    start: u64,
    len: usize,
    bytes: Vec<u8>,
    /// The bytes that are there, as runs that do not touch.
    there: Vec<Range<usize>>,
}

impl Run {
    pub(super) fn new(start: u64, len: usize) -> Self {
        Self { start, len, bytes: Vec::new(), there: Vec::new() }
    }

    pub(super) fn len(&self) -> usize {
        self.len
    }

    pub(super) fn end(&self) -> u64 {
        self.start.saturating_add(self.len as u64)
    }

    /// Makes a whole run longer.
    pub(super) fn grow(&mut self, len: usize) {
        self.len = self.len.max(len);
    }

    pub(super) fn is_whole(&self) -> bool {
        self.len == 0 || self.there.first() == Some(&(0..self.len))
    }

    /// The first bytes in the file that are missing.
    pub(super) fn gap(&self) -> Option<Range<u64>> {
        let start = self.there.first().filter(|there| there.start == 0).map_or(0, |there| there.end);
        let next = self.there.iter().map(|there| there.start).find(|&next| next > start);
        let end = next.unwrap_or(self.len);
        (start < end).then(|| self.start + start as u64..self.start + end as u64)
    }

    /// The bytes, if all of them are there.
    pub(super) fn whole(&self) -> Option<&[u8]> {
        self.bytes.get(..self.len).filter(|_| self.is_whole())
    }

    /// Takes those of the bytes from `at` of the file that are in the run.
    pub(super) fn put(&mut self, at: u64, bytes: &[u8]) {
        let from = at.max(self.start);
        let to = at.saturating_add(bytes.len() as u64).min(self.end());
        let index = |offset: u64, start: u64| usize::try_from(offset.checked_sub(start)?).ok();
        let (Some(start), Some(end)) = (index(from, self.start), index(to, self.start)) else { return };
        let (Some(first), true) = (index(from, at), start < end) else { return };
        let Some(bytes) = bytes.get(first..first + (end - start)) else { return };
        if self.bytes.len() < end {
            // Twice as much at a time, so that a run of small pieces is not copied for each.
            let room = (2 * self.bytes.len()).clamp(end, self.len);
            self.bytes.reserve_exact(room - self.bytes.len());
            self.bytes.resize(end, 0);
        }
        if let Some(to) = self.bytes.get_mut(start..end) {
            to.copy_from_slice(bytes);
        }
        let first = self.there.partition_point(|there| there.end < start);
        let last = self.there.partition_point(|there| there.start <= end);
        let touched = self.there.get(first..last).unwrap_or_default();
        let start = touched.first().map_or(start, |there| there.start.min(start));
        let end = touched.last().map_or(end, |there| there.end.max(end));
        self.there.splice(first..last, std::iter::once(start..end));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_in_any_order_make_a_run() {
        let file: Vec<u8> = (0..40).collect();
        // Beyond both ends, twice, touching and apart.
        let pieces: [(u8, u8); 9] =
            [(30, 40), (0, 4), (12, 15), (10, 12), (11, 14), (20, 21), (22, 31), (14, 20), (21, 22)];
        let mut run = Run::new(10, 20);
        let mut there = [false; 40];
        for (i, (from, to)) in pieces.into_iter().enumerate() {
            assert!(run.whole().is_none(), "{i}");
            run.put(from.into(), &file[from.into()..to.into()]);
            there[from.into()..to.into()].fill(true);
            let gap = (10..30).find(|&i| !there[i]).map(|start| {
                let end = (start..30).find(|&i| there[i]).unwrap_or(30);
                start as u64..end as u64
            });
            assert_eq!(run.gap(), gap, "{i}");
            assert!(run.bytes.capacity() <= 20);
        }
        assert_eq!(run.whole(), Some(&file[10..30]));
    }

    #[test]
    fn memory_grows_with_what_came() {
        let mut run = Run::new(1 << 40, 1 << 40);
        run.put(1 << 40, &[1; 100]);
        assert!(run.bytes.capacity() <= 200 && !run.is_whole());
        assert_eq!(run.gap(), Some((1 << 40) + 100..1 << 41));
        run.put(u64::MAX - 3, &[1; 100]);
        assert_eq!(run.bytes.len(), 100);
    }
}
