//! Codes that come back: what is read and written again has the same bits.

/// Most rounds until nothing changes.
const ROUNDS: usize = 8;

/// Encodes on from `first` until decoding and encoding again gives the same. If codes take turns, it is the smallest of
/// them.
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
