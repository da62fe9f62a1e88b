//! Numbers as the page shows them.

/// Bytes in the unit that gives few digits; a megabyte is 10^6 bytes.
pub(crate) fn bytes(value: u64) -> String {
    let v = value as f64;
    match value {
        0..1_000 => format!("{value}\u{a0}B"),
        1_000..100_000 => format!("{:.1}\u{a0}kB", v / 1e3),
        100_000..10_000_000 => format!("{:.2}\u{a0}MB", v / 1e6),
        10_000_000..10_000_000_000 => format!("{:.1}\u{a0}MB", v / 1e6),
        _ => format!("{:.2}\u{a0}GB", v / 1e9),
    }
}

/// `value` with `digits` decimals, or a dash if there is none.
pub(crate) fn number(value: Option<f64>, digits: usize) -> String {
    value.filter(|v| v.is_finite()).map_or_else(|| "\u{2013}".to_owned(), |v| format!("{v:.digits$}"))
}

/// `a / b` as `2.7x`, or a dash if `b` is 0.
pub(crate) fn ratio(a: f64, b: f64) -> String {
    if b > 0.0 { format!("{:.2}\u{d7}", a / b) } else { "\u{2013}".to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(bytes(16_200), "16.2\u{a0}kB");
        assert_eq!(bytes(5_600_000), "5.60\u{a0}MB");
        assert_eq!(number(Some(f64::NAN), 2), "\u{2013}");
        assert_eq!(ratio(3.0, 0.0), "\u{2013}");
    }
}
