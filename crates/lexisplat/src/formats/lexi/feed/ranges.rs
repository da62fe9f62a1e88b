//! The ranges of a file, as far as they came.

use std::ops::Range;

use super::options::FeedOptions;
use super::run::Run;
use crate::packed::{AvailableRanges, Decoder, Outline, PackedHead, RangeKind, RangeOutline};
use crate::support::crc32;
use crate::support::error::{Error, FormatError, Result};

/// Largest number of bytes between two ranges that are asked for with them, because another request takes longer. They are
/// what a link of 10 Mbit/s brings in 3 ms.
const SKIPPED: u64 = 4 << 10;

/// The decoder of a file, and its ranges.
#[derive(Debug)]
pub(super) struct Ranges {
    pub(super) head: PackedHead,
    pub(super) decoder: Decoder,
    pub(super) outline: Outline,
    /// Where the data start in the file.
    data_start: u64,
    states: Vec<State>,
    /// The ranges in the order in which they are asked for.
    order: Vec<usize>,
    /// The ranges of each chunk.
    of_chunk: Vec<Vec<usize>>,
    /// Bytes of ranges that are held, or for which there is room because a part of them is.
    pub(super) held: u64,
}

/// How much of a range is there.
#[derive(Debug)]
enum State {
    /// It is not asked for.
    Unwanted,
    Missing,
    Part(Run),
    /// It is whole, and its checksum holds.
    Whole(Run),
    /// It was there.
    Gone,
}

impl Ranges {
    pub(super) fn new(
        head: PackedHead,
        decoder: Decoder,
        outline: Outline,
        data_start: u64,
        options: &FeedOptions,
    ) -> Self {
        let mut of_chunk = vec![Vec::new(); outline.chunks.len()];
        for (r, range) in outline.ranges.iter().enumerate() {
            if let Some(ranges) = of_chunk.get_mut(range.chunk) {
                ranges.push(r);
            }
        }
        let wanted = |range: &RangeOutline| {
            is_asked_for(range.kind, options) && is_near(&outline, range.chunk, options)
        };
        let state = |range| if wanted(range) { State::Missing } else { State::Unwanted };
        let states = outline.ranges.iter().map(state).collect();
        let order = order(&outline, options);
        Self { head, decoder, data_start, states, order, of_chunk, held: 0, outline }
    }

    fn range(&self, r: usize) -> Range<u64> {
        self.outline.ranges.get(r).map(|range| range.bytes.clone()).unwrap_or_default()
    }

    /// Returns the bytes to ask for next, range by range in the order of need, as far as there is room for `room` bytes.
    fn missing(&self, room: u64) -> impl Iterator<Item = Range<u64>> {
        let mut left = room;
        let gap = move |&r: &usize| match self.states.get(r)? {
            State::Part(part) => Some(part.gap()),
            State::Missing => {
                let range = self.range(r);
                left = left.checked_sub(range.end - range.start)?;
                Some(Some(range))
            }
            _ => Some(None),
        };
        self.order.iter().map_while(gap).flatten()
    }

    /// Returns the next run of bytes to ask for, if there is room for `room` bytes.
    pub(super) fn wants(&self, room: u64) -> Option<Range<u64>> {
        let mut missing = self.missing(room);
        let first = missing.next()?;
        let end =
            missing.try_fold(first.end, |end, next| if next.start == end { Ok(next.end) } else { Err(end) });
        Some(first.start..end.unwrap_or_else(|end| end))
    }

    /// Returns the next runs of bytes to ask for besides `asked`, if there is room for `room` bytes: at most `most` runs of at
    /// most `longest` bytes, unless a single range has more. They are made of the next `most * longest` bytes in the order of
    /// need. The run whose first range is needed most is the first.
    pub(super) fn runs(&self, room: u64, asked: &[Range<u64>], most: usize, longest: u64) -> Vec<Range<u64>> {
        let is_new = |range: &Range<u64>| {
            asked.iter().all(|asked| asked.end <= range.start || range.end <= asked.start)
        };
        let mut left = longest.saturating_mul(most as u64);
        let fits = |range: &Range<u64>| {
            let was_left = left;
            left = left.saturating_sub(range.end - range.start);
            was_left > 0
        };
        let next = self.missing(room).filter(is_new).take_while(fits);
        let mut next: Vec<(usize, Range<u64>)> = next.enumerate().collect();
        next.sort_unstable_by_key(|(_, range)| range.start);
        let mut runs: Vec<(usize, Range<u64>)> = Vec::new();
        for (need, range) in next {
            match runs.last_mut() {
                Some((first, run))
                    if range.start - run.end <= SKIPPED && range.end - run.start <= longest =>
                {
                    (*first, run.end) = (need.min(*first), range.end);
                }
                _ => runs.push((need, range)),
            }
        }
        runs.sort_unstable_by_key(|(need, _)| *need);
        runs.into_iter().take(most).map(|(_, run)| run).collect()
    }

