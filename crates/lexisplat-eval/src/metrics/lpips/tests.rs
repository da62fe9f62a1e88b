//! LPIPS beside the published package, with made-up weights.

use super::testing::random;
use super::*;
use crate::metrics::testing::{golden, picture};

/// The results of package `lpips` 0.1.4 for the pictures of [`golden`] in `f64`, in both ranges, with weights of
/// `scripts/lpips_weights.py --random 1`; `benches/metrics_beside_references.py --golden` prints them.
const GOLDEN: [(Network, [f64; 2]); 2] =
    [(Network::Vgg, [0.116_218_292, 0.040_702_511]), (Network::Alex, [0.167_361_122, 0.068_707_894])];

const RANGES: [PixelRange; 2] = [PixelRange::Standard, PixelRange::Inria];

#[test]
fn agrees_with_the_published_package() {
    let [a, b] = golden();
    for (network, expected) in GOLDEN {
        let lpips = random(network, 1);
        for (range, expected) in RANGES.into_iter().zip(expected) {
            let found = lpips.distance(&a, &b, range).unwrap();
            assert!((found - expected).abs() < 1e-6, "{network} {range:?}: {found} {expected}");
        }
    }
}

#[test]
fn distances_are_symmetric_and_zero_to_itself() {
    let (a, b) = (picture(40, 33, 1), picture(40, 33, 2));
    let lpips = random(Network::Alex, 2);
    for range in RANGES {
        let distance = lpips.distance(&a, &b, range).unwrap();
        assert!(distance > 1e-3, "the pictures must differ for this to mean anything: {distance}");
        assert_eq!(lpips.distance(&b, &a, range).unwrap().to_bits(), distance.to_bits());
        assert!(lpips.distance(&a, &a, range).unwrap().abs() < 1e-300);
    }
}

#[test]
fn colours_are_clipped_first() {
    let lpips = random(Network::Alex, 3);
    let a = picture(36, 32, 1);
    let clipped = Image { pixels: a.pixels.iter().map(|p| p.map(clip)).collect(), ..a.clone() };
    assert!(a != clipped, "some values must lie outside 0..1");
    assert!(lpips.distance(&a, &clipped, PixelRange::Standard).unwrap().abs() < 1e-300);
    let mut odd = a.clone();
    odd.pixels[5] = [0.0, f32::INFINITY, f32::NEG_INFINITY];
    assert!(lpips.distance(&a, &odd, PixelRange::Inria).unwrap() > 0.0);
    odd.pixels[5][0] = f32::NAN;
    assert!(lpips.distance(&a, &odd, PixelRange::Inria).is_err());
}

#[test]
fn pictures_too_small_for_the_pools_are_refused() {
    for network in Network::ALL {
        let lpips = random(network, 1);
        let least = network.min_size();
        for range in RANGES {
            let (a, b) = (picture(least, least, 1), picture(least, least, 2));
            assert!(lpips.distance(&a, &b, range).unwrap() > 0.0);
            for (width, height) in [(least - 1, least), (least, least - 1), (1, 1)] {
                let (a, b) = (picture(width, height, 1), picture(width, height, 2));
                let error = lpips.distance(&a, &b, range).unwrap_err().to_string();
                assert!(error.contains(&format!("at least {least} x {least} pixels")), "{error}");
            }
        }
        // The size is the smallest that the layers allow, not only the smallest let through.
        let padding = network.stages()[0].convs[0].padding;
        let mut map = Some(Map::zeros(least as usize - 1, least as usize, COLOURS, padding));
        for layers in &lpips.stages {
            map = map.and_then(|map| lpips.run(layers, map).ok());
        }
        assert!(map.is_none(), "{network}");
    }
    let lpips = random(Network::Alex, 1);
    assert!(lpips.distance(&picture(40, 41, 1), &picture(41, 40, 1), PixelRange::Standard).is_err());
}

#[test]
fn weights_that_overflow_give_no_number() {
    let shape = |name: &str| if name.starts_with("features") { f32::MAX } else { 1.0 };
    let get = |name: &str, sizes: &[usize]| Ok(vec![shape(name); sizes.iter().product()]);
    let lpips = Lpips::build(Network::Alex, get).unwrap();
    let error = lpips.distance(&picture(40, 40, 1), &picture(40, 40, 2), PixelRange::Standard).unwrap_err();
    assert!(error.to_string().contains("overflow"), "{error}");
}

#[test]
fn threads_do_not_change_the_distance() {
    let (a, b) = (picture(70, 50, 4), picture(70, 50, 5));
    let lpips = random(Network::Alex, 4);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| lpips.distance(&a, &b, PixelRange::Standard)).unwrap().to_bits()
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn sums_of_any_length_add_every_term() {
    for count in [0, 1, 7, 8, 9, 64] {
        let expected: usize = (0..count).sum();
        assert!((sum_lanes(count, |i| i as f64) - expected as f64).abs() < 1e-9, "{count}");
    }
}
