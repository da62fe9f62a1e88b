//! The streams of symbols. A stream has contexts, and a context has a table of probabilities.

use super::coarseness::MAX_REFINEMENTS;

/// Number of contexts of a stream.
pub(in crate::packed) const CONTEXTS: usize = 24;
/// Largest number of SH parts: nonzeros are split by their size, largest first.
pub(in crate::packed) const SH_PARTS: usize = 3;

/// Defines [`Stream`] from the names of the streams and of the attributes that they belong to.
macro_rules! streams {
    ($count:literal: $($(#[$doc:meta])* $stream:ident => $attribute:literal,)+) => {
        /// The streams of symbols, in the order of their tables.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u8)]
        pub(in crate::packed) enum Stream {
            $($(#[$doc])* $stream),+
        }

        impl Stream {
            pub(in crate::packed) const ALL: [Self; $count] = [$(Self::$stream),+];

            /// Returns the name of the stream's attribute in reports.
            pub(in crate::packed) fn attribute(self) -> &'static str {
                match self { $(Self::$stream => $attribute),+ }
            }
        }
    };
}
streams! { 30:
    /// Differences between the numbers of successive cells on the Morton curve.
    Cell => "position",
    /// Class of the steps of colour.
    ColourClass => "classes",
    /// Class of the steps of shape.
    ShapeClass => "classes",
    /// Logarithms of the standard deviations, longest axis first.
    Scale0 => "scale",
    Scale1 => "scale",
    Scale2 => "scale",
    Opacity => "opacity",
    /// Direction of the axis about which a turn matters least, and the turn about it. This stream has raw bits only.
    Rotation => "rotation",
    /// Position within the cell along the Gaussian's own axes.
    Position0 => "position",
    Position1 => "position",
    Position2 => "position",
    Dc0 => "dc",
    Dc1 => "dc",
    Dc2 => "dc",
    /// Refinements of positions and of base colours.
    FinePosition => "position",
    FineDc => "dc",
    /// Numbers of nonzeros, atoms and values of each SH part.
    Count0 => "codes.counts",
    Count1 => "codes.counts",
    Count2 => "codes.counts",
    Atom0 => "codes.indices",
    Atom1 => "codes.indices",
    Atom2 => "codes.indices",
    Value0 => "codes.values",
    Value1 => "codes.values",
    Value2 => "codes.values",
    /// The page of 256 atoms that an atom is in, if there are more than one.
    AtomPage => "codes.indices",
    /// Interim changes of scales, opacities and base colours, while the next layer around a Gaussian is missing.
    InterimScale => "interim",
    InterimOpacity => "interim",
    InterimDc => "interim",
    /// Coefficients of the atoms. They are in the head, and have no contexts.
    Dictionary => "dictionary",
}

impl Stream {
    /// Returns the name and the attribute of each stream.
    pub(in crate::packed) fn names() -> impl Iterator<Item = (String, &'static str)> {
        Self::ALL.into_iter().map(|stream| (format!("{stream:?}"), stream.attribute()))
    }

    pub(in crate::packed) const COUNTS: [Self; SH_PARTS] = [Self::Count0, Self::Count1, Self::Count2];
    pub(in crate::packed) const ATOMS: [Self; SH_PARTS] = [Self::Atom0, Self::Atom1, Self::Atom2];
    pub(in crate::packed) const VALUES: [Self; SH_PARTS] = [Self::Value0, Self::Value1, Self::Value2];
}

impl Stream {
    /// Returns the number of bits of the stream's probabilities. Atoms have more, since there are hundreds of them and a
    /// probability is at least one unit.
    #[inline(always)]
    pub(in crate::packed) const fn precision(self) -> u32 {
        match self {
            Self::Atom0 | Self::Atom1 | Self::Atom2 => 12,
            _ => 10,
        }
    }
}

/// Number of streams of geometry. The step of their values depends on the number of missing refinements, and so do their
/// tables.
const OF_GEOMETRY: usize = Stream::Count0 as usize;
/// Number of different numbers of missing refinements.
const BY_MISSING: usize = MAX_REFINEMENTS + 1;
/// Number of sets of contexts.
pub(in crate::packed) const SLOTS: usize =
    BY_MISSING * OF_GEOMETRY + Stream::Dictionary as usize - OF_GEOMETRY;

/// A set of contexts: the contexts of a stream at one number of missing refinements.
#[derive(Debug, Clone, Copy)]
pub(in crate::packed) struct Slot {
    pub(in crate::packed) stream: Stream,
    pub(in crate::packed) number: usize,
}

impl Slot {
    /// Returns all sets of contexts in the order of their tables.
    pub(in crate::packed) fn all() -> impl Iterator<Item = Self> {
        (0..SLOTS).map(|number| Self { stream: stream_of(number * CONTEXTS), number })
    }

    /// Returns the stream of a context, by its number among all contexts.
    pub(in crate::packed) fn stream_of(context: usize) -> Stream {
        stream_of(context)
    }
}

impl Slot {
    /// Returns the number of the context `context` of this set among all contexts.
    #[inline(always)]
    pub(in crate::packed) fn table_index(self, context: u32) -> usize {
        self.number * CONTEXTS + (context as usize).min(CONTEXTS - 1)
    }
}

impl Stream {
    /// Returns the set of contexts of the stream, if `missing` refinements are missing.
    #[inline(always)]
    pub(in crate::packed) fn at(self, missing: usize) -> Slot {
        let number = match self as usize {
            stream if stream < OF_GEOMETRY => missing.min(MAX_REFINEMENTS) * OF_GEOMETRY + stream,
            stream => (BY_MISSING - 1) * OF_GEOMETRY + stream,
        };
        Slot { stream: self, number }
    }
}

/// Returns the stream of a context, by its number among all contexts.
pub(in crate::packed) fn stream_of(context: usize) -> Stream {
    let number = context / CONTEXTS;
    let shared = BY_MISSING * OF_GEOMETRY;
    let stream = if number < shared { number % OF_GEOMETRY } else { number - shared + OF_GEOMETRY };
    Stream::ALL.get(stream).copied().unwrap_or(Stream::Dictionary)
}
