//! Tests of the integers against i64 and f64.

use proptest::prelude::*;

use super::*;
use crate::support::rng::SplitMix64;

/// Integers as a head may hold them, also unusual ones.
fn integers() -> impl Strategy<Value = Integers> {
    let number = || prop_oneof![any::<i16>(), Just(i16::MIN), Just(i16::MAX), -4096_i16..4096];
    let step = (any::<u16>(), Step::SHIFTS).prop_map(|(mantissa, shift)| Step { mantissa, shift });
    let slopes = move || prop::array::uniform3(prop::array::uniform4(number()));
    let predictors = prop::array::uniform7(prop::array::uniform7(number()));
    let head = (number(), prop::array::uniform5(step), prop::array::uniform7(number()));
    (head, slopes(), slopes(), predictors).prop_map(|((cell, steps, means), turns, moves, predictors)| {
        Integers { cell, steps, turns, moves, means, predictors }
    })
}

/// Features of `N` scales or other values.
fn features<const N: usize>() -> impl Strategy<Value = [i32; N]> {
    let one = prop_oneof![-MOST_FEATURE..=MOST_FEATURE, Just(-MOST_FEATURE), Just(MOST_FEATURE), -3000..3000];
    prop::collection::vec(one, N).prop_map(|v| std::array::from_fn(|k| v[k]))
}

fn lanes<const N: usize>(values: [i32; N]) -> [Lanes; N] {
    values.map(|v| [v; LANES])
}

/// Returns the logarithm of a step in 2^-9 octaves, by f64.
fn logarithm(row: [i16; SLOPES], class: u32, scales: [i32; 3]) -> f64 {
    let slope = |k: usize| f64::from(row[k + 1]) / 4096.0 * f64::from(scales[k]);
    f64::from(row[0]) + 512.0 * f64::from(class) + slope(0) + slope(1) + slope(2)
}

/// Returns the number of bits for a number of values by f64. `log` is its binary logarithm in 512ths.
fn bits(log: f64) -> f64 {
    ((log + 255.0) / 512.0).floor().clamp(0.0, 15.0)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// A step is the nearest one of 16 bits, rounded down to a unit. It doubles from class to class.
    #[test]
    fn steps_are_nearest(mantissa in 1.0..2.0_f64, exponent in -30..2_i32, class in 0_u32..16) {
        let x = libm::ldexp(mantissa, exponent);
        let wanted = x * libm::exp2(class.into()) * 1_048_576.0;
        let found = f64::from(Step::of(x).at(class));
        let limited = wanted.clamp(1.0, 1.5 * 1_048_576.0);
        prop_assert!((found - limited).abs() <= 1.0 + limited / 65_536.0, "{x}, {class}: {found} of {wanted}");
    }

    #[test]
    fn any_step_is_within_limits(p in integers(), class in any::<u32>()) {
        let steering = Steering::new(&p);
        for t in 0..TARGETS {
            let step = steering.step(t, &[class; LANES])[2];
            prop_assert!((1..=MOST_STEP.cast_signed()).contains(&step));
            let own = p.steps[t.min(4)].at(class & 15);
            prop_assert_eq!(step.cast_unsigned(), own);
        }
    }

    #[test]
    fn predictions_are_sums_of_products(p in integers(), f in features::<6>(), t in 0..TARGETS) {
        let found = Steering::new(&p).predict(t, &lanes(f))[9];
        let row = p.predictors[t].map(i64::from);
        // In 2^-17: products are rounded down.
        let sum = (1..COEFFICIENTS).fold(row[0] * 256, |sum, k| sum + (row[k] * i64::from(f[k - 1])).div_euclid(16));
        prop_assert_eq!(i64::from(found), sum.clamp(-(1 << 25), 1 << 25) * 8);
        let real = |k: usize| f64::from(p.predictors[t][k]) / 4096.0 * f64::from(f[k - 1]) / 512.0;
        let exact = f64::from(p.predictors[t][0]) / 512.0 + (1..COEFFICIENTS).map(real).sum::<f64>();
        let value = f64::from(found) / 1_048_576.0;
        prop_assert!(value.abs() >= 256.0 || (value - exact).abs() <= 6.0 / 131_072.0);
    }

    /// Logarithms are rounded down three times, so a number of bits may be off by one where a logarithm is at a limit.
    #[test]
    fn bits_of_axes(p in integers(), class in 0_u32..16, mut scales in features::<3>()) {
        scales.sort_unstable_by(|a, b| b.cmp(a));
        let (found, needle) = Steering::new(&p).axis_bits(&[class; LANES], &lanes(scales));
        prop_assert_eq!(needle[3], scales[0] - scales[1] >= scales[1] - scales[2]);
        let log = |k: usize| logarithm(p.turns[k], class, scales).min(512.0 * libm::log2(1.2));
        let (turn, other) = if needle[3] { (0, 2) } else { (2, 0) };
        // A coordinate of an axis has 2.5 values a radian, and a turn has a range of pi.
        for over in [-4.0, 0.0, 4.0] {
            let pair = 0.5 * (log(1) + log(other));
            let near = bits(512.0 * libm::log2(2.5) - pair + over) - f64::from(found[0][3]);
            let nearer = bits(512.0 * libm::log2(std::f64::consts::PI) - log(turn) + over) - f64::from(found[1][3]);
            prop_assert!(near * over >= 0.0 && nearer * over >= 0.0 && near.abs() <= 1.0 && nearer.abs() <= 1.0);
        }
        // Every Gaussian takes some bits for its rotation.
        prop_assert!(found.iter().all(|bits| (1..=15).contains(&bits[3])));
    }

    #[test]
    fn steps_of_moves(p in integers(), class in 0_u32..16, scales in features::<3>()) {
        let steering = Steering::new(&p);
        let found = steering.move_logs(&[class; LANES], &lanes(scales));
        for k in 0..3 {
            // The largest step is two standard deviations along the longest axis.
            let most = 512.0 + f64::from(scales[0]) / std::f64::consts::LN_2;
            let expected = logarithm(p.moves[k], class, scales).min(most);
            // 739 is 512 / ln 2, within 0.05 %.
            let error = 4.0 + 5e-4 * f64::from(scales[0]).abs();
            prop_assert!((f64::from(found[k][1]) - expected).abs() <= error, "{expected} {found:?}");
            let over = f64::from(p.cell) - f64::from(found[k][1]);
            let context = ((over / 512.0 + 2.25) * 2.0).floor().clamp(0.0, 23.0);
            prop_assert_eq!(f64::from(steering.fineness(found[k][1])), context);
        }
    }

    #[test]
    fn features_are_values_with_fewer_bits(value in any::<i32>()) {
        let expected = (f64::from(value) / 2048.0).floor().clamp(-16_383.0, 16_383.0);
        prop_assert_eq!(f64::from(feature(value)), expected);
    }
}

