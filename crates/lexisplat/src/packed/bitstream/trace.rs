//! Traces: the first Gaussians of a golden file, symbol by symbol. A new decoder can print the same trace.
//!
//! docs/FORMAT-EXAMPLES.md explains the lines. They were compared with those of `scripts/decode_lexi.py`.

use std::fmt::Write as _;
use std::path::PathBuf;

use super::chunk::{LayerForm, starts};
use super::geometry_syntax::{GeometrySyntax, Group};
use super::interim::interim;
use super::parameters::CHANGES;
use super::refinement::refine;
use super::sh_codes::{BLOCK, Coded, Cursor, Rest};
use super::streams::{Slot, Stream};
use super::{Head, lanes};
use crate::lexi::LexiReader;
use crate::packed::entropy::lanes::{LANES, Lanes, has};
use crate::packed::entropy::rans_decoder::SymbolDecoder;
use crate::packed::entropy::rans_state::MOST_BITS;
use crate::packed::entropy::symbols::{Symbols, low_bits};
use crate::packed::entropy::tables::{Lookup, Tables};
use crate::support::limits::Limits;

/// One step of the first lane: a symbol of a stream in a context, or raw bits.
#[derive(Debug, Clone, Copy)]
enum Step {
    Symbol { stream: Stream, context: u32, symbol: u32, state: u32 },
    Bits { count: u32, value: u32, state: u32 },
}

/// A decoder that records the steps of its first lane.
struct Traced<'a> {
    decoder: SymbolDecoder<'a>,
    steps: Vec<Step>,
}

impl Symbols for Traced<'_> {
    fn symbols(
        &mut self,
        slot: Slot,
        context: Lanes<u32>,
        set: u32,
        value: impl Fn(usize) -> u32,
    ) -> Lanes<u32> {
        let out = self.decoder.symbols(slot, context, set, value);
        if has(set, 0) {
            let state = self.decoder.states[0];
            self.steps.push(Step::Symbol { stream: slot.stream, context: context[0], symbol: out[0], state });
        }
        out
    }

    fn bits(&mut self, slot: Slot, count: Lanes<u32>, set: u32, _: impl Fn(usize) -> u32) -> Lanes<u32> {
        let mut out = [0; LANES];
        for piece in 0..2 {
            let taken = count.map(|n| n.saturating_sub(MOST_BITS * piece).min(MOST_BITS));
            if taken == [0; LANES] {
                continue;
            }
            let values = self.decoder.bits(slot, taken, set, |_| 0);
            out.iter_mut().zip(values).for_each(|(out, value)| *out |= value << (MOST_BITS * piece));
            if has(set, 0) && taken[0] > 0 {
                let state = self.decoder.states[0];
                self.steps.push(Step::Bits { count: taken[0], value: values[0], state });
            }
        }
        out
    }
}

/// Writes the lines of the steps of one Gaussian, whose number is `gaussian`.
fn put(out: &mut String, range: usize, gaussian: &str, steps: &[Step]) {
    for step in steps {
        match step {
            Step::Symbol { stream, context, symbol, state } => {
                writeln!(out, "{range} {gaussian} {stream:?} {context} {symbol} {state:08x}")
            }
            Step::Bits { count, value, state } => {
                writeln!(out, "{range} {gaussian} bits {count} {value} {state:08x}")
            }
        }
        .unwrap();
    }
}

/// Splits the steps of a block of an SH part by Gaussian. Steps of signs have the number of the first Gaussian that they are
/// for. `counts` holds the numbers of nonzeros, and `exact` says which Gaussians have exact rows of `dim` numbers.
fn by_gaussian(
    steps: &[Step],
    counts: &[usize],
    exact: &[bool],
    sh_part: usize,
    dim: usize,
) -> Vec<(String, Vec<Step>)> {
    let mut steps = steps.iter().copied();
    // Takes the next symbol, and the raw bits that belong to it if it is the token of an integer.
    let mut symbol = |is_token: bool| {
        let first = steps.next().unwrap();
        let Step::Symbol { stream, symbol, .. } = first else { panic!("{first:?}") };
        let (mut all, mut left) = (vec![first], if is_token { low_bits(symbol) } else { 0 });
        while left > 0 {
            let Some(bits @ Step::Bits { count, .. }) = steps.next() else { panic!("bits are missing") };
            all.push(bits);
            left -= count;
        }
        (all, stream)
    };
    let mut out = Vec::new();
    for i in (0..counts.len()).filter(|&i| sh_part == 0 || !exact[i]) {
        out.push((i.to_string(), symbol(true).0));
    }
    let mut owners = Vec::new();
    for (i, &count) in counts.iter().enumerate() {
        for _ in 0..count {
            let (mut all, stream) = symbol(false);
            if stream as u8 == Stream::AtomPage as u8 {
                all.extend(symbol(false).0);
            }
            all.extend(symbol(true).0);
            owners.push(i);
            out.push((i.to_string(), all));
        }
    }
    for owners in owners.chunks(16) {
        let signs = steps.next().unwrap();
        assert!(matches!(signs, Step::Bits { count, .. } if count as usize == owners.len()));
        out.push((format!("- {}", owners[0]), vec![signs]));
    }
    if sh_part == 0 {
        for i in (0..counts.len()).filter(|&i| exact[i]) {
            out.push((i.to_string(), steps.by_ref().take(2 * dim).collect()));
        }
    }
    assert!(steps.next().is_none());
    out
}

