//! Opacities in 8 bits, as shares, and before the sigmoid.

use lexisplat::SURE_OPACITY;

/// Largest value of an 8-bit opacity or colour.
pub(crate) const MOST: f32 = 255.0;

/// Returns the opacity before the sigmoid of `share`. It is infinite for shares up to 0 and from 1 on.
pub(crate) fn logit(share: f32) -> f32 {
    if share <= 0.0 {
        f32::NEG_INFINITY
    } else if share >= 1.0 {
        f32::INFINITY
    } else {
        libm::logf(share / (1.0 - share))
    }
}

/// Returns the opacity as a share, 0 to 1, for `opacity` before the sigmoid.
pub(crate) fn sigmoid(opacity: f32) -> f32 {
    1.0 / (1.0 + libm::expf(-opacity.clamp(-SURE_OPACITY, SURE_OPACITY)))
}

/// Returns the opacities before the sigmoid of all 8-bit opacities. The first and the last are infinite.
pub(crate) fn logits() -> [f32; 256] {
    std::array::from_fn(|k| logit(k as f32 / MOST))
}

/// Returns `share`, from 0 to 1, in 8 bits, rounded to the nearest.
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
