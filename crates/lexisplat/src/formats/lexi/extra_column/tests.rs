//! Tests of whole columns.

use proptest::prelude::*;

use super::*;
use crate::support::rng::SplitMix64;

/// Returns values of type `ty` with the low bits of `words`.
fn values_of(ty: ScalarType, words: &[u64]) -> ExtraValues {
    with_scalar!(ty, T => {
        let value = |word: &u64| T::from_le_bytes(*word.to_le_bytes().first_chunk().unwrap());
        words.iter().map(value).collect::<Vec<T>>().into()
    })
}

/// Returns 32 random bits.
fn high_bits(random: &mut SplitMix64) -> u32 {
    u32::try_from(random.next() >> 32).unwrap()
}

fn all_bits(values: &ExtraValues) -> Vec<u64> {
    bits(values, 0..values.len())
}

fn encode(values: &ExtraValues) -> Vec<u8> {
    let mut encoder = ColumnEncoder::new(values.scalar_type());
    let mut bytes = encoder.push(values);
    bytes.extend(encoder.finish());
    bytes
}

/// Returns all values of the column in `bytes`.
fn decode(bytes: &[u8], rows: usize) -> Result<ExtraValues, ColumnError> {
    Column::new(bytes, rows)?.values(0..rows)
}

/// Returns columns of `rows` rows that take different filters: smooth, noisy, constant and of few values.
fn columns(rows: usize) -> Vec<ExtraValues> {
    let mut random = SplitMix64::new(3);
    let walk = (0..rows).scan(100_u16, |value, _| {
        *value = value.wrapping_add([u16::MAX, 0, 1][random.below(3)]);
        Some(*value)
    });
    let walk = walk.collect::<Vec<_>>();
    let mut random = SplitMix64::new(4);
    let noise = (0..rows).map(|_| f32::from_bits(high_bits(&mut random))).collect::<Vec<_>>();
    let times = (0..rows).map(|_| random.below(300) as f64 / 30.0).collect::<Vec<_>>();
    let steps = (0..rows).map(|row| [3_i32, 70_000, -5][row / 50 % 3]).collect::<Vec<_>>();
    vec![walk.into(), noise.into(), times.into(), steps.into(), vec![-0.0_f64; rows].into()]
}

proptest! {
    // Each case makes hundreds of streams.
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn every_type_comes_back_bit_by_bit(
        words in prop::collection::vec(any::<u64>(), 0..300),
        kind in 0..4,
        cut in 0_usize..300,
        range in (0_usize..310, 0_usize..310),
    ) {
        for ty in TYPES {
            let wide = 8 * ty.bytes();
            let word = |word: u64| match kind {
                0 => word,
                // Few values, among them NaNs of several payloads and signs.
                1 => (u64::MAX << (wide / 2)) ^ (word % 5),
                // Zeros of either sign.
                2 => (word & 1) << (wide - 1),
                _ => word % 50,
            };
            let values = values_of(ty, &words.iter().map(|&w| word(w)).collect::<Vec<_>>());
            let bytes = encode(&values);
            prop_assert!(bytes.len() <= words.len() * ty.bytes() + 128);
            let column = Column::new(&bytes, words.len()).unwrap();
            prop_assert_eq!(column.scalar_type(), ty);
            prop_assert_eq!(all_bits(&column.values(0..words.len()).unwrap()), all_bits(&values));
            let piece = column.values(range.0..range.1).unwrap();
            let expected = all_bits(&values);
            let expected = expected.get(range.0..range.1.min(expected.len())).unwrap_or_default();
            prop_assert_eq!(all_bits(&piece), expected);
            let cut = cut.min(words.len());
            let mut encoder = ColumnEncoder::new(ty);
            let mut pieces = encoder.push(&values_of(ty, &all_bits(&values)[..cut]));
            pieces.extend(encoder.push(&values_of(ty, &all_bits(&values)[cut..])));
            pieces.extend(encoder.finish());
            prop_assert_eq!(pieces, bytes);
        }
    }
}

#[test]
fn parts_do_not_change_the_bytes_and_ranges_are_slices() {
    let rows = 3 * BLOCK + 700;
    for values in columns(rows) {
        let (ty, words) = (values.scalar_type(), all_bits(&values));
        let bytes = encode(&values);
        for piece in [BLOCK - 1, BLOCK, 2 * BLOCK + 5] {
            let mut encoder = ColumnEncoder::new(ty);
            let mut pieces: Vec<u8> =
                words.chunks(piece).flat_map(|piece| encoder.push(&values_of(ty, piece))).collect();
            pieces.extend(encoder.finish());
            assert!(pieces == bytes, "{ty:?} in pieces of {piece}");
        }
        let column = Column::new(&bytes, rows).unwrap();
        let ranges = [
            0..rows,
            0..1,
            BLOCK - 1..BLOCK + 1,
            BLOCK..2 * BLOCK,
            100..2 * BLOCK + 1,
            rows - 1..rows,
            rows..rows,
            0..0,
        ];
        for range in ranges {
            let found = column.values(range.clone()).unwrap();
            assert!(all_bits(&found) == words[range.clone()], "{ty:?} {range:?}");
        }
        assert_eq!(column.values(rows - 1..usize::MAX).unwrap().len(), 1);
    }
}