#[test]
fn integers_are_nearest_to_parameters() {
    let mut p = Parameters {
        cell: 0.37,
        base: ColourAndShape { colour: 0.01, shape: 0.002 },
        factors: [1.5, 9.0, 0.5, 1.0, 2.0, 3.0],
        ..Default::default()
    };
    p.rotation[1] = [0.7, -0.33, 1.25, 0.001];
    p.means = [-4.2, -5.0, -6.1, -0.5, 0.3, -0.2, 0.1];
    p.predictors[0] = [-1.0, 0.9, 0.1, -0.05, 0.0, 0.0, 0.0];
    p.predictors[5] = [0.5, 0.9, 0.1, -0.05, 0.2, 0.3, -0.4];
    let unit = 4.0;
    let found = Integers::of(&p, unit);
    // Low bits that are not written are zeros.
    let near = |found: i16, unit: f64, zeros: i32, wanted: f64| {
        let most = 0.51 * f64::from(1 << zeros) / unit;
        assert!((f64::from(found) / unit - wanted).abs() <= most, "{found} {wanted}");
        assert_eq!(found % (1 << zeros), 0);
    };
    near(found.cell, 512.0, 2, libm::log2(0.37));
    near(found.turns[1][0], 512.0, 2, 0.7 + libm::log2(0.002));
    near(found.turns[1][1], 4096.0, 4, -0.33);
    near(found.means[0], 512.0, 2, -4.2);
    near(found.means[4], 512.0, 2, 0.3 / unit);
    near(found.predictors[0][0], 512.0, 2, -1.0);
    near(found.predictors[0][1], 4096.0, 4, 0.9);
    // Base colours are in units of 4, and so is their average among the features.
    near(found.predictors[5][0], 512.0, 2, 0.5 / unit);
    near(found.predictors[5][1], 4096.0, 4, 0.9);
    near(found.predictors[5][4], 4096.0, 4, 0.2 / unit);
    let step = |t: usize| f64::from(found.steps[t].at(0)) / 1_048_576.0;
    for (t, wanted) in [(0, 0.002), (1, 0.004), (2, 0.006), (3, 0.001), (4, 0.015 / unit)] {
        assert!((step(t) - wanted).abs() <= wanted / 65_536.0 + 1.0 / 1_048_576.0, "{t}: {}", step(t));
    }
}

#[test]
fn integers_come_back_in_one_form() {
    let mut rng = SplitMix64::new(9);
    for shift in 0..12 {
        let mut integers = Integers::default();
        for (group, zeros) in integers.groups() {
            for number in group {
                *number = (rng.next() as i16 >> shift) >> zeros << zeros;
            }
        }
        let bytes = integers.write();
        let mut read = Integers::default();
        assert_eq!(read.read(&bytes), Ok(()));
        assert_eq!(read, integers);
        assert!(Integers::default().read(&[&bytes[..], &[0, 0]].concat()).is_err());
        assert!(Integers::default().read(&bytes[..bytes.len() - 2]).is_err());
    }
    // A number that 16 bits do not hold.
    let mut encoder = BitEncoder::default();
    encoder.signed(&mut SignedBitModel::default(), 1 << 14);
    assert!(Integers::default().read(&encoder.finish()).is_err());
}
