//! The streams of a chunk, and their encoder and decoder.

use super::bits::{BitReader, BitWriter, extra_bits, join, split};
use super::entropy::{CONTEXTS, Histogram, SymbolReader, Table, Tables, encode};

/// The attributes, in the order of their tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Stream {
    /// Gaps between cells along the Morton curve.
    Cell,
    /// Step class of the colour.
    ColourClass,
    /// Step class of the shape.
    ShapeClass,
    /// Logarithms of the standard deviations, longest axis first.
    Scale0,
    Scale1,
    Scale2,
    /// Direction of the axis about which turning matters least, and the turn about it.
    Rotation,
    /// Position within the cell along the Gaussian's own axes.
    Position0,
    Position1,
    Position2,
    Opacity,
    Dc0,
    Dc1,
    Dc2,
    /// Nonzeros.
    Count,
    Atom,
    Value,
    /// Coefficients of the atoms.
    Dictionary,
}

impl Stream {
    pub(super) const ALL: [Self; 18] = [
        Self::Cell,
        Self::ColourClass,
        Self::ShapeClass,
        Self::Scale0,
        Self::Scale1,
        Self::Scale2,
        Self::Rotation,
        Self::Position0,
        Self::Position1,
        Self::Position2,
        Self::Opacity,
        Self::Dc0,
        Self::Dc1,
        Self::Dc2,
        Self::Count,
        Self::Atom,
        Self::Value,
        Self::Dictionary,
    ];

    /// The attribute that it belongs to, by the name in reports.
    pub(super) fn attribute(self) -> &'static str {
        match self {
            Self::Cell | Self::Position0 | Self::Position1 | Self::Position2 => "position",
            Self::ColourClass | Self::ShapeClass => "classes",
            Self::Scale0 | Self::Scale1 | Self::Scale2 => "scale",
            Self::Rotation => "rotation",
            Self::Opacity => "opacity",
            Self::Dc0 | Self::Dc1 | Self::Dc2 => "dc",
            Self::Count => "codes.counts",
            Self::Atom => "codes.indices",
            Self::Value => "codes.values",
            Self::Dictionary => "dictionary",
        }
    }

    /// Number `k` of three streams.
    pub(super) fn axis(streams: [Self; 3], k: usize) -> Self {
        streams[k.min(2)]
    }
}

/// The encoder or the decoder of a chunk's streams. The encoder records the values of the closures and returns
/// them. The decoder returns values from the file and never calls the closures. So one loop over a chunk serves
/// both.
pub(super) trait Symbols {
    /// An integer whose token is modelled in `context`, below [`CONTEXTS`]; low bits of large ones are not.
    fn integer(&mut self, stream: Stream, context: usize, value: impl FnOnce() -> u64) -> u64;
    /// A symbol modelled whole.
    fn symbol(&mut self, stream: Stream, context: usize, value: impl FnOnce() -> u16) -> u16;
    /// `count` bits, at most 64, that are not modelled.
    fn bits(&mut self, stream: Stream, count: u32, value: impl FnOnce() -> u64) -> u64;
}

/// The encoder of a chunk. It keeps all symbols until the tables are known.
#[derive(Debug, Default)]
pub(super) struct SymbolEncoder {
    symbols: Vec<(u16, u16)>,
    raw: BitWriter,
    raw_bits: [u64; Stream::ALL.len()],
}

fn index(stream: Stream, context: usize) -> u16 {
    let index = stream as usize * CONTEXTS + context.min(CONTEXTS - 1);
    u16::try_from(index).unwrap_or(u16::MAX)
}

impl Symbols for SymbolEncoder {
    fn integer(&mut self, stream: Stream, context: usize, value: impl FnOnce() -> u64) -> u64 {
        let value = value();
        let (token, count, extra) = split(value);
        self.symbols.push((index(stream, context), token));
        self.bits(stream, count, || extra);
        value
    }

    fn symbol(&mut self, stream: Stream, context: usize, value: impl FnOnce() -> u16) -> u16 {
        let value = value();
        self.symbols.push((index(stream, context), value));
        value
    }

    fn bits(&mut self, stream: Stream, count: u32, value: impl FnOnce() -> u64) -> u64 {
        let value = value();
        self.raw.put(count, value);
        self.raw_bits[stream as usize] += u64::from(count);
        value
    }
}