#[test]
fn only_the_blocks_of_a_range_are_decoded() {
    let rows = 2 * BLOCK + 10;
    let mut bytes = encode(&columns(rows)[4]);
    // The filter of the last block comes before a value of 8 bytes.
    let filter = bytes.len() - 9;
    bytes[filter] = 99;
    let column = Column::new(&bytes, rows).unwrap();
    assert!(column.values(0..2 * BLOCK).is_ok());
    assert_eq!(column.values(0..2 * BLOCK + 1), Err(ColumnError::Block(2)));
}

#[test]
fn damage_is_refused_or_gives_as_many_values() {
    let rows = 300;
    for values in columns(rows) {
        let bytes = encode(&values);
        for len in 0..bytes.len() {
            decode(&bytes[..len], rows).unwrap_err();
        }
        let longer = [&bytes[..], &[0]].concat();
        assert_eq!(decode(&longer, rows), Err(ColumnError::Trailing(1)));
        for wrong in [0, 1, rows - 1, rows + 1, BLOCK + 1, usize::MAX] {
            let constant = bytes.len() < 20 && wrong.div_ceil(BLOCK) == 1;
            assert_eq!(decode(&bytes, wrong).is_ok(), constant, "{wrong} rows");
        }
        let mut accepted = 0;
        for bit in 0..8 * bytes.len() {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            match decode(&damaged, rows) {
                Ok(found) => {
                    assert_eq!(found.len(), rows);
                    accepted += 1;
                }
                Err(error) => assert!(!error.to_string().is_empty()),
            }
        }
        assert!(accepted < 8 * bytes.len());
    }
}

/// Returns a column of type U8 with one block, whose body is `body`.
fn column_of(body: &[u8]) -> Vec<u8> {
    let number = TYPES.iter().position(|&ty| ty == ScalarType::U8).unwrap();
    [&[number.to_le_bytes()[0]], &deflate::length_bytes(body.len())[..], body].concat()
}

#[test]
fn blocks_that_no_encoder_makes_are_refused() {
    let numbers = |filter: u8, bytes: &[u8]| {
        let mut out = vec![filter];
        deflate::put(bytes, &mut out);
        out
    };
    let palette = |last: u16, values: &[u8], indices: &[u8]| {
        column_of(&[&[4], &last.to_le_bytes()[..], &numbers(1, values), &numbers(2, indices)].concat())
    };
    assert_eq!(decode(&palette(1, &[7, 9], &[0, 1, 1]), 3).unwrap(), vec![7_u8, 9, 9].into());
    let damaged = Err(ColumnError::Block(0));
    // An index beyond the palette, a palette longer than the block, and a palette of another length than stated.
    assert_eq!(decode(&palette(1, &[7, 9], &[0, 1, 2]), 3), damaged);
    assert_eq!(decode(&palette(3, &[7, 9, 1, 2], &[0, 1, 1]), 3), damaged);
    assert_eq!(decode(&palette(1, &[7, 9, 1], &[0, 1, 1]), 3), damaged);
    assert_eq!(decode(&column_of(&[0, 5]), 3).unwrap(), vec![5_u8; 3].into());
    for body in [&[][..], &[0], &[0, 5, 5], &[5, 0], &[4], &[4, 0], &[1], &[2, 0, 0, 0, 0]] {
        assert_eq!(decode(&column_of(body), 3), damaged, "{body:?}");
    }
    // A byte after the streams of a block, and an unknown type.
    assert_eq!(decode(&column_of(&[numbers(1, &[1, 2, 3]), vec![0]].concat()), 3), damaged);
    assert_eq!(decode(&[8], 0), Err(ColumnError::Type(8)));
    assert_eq!(decode(&[], 0), Err(ColumnError::NoType));
    assert_eq!(decode(&[1], 0).unwrap(), Vec::<u8>::new().into());
    assert_eq!(decode(&[1], usize::MAX), Err(ColumnError::Truncated(0)));
}

#[test]
fn columns_take_the_bytes_that_are_expected() {
    let rows = 100_000;
    let mut random = SplitMix64::new(7);
    for ty in TYPES {
        let constant = values_of(ty, &vec![0x3f80_0000_3f80_0000; rows]);
        assert!(encode(&constant).len() < 100, "{ty:?}");
    }
    // Labels below 50 that change every hundred rows or so.
    let mut label = 0;
    let labels: Vec<u64> = (0..rows)
        .map(|_| {
            if random.below(100) == 0 {
                label = random.below(50) as u64;
            }
            label
        })
        .collect();
    for ty in TYPES {
        assert!(encode(&values_of(ty, &labels)).len() < rows / 20, "{ty:?}");
    }
    let noise: Vec<u64> = (0..rows).map(|_| u64::from(high_bits(&mut random))).collect();
    assert!(encode(&values_of(ScalarType::F32, &noise)).len() < 404 * rows / 100);
    // Few values in no order, noise of few exponents, and a smooth curve take a palette, planes and differences.
    let per_row = |values: &[f32]| encode(&values.to_vec().into()).len() as f64 / rows as f64;
    let times: Vec<f32> = (0..rows).map(|_| random.below(300) as f32 / 30.0).collect();
    assert!(per_row(&times) < 1.2, "{}", per_row(&times));
    let small: Vec<f32> = (0..rows).map(|_| random.below(1 << 24) as f32 / (1 << 24) as f32).collect();
    assert!(per_row(&small) < 3.3, "{}", per_row(&small));
    let smooth: Vec<f32> =
        (0..rows).map(|row| 2.0 + (row as f32 * 1e-4).sin() + random.below(1 << 10) as f32 * 1e-6).collect();
    assert!(per_row(&smooth) < 2.0, "{}", per_row(&smooth));
}
