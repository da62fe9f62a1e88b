//! Codes that are stable: values that are read and written again have the same bits.

/// Largest number of rounds until a code is stable.
const ROUNDS: usize = 8;

/// Returns a stable code: encodes again, beginning with `first`, until decoding and encoding gives the same code. If
/// several codes alternate, the smallest of them is returned.
pub(crate) fn settled<T: Copy + Ord>(first: T, again: impl Fn(T) -> T) -> T {
    let mut code = first;
    for _ in 0..ROUNDS {
        let next = again(code);
        if next == code {
            return code;
        }
        code = next;
    }
    let mut least = code;
    for _ in 0..ROUNDS {
        code = again(code);
        least = least.min(code);
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_settle_or_take_turns() {
        assert_eq!(settled(100_u32, |code| code / 2), 0);
        assert_eq!(settled(7_u32, |code| code ^ 1), 6);
    }
}
