//! The streams of symbols. Each has contexts, and each context a table of probabilities.

use super::geometry_syntax::MAX_LEVELS;

/// Contexts of a stream.
pub(in crate::packed) const CONTEXTS: usize = 24;
/// Parts into which nonzeros are split by their size, largest first.
pub(in crate::packed) const REST_PARTS: usize = 3;

/// Defines [`Stream`] from the names of the streams and of the attributes that they belong to.
macro_rules! streams {
    ($count:literal: $($(#[$doc:meta])* $stream:ident => $attribute:literal,)+) => {
        /// The streams, in the order of their tables.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u8)]
        pub(in crate::packed) enum Stream {
            $($(#[$doc])* $stream),+
        }

        impl Stream {
            pub(in crate::packed) const ALL: [Self; $count] = [$(Self::$stream),+];

            /// The attribute that it belongs to, by the name in reports.
            pub(in crate::packed) fn attribute(self) -> &'static str {
                match self { $(Self::$stream => $attribute),+ }
            }
        }
    };
}
streams! { 30:
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
    Opacity => "opacity",
    /// Direction of the axis about which turning matters least, and the turn about it. It has raw bits alone.
    Rotation => "rotation",
    /// Position within the cell along the Gaussian's own axes.
    Position0 => "position",
    Position1 => "position",
    Position2 => "position",
    Dc0 => "dc",
    Dc1 => "dc",
    Dc2 => "dc",
    /// What coarse steps leave.
    FinePosition => "position",
    FineDc => "dc",
    /// Numbers, atoms and sizes of the nonzeros of each part.
    Count0 => "codes.counts",
    Count1 => "codes.counts",
    Count2 => "codes.counts",
    Atom0 => "codes.indices",
    Atom1 => "codes.indices",
    Atom2 => "codes.indices",
    Value0 => "codes.values",
    Value1 => "codes.values",
    Value2 => "codes.values",
    /// Which 256 atoms an atom is of, if there are more.
    AtomPage => "codes.indices",
    /// How a Gaussian changes while those of the next layer around it are not there.
    InterimScale => "interim",
    InterimOpacity => "interim",
    InterimDc => "interim",
    /// Coefficients of the atoms. They are in the head and no symbols of any context.
    Dictionary => "dictionary",
}

impl Stream {
    /// Names and attributes of all.
    pub(in crate::packed) fn names() -> impl Iterator<Item = (String, &'static str)> {
        Self::ALL.into_iter().map(|stream| (format!("{stream:?}"), stream.attribute()))
    }

    pub(in crate::packed) const COUNTS: [Self; REST_PARTS] = [Self::Count0, Self::Count1, Self::Count2];
    pub(in crate::packed) const ATOMS: [Self; REST_PARTS] = [Self::Atom0, Self::Atom1, Self::Atom2];
    pub(in crate::packed) const VALUES: [Self; REST_PARTS] = [Self::Value0, Self::Value1, Self::Value2];
}

impl Stream {
    /// Bits of its probabilities. There are hundreds of atoms, and a probability is at least one unit.
    #[inline(always)]
    pub(in crate::packed) const fn precision(self) -> u32 {
        match self {
            Self::Atom0 | Self::Atom1 | Self::Atom2 => 12,
            _ => 10,
        }
    }
}

/// Streams of geometry. The step of their values depends on the levels that are missing, and so do their tables.
const OF_GEOMETRY: usize = Stream::Count0 as usize;
/// Numbers of levels that may be missing.
const BY_LEVELS: usize = MAX_LEVELS + 1;
/// Number of sets of contexts.
pub(in crate::packed) const SLOTS: usize =
    BY_LEVELS * OF_GEOMETRY + Stream::Dictionary as usize - OF_GEOMETRY;

/// A stream, and the number of its set of contexts among all.
#[derive(Debug, Clone, Copy)]
pub(in crate::packed) struct Slot {
    pub(in crate::packed) stream: Stream,
    pub(in crate::packed) number: usize,
}

impl Slot {
    /// All sets of contexts in the order of their tables.
    pub(in crate::packed) fn all() -> impl Iterator<Item = Self> {
        (0..SLOTS).map(|number| Self { stream: stream_of(number * CONTEXTS), number })
    }

    /// The stream of a context, counted over all.
    pub(in crate::packed) fn stream_of(context: usize) -> Stream {
        stream_of(context)
    }
}

impl Slot {
    /// Number of the context `context` among all contexts.
    #[inline(always)]
    pub(in crate::packed) fn place(self, context: u32) -> usize {
        self.number * CONTEXTS + (context as usize).min(CONTEXTS - 1)
    }
}

impl Stream {
    /// The contexts of the stream where this many levels are missing.
    #[inline(always)]
    pub(in crate::packed) fn at(self, levels: usize) -> Slot {
        let number = match self as usize {
            stream if stream < OF_GEOMETRY => levels.min(MAX_LEVELS) * OF_GEOMETRY + stream,
            stream => (BY_LEVELS - 1) * OF_GEOMETRY + stream,
        };
        Slot { stream: self, number }
    }
}

/// The stream of a context, counted over all.
pub(in crate::packed) fn stream_of(context: usize) -> Stream {
    let number = context / CONTEXTS;
    let shared = BY_LEVELS * OF_GEOMETRY;
    let stream = if number < shared { number % OF_GEOMETRY } else { number - shared + OF_GEOMETRY };
    Stream::ALL.get(stream).copied().unwrap_or(Stream::Dictionary)
}