    /// The ranges of which there is something in these bytes of the file.
    fn touched(&self, at: u64, end: u64) -> Range<usize> {
        let first = self.outline.ranges.partition_point(|range| range.bytes.end <= at);
        if at >= end {
            return first..first;
        }
        first..self.outline.ranges.partition_point(|range| range.bytes.start < end).max(first)
    }

    /// Bytes that more have to be held if `bytes` from `at` of the file are taken.
    pub(super) fn more(&self, at: u64, bytes: &[u8]) -> u64 {
        let end = at.saturating_add(bytes.len() as u64);
        let missing = self.touched(at, end).filter(|&r| matches!(self.states.get(r), Some(State::Missing)));
        missing.map(|r| self.range(r)).map(|range| range.end - range.start).fold(0, u64::saturating_add)
    }

    /// Takes what is wanted of `bytes` from `at` of the file. Ranges whose checksum does not hold are dropped, and the first of
    /// them is the error.
    pub(super) fn take(&mut self, at: u64, bytes: &[u8]) -> Result<()> {
        let mut result = Ok(());
        for r in self.touched(at, at.saturating_add(bytes.len() as u64)) {
            let range = self.range(r);
            let Some(state) = self.states.get_mut(r) else { continue };
            if matches!(state, State::Missing) {
                let len = usize::try_from(range.end - range.start);
                let Ok(len) = len else { continue };
                self.held += len as u64;
                *state = State::Part(Run::new(range.start, len));
            }
            let State::Part(run) = state else { continue };
            run.put(at, bytes);
            let Some(whole) = run.whole() else { continue };
            let sum = crc32::hash(whole);
            let run = std::mem::replace(run, Run::new(0, 0));
            match self.outline.ranges.get(r).filter(|range| range.checksum != sum) {
                None => *state = State::Whole(run),
                Some(wrong) => {
                    *state = State::Missing;
                    self.held -= run.len() as u64;
                    result = result.and(Err(self.wrong(wrong)));
                }
            }
        }
        result
    }

    fn wrong(&self, range: &RangeOutline) -> Error {
        let k = self.outline.number(range);
        let covered = format!("range {k} of chunk {}", range.chunk);
        Error::format(&self.head.file, FormatError::Checksum { covered })
    }

    /// The states of the ranges of chunk `c`.
    fn of(&self, c: usize) -> impl Iterator<Item = (RangeKind, &State)> {
        let ranges = self.of_chunk.get(c).map(Vec::as_slice).unwrap_or_default();
        ranges.iter().filter_map(|&r| Some((self.outline.ranges.get(r)?.kind, self.states.get(r)?)))
    }

    /// Whether chunk `c` can be decoded.
    pub(super) fn is_ready(&self, c: usize) -> bool {
        self.of(c).any(|(kind, state)| kind == RangeKind::Base && matches!(state, State::Whole(_)))
    }

    /// Whether all ranges of chunk `c` that are asked for came.
    pub(super) fn is_complete(&self, c: usize) -> bool {
        !self.of(c).any(|(_, state)| matches!(state, State::Missing | State::Part(_)))
    }

    /// Bytes of chunk `c` that are held.
    pub(super) fn bytes_of(&self, c: usize) -> u64 {
        let bytes = self.of(c).map(|(_, state)| match state {
            State::Part(run) | State::Whole(run) => run.len() as u64,
            _ => 0,
        });
        bytes.sum()
    }

    /// Drops the bytes of chunk `c`.
    pub(super) fn forget(&mut self, c: usize) {
        for &r in self.of_chunk.get(c).map(Vec::as_slice).unwrap_or_default() {
            let Some(state) = self.states.get_mut(r) else { continue };
            *state = match std::mem::replace(state, State::Unwanted) {
                State::Whole(run) => {
                    self.held -= run.len() as u64;
                    State::Gone
                }
                State::Part(run) => {
                    self.held -= run.len() as u64;
                    State::Unwanted
                }
                State::Missing => State::Unwanted,
                other => other,
            };
        }
    }

    /// Holds and asks for the ranges `chosen` alone, in this order.
    pub(super) fn hold(&mut self, chosen: &[usize]) {
        let mut is_chosen = vec![false; self.states.len()];
        for &r in chosen {
            if let Some(chosen) = is_chosen.get_mut(r) {
                *chosen = true;
            }
        }
        for (state, is_chosen) in self.states.iter_mut().zip(is_chosen) {
            match (&*state, is_chosen) {
                (State::Unwanted | State::Gone, true) => *state = State::Missing,
                (State::Part(run) | State::Whole(run), false) => {
                    self.held -= run.len() as u64;
                    *state = State::Unwanted;
                }
                (State::Missing | State::Gone, false) => *state = State::Unwanted,
                _ => {}
            }
        }
        self.order = chosen.to_vec();
    }

