//! The eight types a PLY property may have: their names, and their values in bytes and in text.

use serde::Serialize;

use crate::scene::splats::{ExtraValues, for_extra};

/// A value of a PLY property.
pub(super) trait Scalar: Copy + Default + Send + 'static {
    /// The type's place among PLY's.
    const TYPE: ScalarType;
    /// Bytes of one value.
    const BYTES: usize = size_of::<Self>();

    /// The value in `bytes`, which are [`Self::BYTES`] long.
    fn load<const BIG: bool>(bytes: &[u8]) -> Self;
    /// The nearest f32; infinite if there is none.
    fn to_f32(self) -> f32;
    /// The value as the length of a list; `None` if it is negative.
    fn to_length(self) -> Option<usize>;
    /// Appends the value of `text` in little-endian bytes; `None` if `text` is no such value.
    fn push_text(text: &str, bytes: &mut Vec<u8>) -> Option<()>;
    /// A list of extra values without entries.
    fn no_values() -> ExtraValues;
}

macro_rules! scalar_types {
    ($($variant:ident($ty:ty), $name:literal, $alias:literal;)*) => {
        /// Type of a scalar property.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
        #[serde(rename_all = "snake_case")]
        pub enum ScalarType {
            $(#[doc = concat!("`", $name, "` or `", $alias, "`.")] $variant,)*
        }

        impl ScalarType {
            /// The name in the first PLY specification, which every reader knows.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }

            /// The type called `word`.
            pub(super) fn parse(word: &str) -> Option<Self> {
                match word { $($name | $alias => Some(Self::$variant),)* _ => None }
            }
        }

        $(impl Scalar for $ty {
            const TYPE: ScalarType = ScalarType::$variant;

            #[inline(always)]
            fn load<const BIG: bool>(bytes: &[u8]) -> Self {
                match bytes.first_chunk() {
                    Some(&bytes) if BIG => Self::from_be_bytes(bytes),
                    Some(&bytes) => Self::from_le_bytes(bytes),
                    None => Self::default(),
                }
            }

            #[inline(always)]
            #[allow(clippy::cast_possible_truncation, trivial_numeric_casts, reason = "rounding is meant")]
            fn to_f32(self) -> f32 {
                self as f32
            }

            #[allow(clippy::cast_possible_truncation, clippy::cast_lossless, reason = "the header refuses floats")]
            fn to_length(self) -> Option<usize> {
                usize::try_from(self as i64).ok()
            }

            fn push_text(text: &str, bytes: &mut Vec<u8>) -> Option<()> {
                bytes.extend_from_slice(&text.parse::<Self>().ok()?.to_le_bytes());
                Some(())
            }

            fn no_values() -> ExtraValues {
                ExtraValues::$variant(Vec::new())
            }
        })*
    };
}

scalar_types! {
    I8(i8), "char", "int8";
    U8(u8), "uchar", "uint8";
    I16(i16), "short", "int16";
    U16(u16), "ushort", "uint16";
    I32(i32), "int", "int32";
    U32(u32), "uint", "uint32";
    F32(f32), "float", "float32";
    F64(f64), "double", "float64";
}

/// Evaluates `$body`, in which the type `$scalar` is the one that `$ty` stands for.
macro_rules! with_scalar {
    ($ty:expr, $scalar:ident => $body:expr) => {
        match $ty {
            $crate::formats::ply::scalar::ScalarType::I8 => {
                type $scalar = i8;
                $body
            }
            $crate::formats::ply::scalar::ScalarType::U8 => {
                type $scalar = u8;
                $body
            }
            $crate::formats::ply::scalar::ScalarType::I16 => {
                type $scalar = i16;
                $body
            }
            $crate::formats::ply::scalar::ScalarType::U16 => {
                type $scalar = u16;
                $body
            }
            $crate::formats::ply::scalar::ScalarType::I32 => {
                type $scalar = i32;
                $body
            }
            $crate::formats::ply::scalar::ScalarType::U32 => {
                type $scalar = u32;
                $body
            }
            $crate::formats::ply::scalar::ScalarType::F32 => {
                type $scalar = f32;
                $body
            }
            $crate::formats::ply::scalar::ScalarType::F64 => {
                type $scalar = f64;
                $body
            }
        }
    };
}
pub(super) use with_scalar;

impl ScalarType {
    /// Bytes of one value in a binary file.
    #[must_use]
    pub fn bytes(self) -> usize {
        with_scalar!(self, T => T::BYTES)
    }

    /// The type of extra values.
    pub(super) fn of(values: &ExtraValues) -> Self {
        fn of<T: Scalar>(_: &[T]) -> ScalarType {
            T::TYPE
        }
        for_extra!(values, values => of(values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn aliases_name_the_same_types() {
        for (old, new, bytes) in [
            ("char", "int8", 1),
            ("uchar", "uint8", 1),
            ("short", "int16", 2),
            ("ushort", "uint16", 2),
            ("int", "int32", 4),
            ("uint", "uint32", 4),
            ("float", "float32", 4),
            ("double", "float64", 8),
        ] {
            let ty = ScalarType::parse(old).unwrap();
            assert_eq!(Some(ty), ScalarType::parse(new));
            assert_eq!((ty.name(), ty.bytes()), (old, bytes));
            assert_eq!(ScalarType::of(&with_scalar!(ty, T => T::no_values())), ty);
        }
    }

    #[test]
    fn lengths_are_not_negative() {
        assert_eq!((255_u8.to_length(), (-1_i8).to_length()), (Some(255), None));
        assert_eq!(u32::MAX.to_length(), usize::try_from(u32::MAX).ok());
    }
}
