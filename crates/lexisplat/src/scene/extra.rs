//! Per-Gaussian properties that 3DGS does not define, and the eight types that they may have.

use safetensors::Dtype;
use serde::{Deserialize, Serialize};

/// A per-Gaussian property that 3DGS does not define, kept under its own name and type.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Extra {
    /// Property name in the PLY.
    pub name: String,
    /// One value for each Gaussian.
    pub values: ExtraValues,
}

macro_rules! scalar_types {
    ($($variant:ident($type:ty), $name:literal, $alias:literal;)*) => {
        /// Type of a scalar property.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum ScalarType {
            $(#[doc = concat!("`", $name, "` or `", $alias, "`.")] $variant,)*
        }

        /// Values of an [`Extra`], in the type that the file gave them.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[non_exhaustive]
        pub enum ExtraValues {
            $(#[doc = concat!("`", $name, "` or `", $alias, "`.")] $variant(Vec<$type>),)*
        }

        impl ScalarType {
            /// Returns the name of the type in the first PLY specification, which every reader knows.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }

            /// Returns the number of bytes of one value in a binary file.
            #[must_use]
            pub fn bytes(self) -> usize {
                match self { $(Self::$variant => size_of::<$type>(),)* }
            }

            /// Returns the type that a PLY calls `word`, if any.
            pub(crate) fn parse(word: &str) -> Option<Self> {
                match word { $($name | $alias => Some(Self::$variant),)* _ => None }
            }

            /// Returns the type in a safetensors file.
            pub(crate) fn dtype(self) -> Dtype {
                match self { $(Self::$variant => Dtype::$variant,)* }
            }

            /// Returns the type that is `dtype` in a safetensors file, if any.
            pub(crate) fn of_dtype(dtype: Dtype) -> Option<Self> {
                match dtype { $(Dtype::$variant => Some(Self::$variant),)* _ => None }
            }
        }

        impl ExtraValues {
            /// Returns the type of the values.
            #[must_use]
            pub fn scalar_type(&self) -> ScalarType {
                match self { $(Self::$variant(_) => ScalarType::$variant,)* }
            }

            /// Creates an empty list of values of type `scalar`.
            pub(crate) fn none(scalar: ScalarType) -> Self {
                match scalar { $(ScalarType::$variant => Self::$variant(Vec::new()),)* }
            }

            /// Appends `other`, whose values have the same type.
            pub(crate) fn append(&mut self, other: Self) {
                match (self, other) {
                    $((Self::$variant(to), Self::$variant(from)) => to.extend(from),)*
                    _ => debug_assert!(false, "extras of different types"),
                }
            }
        }

        $(impl From<Vec<$type>> for ExtraValues {
            fn from(values: Vec<$type>) -> Self {
                Self::$variant(values)
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

/// Evaluates `$body` with `$v` bound to the vector inside an [`ExtraValues`].
macro_rules! for_extra {
    ($values:expr, $v:ident => $body:expr) => {
        $crate::scene::extra::for_extra!($values, $v => $body; I8 U8 I16 U16 I32 U32 F32 F64)
    };
    ($values:expr, $v:ident => $body:expr; $($variant:ident)+) => {
        match $values {
            $($crate::scene::extra::ExtraValues::$variant($v) => $body,)+
        }
    };
}
pub(crate) use for_extra;

/// Evaluates `$body`, in which `$scalar` is the Rust type that `$ty` stands for.
macro_rules! with_scalar {
    ($ty:expr, $scalar:ident => $body:expr) => {
        $crate::scene::extra::with_scalar!(
            $ty, $scalar => $body; I8 i8, U8 u8, I16 i16, U16 u16, I32 i32, U32 u32, F32 f32, F64 f64
        )
    };
    ($ty:expr, $scalar:ident => $body:expr; $($variant:ident $type:ty),+) => {
        match $ty {
            $($crate::scene::extra::ScalarType::$variant => {
                type $scalar = $type;
                $body
            })+
        }
    };
}
pub(crate) use with_scalar;

impl Extra {
    /// Returns the values of Gaussians `range` under the same name. All Gaussians of the range must exist.
    pub(crate) fn slice(&self, range: std::ops::Range<usize>) -> Self {
        Self { name: self.name.clone(), values: for_extra!(&self.values, v => v[range].to_vec().into()) }
    }
}

impl ExtraValues {
    /// Returns the number of values.
    #[must_use]
    pub fn len(&self) -> usize {
        for_extra!(self, v => v.len())
    }

    /// Returns whether there are no values.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the number of bytes of one value.
    #[must_use]
    pub fn width(&self) -> usize {
        self.scalar_type().bytes()
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
            let none: ExtraValues = with_scalar!(ty, T => Vec::<T>::new().into());
            assert_eq!((none.scalar_type(), none.width()), (ty, bytes));
            assert_eq!(ScalarType::of_dtype(ty.dtype()), Some(ty));
        }
    }
}