    /// Asks for chunk `c`.
    pub(super) fn want(&mut self, c: usize, options: &FeedOptions) {
        for &r in self.of_chunk.get(c).map(Vec::as_slice).unwrap_or_default() {
            let asked_for = self.outline.ranges.get(r).is_some_and(|range| is_asked_for(range.kind, options));
            if let Some(state) = self.states.get_mut(r)
                && asked_for
                && matches!(state, State::Unwanted | State::Gone)
            {
                *state = State::Missing;
            }
        }
    }

    /// Where the whole ranges of chunk `c` that are held are in the file, and their bytes.
    pub(super) fn whole(&self, c: usize) -> impl Iterator<Item = (u64, &[u8])> {
        let ranges = self.of_chunk.get(c).map(Vec::as_slice).unwrap_or_default();
        ranges.iter().filter_map(|&r| match self.states.get(r)? {
            State::Whole(run) => Some((self.range(r).start, run.whole()?)),
            _ => None,
        })
    }

    fn base(&self, c: usize) -> Option<usize> {
        let is_base = |&&r: &&usize| self.outline.ranges.get(r).is_some_and(|r| r.kind == RangeKind::Base);
        self.of_chunk.get(c)?.iter().find(is_base).copied()
    }

    /// Whether the base of chunk `c` came.
    pub(super) fn base_came(&self, c: usize) -> bool {
        let state = self.base(c).and_then(|r| self.states.get(r));
        matches!(state, Some(State::Whole(_) | State::Gone))
    }

    /// Takes the base of chunk `c` for one that came and is not held, or for one that did not come. A base that is held stays.
    pub(super) fn note_base(&mut self, c: usize, came: bool) {
        if let Some(state) = self.base(c).and_then(|r| self.states.get_mut(r))
            && matches!(state, State::Unwanted | State::Missing | State::Gone)
        {
            *state = if came { State::Gone } else { State::Unwanted };
        }
    }

    fn state_at(&self, start: u64) -> Option<&State> {
        let start = self.data_start.checked_add(start)?;
        let r = self.outline.ranges.partition_point(|range| range.bytes.end <= start);
        let is_it = self.outline.ranges.get(r).is_some_and(|range| range.bytes.start == start);
        self.states.get(r).filter(|_| is_it)
    }
}

impl AvailableRanges for Ranges {
    fn bytes(&self, start: u64) -> Option<&[u8]> {
        match self.state_at(start) {
            Some(State::Whole(run)) => run.whole(),
            _ => None,
        }
    }

    fn came(&self, start: u64) -> bool {
        matches!(self.state_at(start), Some(State::Whole(_) | State::Gone))
    }
}

/// Whether the options ask for ranges of this kind.
pub(super) fn is_asked_for(kind: RangeKind, options: &FeedOptions) -> bool {
    !matches!(kind, RangeKind::Sh(part) if part >= options.sh_parts)
}

/// Whether the options ask for chunk `c`.
fn is_near(outline: &Outline, c: usize, options: &FeedOptions) -> bool {
    let Some(([least, most], chunk)) = options.within.zip(outline.chunks.get(c)) else { return true };
    let [from, to] = chunk.bounds;
    // The bounds of an only chunk mean nothing.
    outline.chunks.len() == 1 || (0..3).all(|k| from[k] <= most[k] && to[k] >= least[k])
}

/// The ranges in the order in which they are asked for: that of the file, or by the distances of chunks among those of the
/// same kind in the same layer.
fn order(outline: &Outline, options: &FeedOptions) -> Vec<usize> {
    let count = outline.ranges.len();
    let Some(point) = options.nearest else { return (0..count).collect() };
    let squares: Vec<f32> = outline.chunks.iter().map(|chunk| chunk.square_distance(point)).collect();
    // Layers and kinds follow one another as they first do in the file.
    let mut phases: Vec<(usize, RangeKind)> = Vec::new();
    let mut keys = Vec::with_capacity(count);
    for range in &outline.ranges {
        let phase = (outline.chunks.get(range.chunk).map_or(0, |chunk| chunk.layer), range.kind);
        let known = phases.iter().position(|&known| known == phase);
        let known = known.unwrap_or_else(|| {
            phases.push(phase);
            phases.len() - 1
        });
        keys.push((known, squares.get(range.chunk).copied().unwrap_or(0.0)));
    }
    crate::support::order::order(count, &mut |a, b| match (keys.get(a), keys.get(b)) {
        (Some(a), Some(b)) => a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)),
        _ => a.cmp(&b),
    })
}