impl SymbolEncoder {
    /// Adds the chunk's symbols to the file's statistics.
    pub(super) fn count(&self, histograms: &mut [Histogram]) {
        for &(context, symbol) in &self.symbols {
            histograms[usize::from(context)].add(symbol);
        }
    }

    /// Raw bits each stream has so far.
    pub(super) fn raw_bits(&self) -> [u64; Stream::ALL.len()] {
        self.raw_bits
    }

    /// Everything that [`Self::finish_later`] needs: symbols with their contexts, and raw bits.
    pub(super) fn set_aside(self) -> (Vec<u16>, Vec<u8>) {
        (self.symbols.iter().flat_map(|&(context, symbol)| [context, symbol]).collect(), self.raw.finish())
    }

    /// The two parts of a chunk that was [set aside](Self::set_aside).
    pub(super) fn finish_later(symbols: &[u16], raw: Vec<u8>, tables: &Tables) -> [Vec<u8>; 2] {
        let symbols = symbols.as_chunks::<2>().0.iter().map(|&[context, symbol]| (context, symbol)).collect();
        let [coded, _] = Self { symbols, ..Self::default() }.finish(tables);
        [coded, raw]
    }

    /// The chunk's two parts: modelled symbols and raw bits.
    pub(super) fn finish(self, tables: &Tables) -> [Vec<u8>; 2] {
        let table = |context: u16| {
            let context = usize::from(context);
            tables.table(context / CONTEXTS, context % CONTEXTS)
        };
        let symbols: Vec<(&Table, u16)> =
            self.symbols.iter().filter_map(|&(context, symbol)| Some((table(context)?, symbol))).collect();
        [encode(symbols.into_iter()), self.raw.finish()]
    }
}

/// The decoder of a chunk.
#[derive(Debug)]
pub(super) struct SymbolDecoder<'a> {
    tables: &'a Tables,
    symbols: SymbolReader,
    raw: BitReader<'a>,
    /// Bits of each stream, if they are counted.
    pub(super) bit_counts: Option<[f64; Stream::ALL.len()]>,
    missing: bool,
}

impl<'a> SymbolDecoder<'a> {
    /// `None` if the parts cannot be those of a chunk.
    pub(super) fn new(tables: &'a Tables, symbols: &[u8], raw: &'a [u8]) -> Option<Self> {
        let symbols = SymbolReader::new(symbols)?;
        Some(Self { tables, symbols, raw: BitReader::new(raw), bit_counts: None, missing: false })
    }

    /// Whether bits beyond the end were read.
    pub(super) fn overrun(&self) -> bool {
        self.raw.overrun() || self.missing
    }

    /// Whether both parts were read to their end, and not beyond.
    pub(super) fn exhausted(&self) -> bool {
        self.symbols.exhausted() && self.raw.exhausted() && !self.missing
    }

    #[inline]
    fn take(&mut self, stream: Stream, context: usize) -> u16 {
        let Some(table) = self.tables.table(stream as usize, context.min(CONTEXTS - 1)) else {
            self.missing = true;
            return 0;
        };
        let symbol = self.symbols.take(table);
        if let Some(bit_counts) = &mut self.bit_counts {
            bit_counts[stream as usize] += table.bits(symbol);
        }
        symbol
    }
}

impl Symbols for SymbolDecoder<'_> {
    #[inline]
    fn integer(&mut self, stream: Stream, context: usize, _: impl FnOnce() -> u64) -> u64 {
        let token = self.take(stream, context);
        let count = extra_bits(token);
        let extra = if count == 0 { 0 } else { self.bits(stream, count, || 0) };
        join(token, extra)
    }

    #[inline]
    fn symbol(&mut self, stream: Stream, context: usize, _: impl FnOnce() -> u16) -> u16 {
        self.take(stream, context)
    }

    #[inline]
    fn bits(&mut self, stream: Stream, count: u32, _: impl FnOnce() -> u64) -> u64 {
        if let Some(bit_counts) = &mut self.bit_counts {
            bit_counts[stream as usize] += f64::from(count);
        }
        self.raw.take(count)
    }
}
