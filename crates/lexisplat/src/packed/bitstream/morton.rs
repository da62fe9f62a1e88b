//! Cells of a grid in the order of the Morton curve.

/// Number of bits of each coordinate of a cell.
pub(in crate::packed) const BITS: u32 = 21;

/// Returns the number of the cell `(x, y, z)`: the interleaved bits of its coordinates, which are below 2^21.
pub(in crate::packed) fn encode(cell: [u32; 3]) -> u64 {
    spread(cell[0]) | spread(cell[1]) << 1 | spread(cell[2]) << 2
}

/// Returns the coordinates of the cell with the number `code`; `None` if there is no such cell.
pub(in crate::packed) fn decode(code: u64) -> Option<[u32; 3]> {
    (code >> (3 * BITS) == 0).then(|| gathered(code))
}

/// Returns the coordinates that the low bits of any number make.
#[inline(always)]
pub(in crate::packed) fn gathered(code: u64) -> [u32; 3] {
    [gather(code), gather(code >> 1), gather(code >> 2)]
}

const MASKS: [(u32, u64); 5] = [
    (32, 0x001f_0000_0000_ffff),
    (16, 0x001f_0000_ff00_00ff),
    (8, 0x100f_00f0_0f00_f00f),
    (4, 0x10c3_0c30_c30c_30c3),
    (2, 0x1249_2492_4924_9249),
];

fn spread(x: u32) -> u64 {
    MASKS.iter().fold(u64::from(x), |x, &(shift, mask)| (x | (x << shift)) & mask)
}

#[inline(always)]
fn gather(code: u64) -> u32 {
    let mut x = code & MASKS[4].1;
    for k in (0..5).rev() {
        let mask = if k == 0 { (1 << BITS) - 1 } else { MASKS[k - 1].1 };
        x = (x | (x >> MASKS[k].0)) & mask;
    }
    #[expect(clippy::cast_possible_truncation, reason = "masked")]
    let low = (x & u64::from(u32::MAX)) as u32;
    low
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn bits_alternate(x in 0..1_u32 << BITS, y in 0..1_u32 << BITS, z in 0..1_u32 << BITS) {
            let cell = [x, y, z];
            let mut code = 0_u64;
            for bit in 0..3 * BITS {
                code |= u64::from(cell[bit as usize % 3] >> (bit / 3) & 1) << bit;
            }
            prop_assert_eq!(encode(cell), code);
            prop_assert_eq!((decode(code), gathered(code)), (Some(cell), cell));
        }

        #[test]
        fn numbers_beyond_are_of_no_cell(code in any::<u64>()) {
            let fits = code >> (3 * BITS) == 0;
            prop_assert_eq!(decode(code), fits.then(|| gathered(code)));
            prop_assert!(gathered(code).iter().all(|x| x >> BITS == 0));
        }
    }

    #[test]
    fn cells_come_back() {
        for cell in
            [[0, 0, 0], [1, 2, 3], [0x1f_ffff, 0, 0x15_5555], [0x1f_ffff; 3], [123_456, 654_321, 2_000_000]]
        {
            assert_eq!(decode(encode(cell)), Some(cell));
        }
        assert_eq!(encode([1, 0, 0]), 1);
        assert_eq!(encode([0, 1, 0]), 2);
        assert_eq!(encode([0, 0, 3]), 0b10_0100);
        assert_eq!(decode(u64::MAX), None);
    }
}
