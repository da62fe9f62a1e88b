//! The streams of a chunk.

/// Defines [`Stream`] from the names of the streams and of the attributes that they belong to.
macro_rules! streams {
    ($($(#[$doc:meta])* $stream:ident => $attribute:literal,)+) => {
        /// The streams, in the order of their tables.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u8)]
        pub(in crate::packed) enum Stream {
            $($(#[$doc])* $stream),+
        }

        impl Stream {
            pub(in crate::packed) const ALL: [Self; 18] = [$(Self::$stream),+];

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
    pub(in crate::packed) fn names() -> impl Iterator<Item = (String, &'static str)> {
        Self::ALL.into_iter().map(|stream| (format!("{stream:?}"), stream.attribute()))
    }

    pub(super) const SCALES: [Self; 3] = [Self::Scale0, Self::Scale1, Self::Scale2];
    pub(super) const POSITIONS: [Self; 3] = [Self::Position0, Self::Position1, Self::Position2];
    pub(super) const DC: [Self; 3] = [Self::Dc0, Self::Dc1, Self::Dc2];
}