/// The trace of the first `shown` Gaussians of the first lane of the first chunk.
fn trace(name: &str, shown: usize) -> String {
    let path: PathBuf =
        [env!("CARGO_MANIFEST_DIR"), "tests", "golden", &format!("{name}.lexi")].iter().collect();
    let reader = LexiReader::open(name, std::fs::read(path).unwrap(), &Limits::default()).unwrap();
    let packed = reader.packed().unwrap().unwrap();
    let head = Head::read(&packed.head().bytes, packed.head().degree.rest()).unwrap();
    let (tables, form) = (Tables::read(&head.tables).unwrap(), head.form());
    let lookup = Lookup::new(&tables);
    let chunk = &head.index.chunks[0];
    let layer: LayerForm = head.index.layer(chunk.layer);
    let lanes = lanes(chunk.gaussians);
    let starts = starts(chunk.gaussians, lanes);
    let mut ranges: Vec<Traced<'_>> = chunk
        .ranges
        .iter()
        .map(|range| {
            let bytes = &packed.data()[range.start as usize..][..range.length as usize];
            Traced { decoder: SymbolDecoder::new(&lookup, bytes, lanes, false).unwrap(), steps: Vec::new() }
        })
        .collect();
    let refinements = layer.refinements;
    let mut out = vec![String::new(); layer.ranges()];
    let mut walk = GeometrySyntax::new(&form.steering, refinements);
    let mut rest = Rest::default();
    let count = BLOCK.min(starts[1]);
    for i in 0..count {
        let own = |l: usize| u32::from(starts[l] + i < starts[l + 1]) << l;
        let set = (0..lanes).map(own).sum();
        let mut group = Group::default();
        walk.base(&mut ranges[0], set, None, &mut group).unwrap();
        for k in 1..=refinements {
            refine(&mut ranges[k], set, &mut group, refinements + 1 - k).unwrap();
        }
        if layer.interim {
            interim(&mut ranges[layer.interim_range()], set, &mut group, &[[0; LANES]; CHANGES]);
        }
        rest.push(set, group.colour);
        for (k, range) in ranges.iter_mut().enumerate() {
            let steps = std::mem::take(&mut range.steps);
            if i < shown {
                put(&mut out[k], k, &i.to_string(), &steps);
            }
        }
    }
    let dim = form.rest.dim;
    let mut exact = vec![false; count];
    for sh_part in 0..layer.sh_parts {
        let k = 1 + refinements + sh_part;
        rest.sh_part(&mut ranges[k], None, &form.rest, sh_part).unwrap();
        let steps = std::mem::take(&mut ranges[k].steps);
        let mut cursor = Cursor::default();
        let mut counts = Vec::new();
        for i in 0..count {
            match rest.coded(&form.rest, sh_part, i, 0, &mut cursor) {
                Coded::Exact(_) => {
                    exact[i] = true;
                    counts.push(0);
                }
                Coded::Code { count, .. } => counts.push(count),
            }
        }
        for (gaussian, steps) in by_gaussian(&steps, &counts, &exact, sh_part, dim) {
            let first = gaussian.trim_start_matches("- ");
            if first.parse::<usize>().unwrap() < shown {
                put(&mut out[k], k, if gaussian.starts_with('-') { "-" } else { first }, &steps);
            }
        }
    }
    out.concat()
}

/// The golden files with traces, and the number of their Gaussians that these show.
const TRACES: [(&str, usize); 4] =
    [("packed3", 3), ("packed3_degree0", 3), ("packed3_escapes", 3), ("packed3_layers", 3)];

fn golden(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "tests", "golden", &format!("{name}.trace")].iter().collect()
}

#[test]
fn golden_files_have_these_traces() {
    for (name, shown) in TRACES {
        let expected = std::fs::read_to_string(golden(name)).unwrap();
        let found = trace(name, shown);
        for (i, (found, expected)) in found.lines().zip(expected.lines()).enumerate() {
            assert_eq!(found, expected, "line {} of {name}", i + 1);
        }
        assert_eq!(found.lines().count(), expected.lines().count(), "{name}");
    }
}

/// Never run it to make a failing test pass.
#[test]
#[ignore = "writes tests/golden"]
fn regenerate() {
    for (name, shown) in TRACES {
        std::fs::write(golden(name), trace(name, shown)).unwrap();
    }
}
