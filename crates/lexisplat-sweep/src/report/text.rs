//! Text and numbers for people, safe inside HTML.

/// `text` with everything HTML gives a meaning replaced.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// 1234567 as `1,234,567`.
pub(crate) fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(c);
    }
    out
}

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
        assert_eq!(count(0), "0");
        assert_eq!(count(999), "999");
        assert_eq!(count(60_000), "60,000");
        assert_eq!(count(1_234_567), "1,234,567");
        assert_eq!(bytes(16_200), "16.2\u{a0}kB");
        assert_eq!(bytes(5_600_000), "5.60\u{a0}MB");
        assert_eq!(number(Some(f64::NAN), 2), "\u{2013}");
        assert_eq!(ratio(3.0, 0.0), "\u{2013}");
        assert_eq!(escape("<a href='x'>&\""), "&lt;a href=&#39;x&#39;&gt;&amp;&quot;");
    }
}
