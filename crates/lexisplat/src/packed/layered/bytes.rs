//! Little-endian numbers in a list of bytes.

/// Takes numbers from the start of bytes. Every method returns `None` where too few bytes are left.
#[derive(Debug, Clone, Copy)]
pub(super) struct ByteReader<'a>(pub(super) &'a [u8]);

impl<'a> ByteReader<'a> {
    pub(super) fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*taken)
    }

    pub(super) fn u8(&mut self) -> Option<u8> {
        self.array().map(u8::from_le_bytes)
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// A finite number.
    pub(super) fn f32(&mut self) -> Option<f32> {
        self.array().map(f32::from_le_bytes).filter(|x| x.is_finite())
    }

    pub(super) fn i16s<const N: usize>(&mut self) -> Option<[i16; N]> {
        let mut out = [0; N];
        for value in &mut out {
            *value = self.array().map(i16::from_le_bytes)?;
        }
        Some(out)
    }

    /// Finite numbers.
    pub(super) fn f32s<const N: usize>(&mut self) -> Option<[f32; N]> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = self.f32()?;
        }
        Some(out)
    }

    /// As many rows of numbers.
    pub(super) fn rows<const N: usize, const M: usize>(&mut self) -> Option<[[i16; N]; M]> {
        let mut out = [[0; N]; M];
        for row in &mut out {
            *row = self.i16s()?;
        }
        Some(out)
    }
}
