//! The streams of a chunk, and their encoder and decoder.

use super::bits::{BitReader, BitWriter, extra_bits, join, split};
use super::entropy::{CONTEXTS, Histogram, SymbolReader, Tables, encode};

/// Defines [`Stream`] from the names of the streams and of the attributes that they belong to.
macro_rules! streams {
    ($($(#[$doc:meta])* $stream:ident => $attribute:literal,)+) => {
        /// The streams, in the order of their tables.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u8)]
        pub(super) enum Stream {
            $($(#[$doc])* $stream),+
        }

        impl Stream {
            pub(super) const ALL: [Self; 18] = [$(Self::$stream),+];

            /// The attribute that it belongs to, by the name in reports.
            fn attribute(self) -> &'static str {
                match self { $(Self::$stream => $attribute),+ }
            }
        }
    };
}
streams! {
    /// Gaps between cells along the Morton curve.
    Cell => "position",
    /// Step class of the colour.
    ColourClass => "classes",
    /// Step class of the shape.
    ShapeClass => "classes",
    /// Logarithms of the standard deviations, longest axis first.
    Scale0 => "scale",
    Scale1 => "scale",
    Scale2 => "scale",
    /// Direction of the axis about which turning matters least, and the turn about it.
    Rotation => "rotation",
    /// Position within the cell along the Gaussian's own axes.
    Position0 => "position",
    Position1 => "position",
    Position2 => "position",
    Opacity => "opacity",
    Dc0 => "dc",
    Dc1 => "dc",
    Dc2 => "dc",
    /// Nonzeros.
    Count => "codes.counts",
    Atom => "codes.indices",
    Value => "codes.values",
    /// Coefficients of the atoms.
    Dictionary => "dictionary",
}

impl Stream {
    /// Names and attributes of all.
    pub(super) fn names() -> impl Iterator<Item = (String, &'static str)> {
        Self::ALL.into_iter().map(|stream| (format!("{stream:?}"), stream.attribute()))
    }

    pub(super) const SCALES: [Self; 3] = [Self::Scale0, Self::Scale1, Self::Scale2];
    pub(super) const POSITIONS: [Self; 3] = [Self::Position0, Self::Position1, Self::Position2];
    pub(super) const DC: [Self; 3] = [Self::Dc0, Self::Dc1, Self::Dc2];
}

/// Size of one stream.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct StreamBits {
    /// The stream's name.
    pub name: String,
    /// The attribute it belongs to.
    pub attribute: &'static str,
    /// Bits in all.
    pub bits: f64,
}

/// Bits each stream took; empty if they were not counted.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct BitCounts(pub(super) Vec<f64>);

impl BitCounts {
    /// No bits yet of as many streams.
    pub(super) fn zeros(streams: usize) -> Self {
        Self(vec![0.0; streams])
    }

    pub(crate) fn add(&mut self, more: &Self) {
        self.0.resize(self.0.len().max(more.0.len()), 0.0);
        for (a, b) in self.0.iter_mut().zip(&more.0) {
            *a += b;
        }
    }

    /// With the names and attributes of the streams.
    pub(super) fn named(&self, streams: impl Iterator<Item = (String, &'static str)>) -> Vec<StreamBits> {
        let counts = self.0.iter().copied().chain(std::iter::repeat(0.0));
        streams.zip(counts).map(|((name, attribute), bits)| StreamBits { name, attribute, bits }).collect()
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
#[derive(Debug, Clone)]
pub(super) struct SymbolEncoder {
    /// Contexts of all streams, and symbols.
    symbols: Vec<[u16; 2]>,
    raw: BitWriter,
    /// Raw bits of each stream so far.
    pub(super) raw_bits: BitCounts,
}

fn index(stream: Stream, context: usize) -> u16 {
    let index = stream as usize * CONTEXTS + context.min(CONTEXTS - 1);
    u16::try_from(index).unwrap_or(u16::MAX)
}

impl Symbols for SymbolEncoder {
    fn integer(&mut self, stream: Stream, context: usize, value: impl FnOnce() -> u64) -> u64 {
        let value = value();
        let (token, count, extra) = split(value);
        self.symbols.push([index(stream, context), token]);
        self.bits(stream, count, || extra);
        value
    }

    fn symbol(&mut self, stream: Stream, context: usize, value: impl FnOnce() -> u16) -> u16 {
        let value = value();
        self.symbols.push([index(stream, context), value]);
        value
    }

    fn bits(&mut self, stream: Stream, count: u32, value: impl FnOnce() -> u64) -> u64 {
        let value = value();
        self.raw.put(count, value);
        self.raw_bits.0[stream as usize] += f64::from(count);
        value
    }
}

impl Default for SymbolEncoder {
    fn default() -> Self {
        let raw_bits = BitCounts::zeros(Stream::ALL.len());
        Self { symbols: Vec::new(), raw: BitWriter::default(), raw_bits }
    }
}

impl SymbolEncoder {
    /// Adds the chunk's symbols to the file's statistics.
    pub(super) fn count(&self, histograms: &mut [Histogram]) {
        for &[context, symbol] in &self.symbols {
            histograms[usize::from(context)].add(symbol);
        }
    }

    /// Symbols with their contexts, to be [coded](code_symbols) later, and raw bits.
    pub(super) fn set_aside(self) -> (Vec<[u16; 2]>, Vec<u8>) {
        (self.symbols, self.raw.finish())
    }

    /// The chunk's two parts: modelled symbols and raw bits.
    pub(super) fn finish(self, tables: &Tables) -> [Vec<u8>; 2] {
        [code_symbols(&self.symbols, tables), self.raw.finish()]
    }
}

/// Codes the symbols of a chunk, each after its context.
pub(super) fn code_symbols(symbols: &[[u16; 2]], tables: &Tables) -> Vec<u8> {
    encode(symbols.iter().filter_map(|&[context, symbol]| {
        let context = usize::from(context);
        Some((tables.table(context / CONTEXTS, context % CONTEXTS)?, symbol))
    }))
}

/// The decoder of a chunk.
#[derive(Debug)]
pub(super) struct SymbolDecoder<'a> {
    tables: &'a Tables,
    symbols: SymbolReader,
    raw: BitReader<'a>,
    /// Bits of each stream, if they are counted.
    pub(super) bit_counts: Option<BitCounts>,
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
            bit_counts.0[stream as usize] += table.bits(symbol);
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
            bit_counts.0[stream as usize] += f64::from(count);
        }
        self.raw.take(count)
    }
}
