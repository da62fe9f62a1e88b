//! The numbers that rows are made of, and their codes.

/// A number of rows and of their codes: `f32` or `f64`.
pub trait RowValue: Copy + Default + PartialEq + Send + Sync + sealed::Sealed {
    /// Returns the number in double precision.
    fn wide(self) -> f64;

    /// Returns the number of this type that is nearest to `value`.
    fn nearest(value: f64) -> Self;

    /// Returns `rows` in single precision. Numbers out of its range become infinite, or 0.
    fn narrow(rows: &[Self]) -> std::borrow::Cow<'_, [f32]>;
}

impl RowValue for f32 {
    #[inline]
    fn wide(self) -> f64 {
        self.into()
    }

    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
    #[inline]
    fn nearest(value: f64) -> Self {
        value as Self
    }

    fn narrow(rows: &[Self]) -> std::borrow::Cow<'_, [f32]> {
        rows.into()
    }
}

impl RowValue for f64 {
    #[inline]
    fn wide(self) -> f64 {
        self
    }

    #[inline]
    fn nearest(value: f64) -> Self {
        value
    }

    fn narrow(rows: &[Self]) -> std::borrow::Cow<'_, [f32]> {
        rows.iter().map(|&value| f32::nearest(value)).collect()
    }
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}
