//! Made-up weights, the same as of `scripts/lpips_weights.py --random SEED`.

use super::{Lpips, Network};

/// Entry `index` of a stream of numbers in 0..1 with 24 bits (SplitMix64).
fn number(seed: u64, index: u64) -> f32 {
    let mut z = seed.wrapping_add((index + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    let (high, low) = (u16::try_from(z >> 48).unwrap(), u8::try_from(z >> 40 & 0xff).unwrap());
    f32::from(high) / 65_536.0 + f32::from(low) / 16_777_216.0
}

/// The tensors of a network, in the order of its file: name, shape, values.
pub(crate) fn tensors(network: Network, seed: u64) -> Vec<(String, Vec<usize>, Vec<f32>)> {
    let mut out = Vec::new();
    let mut next = 0;
    let mut take = |shape: &[usize], map: &dyn Fn(f32) -> f32| -> Vec<f32> {
        let count = shape.iter().product::<usize>() as u64;
        next += count;
        (next - count..next).map(|index| map(number(seed, index))).collect()
    };
    let stages = network.stages();
    for conv in stages.iter().flat_map(|stage| &stage.convs) {
        let shape = conv.weight_shape();
        let inputs = (conv.inputs * conv.side * conv.side) as f64;
        #[expect(clippy::cast_possible_truncation, reason = "rounded as NumPy does")]
        let bound = (6.0 / inputs).sqrt() as f32;
        let weights = take(&shape, &|u| (2.0 * u - 1.0) * bound);
        out.push((format!("features.{}.weight", conv.index), shape.to_vec(), weights));
        let bias = take(&[conv.outputs], &|u| (2.0 * u - 1.0) * 0.1);
        out.push((format!("features.{}.bias", conv.index), vec![conv.outputs], bias));
    }
    for (number, stage) in stages.iter().enumerate() {
        let shape = vec![1, stage.convs.last().unwrap().outputs, 1, 1];
        let weights = take(&shape, &|u| u);
        out.push((format!("lin{number}.model.1.weight"), shape, weights));
    }
    out
}

/// LPIPS with made-up weights.
pub(crate) fn random(network: Network, seed: u64) -> Lpips {
    let tensors = tensors(network, seed);
    Lpips::build(network, |name, shape| {
        let (_, found, values) = tensors.iter().find(|t| t.0 == name).unwrap();
        assert_eq!(found, shape);
        Ok(values.clone())
    })
    .unwrap()
}
