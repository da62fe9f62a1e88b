//! Little-endian numbers in a list of bytes.

use super::broken::BrokenHead;

/// A reader that takes numbers from the start of a list of bytes. Every method returns `None` if too few bytes are left.
#[derive(Debug, Clone, Copy)]
pub(in crate::packed) struct ByteReader<'a>(pub(in crate::packed) &'a [u8]);

impl<'a> ByteReader<'a> {
    pub(in crate::packed) fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*taken)
    }

    pub(in crate::packed) fn u8(&mut self) -> Option<u8> {
        self.array().map(u8::from_le_bytes)
    }

    pub(in crate::packed) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(in crate::packed) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    /// Takes an integer that [`put_number`] wrote.
    pub(in crate::packed) fn number(&mut self) -> Option<u64> {
        let mut number = 0_u64;
        for shift in (0..).step_by(7) {
            let byte = self.u8()?;
            let bits = u64::from(byte & 0x7f);
            let placed = bits.checked_shl(shift).filter(|placed| placed >> shift == bits)?;
            number |= placed;
            if byte < 0x80 {
                // A last byte of zeros would be a second form of the same number.
                return (byte > 0 || shift == 0).then_some(number);
            }
        }
        None
    }

    /// Takes an integer of up to 32 bits that [`put_number`] wrote.
    pub(in crate::packed) fn number32(&mut self) -> Option<u32> {
        self.number().and_then(|number| u32::try_from(number).ok())
    }

    /// Takes a finite bf16: the two high bytes of an f32, whose other bytes are 0.
    pub(in crate::packed) fn bf16(&mut self) -> Option<f32> {
        self.u16().map(|high| f32::from_bits(u32::from(high) << 16)).filter(|x| x.is_finite())
    }

    /// Takes `N` finite f24: the three high bytes of an f32, whose other byte is 0.
    pub(in crate::packed) fn f24s<const N: usize>(&mut self) -> Option<[f32; N]> {
        let mut out = [0.0; N];
        for value in &mut out {
            let [low, middle, high] = self.array()?;
            *value = Some(f32::from_le_bytes([0, low, middle, high])).filter(|x| x.is_finite())?;
        }
        Some(out)
    }

    /// Takes a finite f32.
    pub(in crate::packed) fn f32(&mut self) -> Option<f32> {
        self.array().map(f32::from_le_bytes).filter(|x| x.is_finite())
    }

    /// Takes `N` integers of 16 bits.
    pub(in crate::packed) fn i16s<const N: usize>(&mut self) -> Option<[i16; N]> {
        let mut out = [0; N];
        for value in &mut out {
            *value = self.array().map(i16::from_le_bytes)?;
        }
        Some(out)
    }

    /// Takes `N` finite f32.
    pub(in crate::packed) fn f32s<const N: usize>(&mut self) -> Option<[f32; N]> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = self.f32()?;
        }
        Some(out)
    }
}

/// A reader that takes the named fields of a head.
#[derive(Debug, Clone, Copy)]
pub(in crate::packed) struct Fields<'a>(pub(in crate::packed) ByteReader<'a>);

impl<'a> Fields<'a> {
    /// Takes a field. An error names the field.
    pub(in crate::packed) fn take<T>(
        &mut self,
        name: &str,
        take: impl FnOnce(&mut ByteReader<'a>) -> Option<T>,
    ) -> Result<T, BrokenHead> {
        let left = self.0.0.len();
        take(&mut self.0).ok_or_else(|| {
            BrokenHead(format!("'{name}' is cut off or not a number of its type; {left} bytes were left"))
        })
    }
}

/// Writes an integer in groups of 7 bits, a byte each, low bits first. All bytes but the last have their highest bit set.
pub(in crate::packed) fn put_number(out: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        out.push(number.to_le_bytes()[0] | 0x80);
        number >>= 7;
    }
    out.push(number.to_le_bytes()[0]);
}

/// Writes `x` as a bf16: its two high bytes. The others must be 0.
pub(in crate::packed) fn put_bf16(out: &mut Vec<u8>, x: f32) {
    out.extend(x.to_le_bytes().iter().skip(2));
}

/// Writes `x` as an f24: its three high bytes. The other must be 0; see [`nearest_f24`].
pub(in crate::packed) fn put_f24(out: &mut Vec<u8>, x: f32) {
    out.extend(x.to_le_bytes().iter().skip(1));
}

/// Returns the f24 nearest to `x`. It is finite if `x` is.
pub(in crate::packed) fn nearest_f24(x: f32) -> f32 {
    let cut = |bits: u32| f32::from_bits(bits & !0xff);
    let near = cut(x.to_bits().wrapping_add(0x80));
    if near.is_finite() { near } else { cut(x.to_bits()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_and_have_one_form() {
        for number in [0, 1, 127, 128, 300, 16_383, 16_384, u64::from(u32::MAX), u64::MAX] {
            let mut out = Vec::new();
            put_number(&mut out, number);
            assert_eq!(ByteReader(&out).number(), Some(number));
            assert_eq!(ByteReader(&out[..out.len() - 1]).number(), None);
        }
        for bytes in [&[0x80, 0][..], &[0xff; 10], &[0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 2]]
        {
            assert_eq!(ByteReader(bytes).number(), None, "{bytes:?}");
        }
    }

    #[test]
    fn bf16_come_back() {
        for x in [0.0, 1.0, -1.5, -3.389_531_4e38] {
            let mut out = Vec::new();
            put_bf16(&mut out, x);
            assert_eq!((out.len(), ByteReader(&out).bf16()), (2, Some(x)));
        }
        assert_eq!(ByteReader(&[0x80, 0x7f]).bf16(), None);
    }

    #[test]
    fn f24_are_the_nearest_and_come_back() {
        for x in [0.0, 1.0, -1.5, 3.25e-3, 0.1, -7.3, 1e30, -1e-30, f32::MAX, f32::MIN] {
            let near = nearest_f24(x);
            let next = |near: f32| f32::from_bits(near.to_bits().wrapping_add(0x100));
            // Half of the distance of two numbers of 15 bits after the first. The largest f32 has no f24 above it.
            let most = if next(near).is_finite() { x.abs() / 65536.0 } else { x.abs() / 32768.0 };
            assert!((near - x).abs() <= most, "{x} {near}");
            let mut out = Vec::new();
            put_f24(&mut out, near);
            assert_eq!((out.len(), ByteReader(&out).f24s()), (3, Some([near])));
        }
        for bytes in [&[0, 0x80, 0x7f][..], &[1, 0x80, 0xff], &[0, 0]] {
            assert_eq!(ByteReader(bytes).f24s::<1>(), None);
        }
    }
}
