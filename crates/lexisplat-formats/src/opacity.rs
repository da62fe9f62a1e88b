//! Opacities of 8 bits and as shares, and before the sigmoid.

use lexisplat::SURE_OPACITY;

/// Bits of an 8-bit opacity or colour: its largest value.
pub(crate) const MOST: f32 = 255.0;

/// The opacity before the sigmoid of `share`, 0 to 1. It is infinite for 0 and 1, and below and above.
pub(crate) fn logit(share: f32) -> f32 {
    if share <= 0.0 {
        f32::NEG_INFINITY
    } else if share >= 1.0 {
        f32::INFINITY
    } else {
        libm::logf(share / (1.0 - share))
    }
}

/// The share of 0 to 1 that `opacity`, which is before the sigmoid, means.
pub(crate) fn sigmoid(opacity: f32) -> f32 {
    1.0 / (1.0 + libm::expf(-opacity.clamp(-SURE_OPACITY, SURE_OPACITY)))
}

/// The opacities before the sigmoid of all 8-bit opacities; infinite at both ends.
pub(crate) fn logits() -> [f32; 256] {
    std::array::from_fn(|k| logit(k as f32 / MOST))
}

/// `share` of 0 to 1 as 8 bits, rounded to the nearest.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited to 8 bits")]
pub(crate) fn to_byte(share: f32) -> u8 {
    (share * MOST).round().clamp(0.0, MOST) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_back() {
        for (k, &opacity) in (0..=255_u8).zip(&logits()) {
            assert_eq!(to_byte(sigmoid(opacity)), k);
        }
        assert_eq!([sigmoid(f32::INFINITY), sigmoid(SURE_OPACITY)], [1.0, 1.0]);
        assert_eq!(to_byte(sigmoid(-SURE_OPACITY)), 0);
    }
}
