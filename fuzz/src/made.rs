//! Scenes made of a fuzzer's bytes: any finite values, few Gaussians.

use lexisplat::{Geometry, SceneMeta, ShDegree, Splats};

/// Most Gaussians made.
const MOST: u8 = 12;

/// Bytes taken one value after the other; zeros beyond the end.
#[derive(Debug)]
pub struct Bytes<'a>(pub &'a [u8]);

impl Bytes<'_> {
    /// The next byte.
    pub fn byte(&mut self) -> u8 {
        self.0.split_off_first().copied().unwrap_or(0)
    }

    /// The next number: one byte for a common one, or the bits of any finite f32.
    pub fn number(&mut self) -> f32 {
        let kind = self.byte();
        match kind {
            0..=0xbf => (f32::from(kind) - 96.0) / 16.0,
            0xc0..=0xcf => {
                let power = f32::from_bits(u32::from(self.byte()) << 23 | u32::from(kind & 1) << 31);
                power.clamp(f32::MIN, f32::MAX)
            }
            0xd0 => f32::MAX,
            0xd1 => f32::MIN,
            0xd2 => 1e-40,
            0xd3 => 1e6,
            0xd4 => -1e6,
            0xd5 => 88.8,
            0xd6 => -104.0,
            _ => {
                let bits = u32::from_le_bytes(std::array::from_fn(|_| self.byte()));
                let value = f32::from_bits(bits);
                if value.is_finite() { value } else { f32::from_bits(bits & 0xbfff_ffff) }
            }
        }
    }

    /// The next `N` numbers.
    pub fn numbers<const N: usize>(&mut self) -> [f32; N] {
        std::array::from_fn(|_| self.number())
    }
}

/// A scene that passes every check on values.
pub fn scene(bytes: &mut Bytes<'_>) -> Splats {
    let degree = ShDegree::new(bytes.byte() % 5).unwrap_or(ShDegree::ZERO);
    let count = bytes.byte() % (MOST + 1);
    let copies = bytes.byte() == 1;
    let mut g = Geometry::default();
    let mut sh_rest = Vec::new();
    let taken = bytes.0;
    for _ in 0..count {
        if copies {
            bytes.0 = taken;
        }
        g.positions.push(bytes.numbers());
        g.dc.push(bytes.numbers());
        g.opacities.push(bytes.number());
        g.scales.push(bytes.numbers());
        g.rotations.push(bytes.numbers());
        sh_rest.extend((0..degree.rest()).map(|_| bytes.number()));
    }
    let meta = SceneMeta { antialiased: bytes.byte() % 2 == 1, ..SceneMeta::default() };
    Splats { geometry: g, degree, sh_rest, meta }
}
