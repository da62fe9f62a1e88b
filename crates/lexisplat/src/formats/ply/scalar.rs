//! Values of a PLY property, in bytes and in text.

/// A value of a PLY property.
pub(super) trait Scalar: Copy {
    /// Number of bytes of one value.
    const BYTES: usize = size_of::<Self>();

    /// Returns the value in `bytes`, which are [`Self::BYTES`] long.
    fn load<const BIG: bool>(bytes: &[u8]) -> Self;
    /// Returns the nearest f32; infinite if there is none.
    fn to_f32(self) -> f32;
    /// Returns the value as f64, which holds the values of all types.
    fn to_f64(self) -> f64;
    /// Returns the value as the length of a list; `None` if it is negative.
    fn to_length(self) -> Option<usize>;
    /// Appends the value of `text` in little-endian bytes; `None` if `text` is no such value.
    fn push_text(text: &str, bytes: &mut Vec<u8>) -> Option<()>;
}

macro_rules! scalars {
    ($($type:ty)*) => {
        $(impl Scalar for $type {
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

            #[inline(always)]
            #[allow(clippy::cast_lossless, trivial_numeric_casts, reason = "for any type")]
            fn to_f64(self) -> f64 {
                self as f64
            }

            #[allow(clippy::cast_possible_truncation, clippy::cast_lossless, reason = "the header refuses floats")]
            fn to_length(self) -> Option<usize> {
                usize::try_from(self as i64).ok()
            }

            fn push_text(text: &str, bytes: &mut Vec<u8>) -> Option<()> {
                bytes.extend_from_slice(&text.parse::<Self>().ok()?.to_le_bytes());
                Some(())
            }
        })*
    };
}

scalars!(i8 u8 i16 u16 i32 u32 f32 f64);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_not_negative() {
        assert_eq!((255_u8.to_length(), (-1_i8).to_length()), (Some(255), None));
        assert_eq!(u32::MAX.to_length(), usize::try_from(u32::MAX).ok());
    }
}
