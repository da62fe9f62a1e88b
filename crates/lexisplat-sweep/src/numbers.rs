//! Numbers as text for pages and tables.

/// Text instead of a missing value.
pub(crate) const DASH: &str = "\u{2013}";

/// Returns `value` with `digits` digits after the point, or a dash for `None`.
pub(crate) fn number(value: Option<f64>, digits: usize) -> String {
    let text = |value| without_sign_of_zero(format!("{value:.digits$}"));
    value.filter(|v: &f64| v.is_finite()).map_or_else(|| DASH.to_owned(), text)
}

/// Returns `value` with its sign and `digits` digits after the point. A value that is rounded to zero has no sign.
pub(crate) fn signed(value: f64, digits: usize) -> String {
    without_sign_of_zero(format!("{value:+.digits$}"))
}

/// Returns `text` without its sign if it is a zero.
fn without_sign_of_zero(text: String) -> String {
    match text.strip_prefix(['-', '+']) {
        Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
        _ => text,
    }
}

/// Returns `a / b` as text such as `2.70×`, or a dash if `b` is 0.
pub(crate) fn ratio(a: f64, b: f64) -> String {
    if b > 0.0 { format!("{:.2}\u{d7}", a / b) } else { DASH.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!([None, Some(f64::NAN), Some(f64::INFINITY)].map(|v| number(v, 2)), [DASH; 3]);
        assert_eq!([2.0, -0.001, -0.01].map(|v| number(Some(v), 2)), ["2.00", "0.00", "-0.01"]);
        assert_eq!([0.2, -0.2].map(|v| signed(v, 1)), ["+0.2", "-0.2"]);
        assert_eq!([-0.004, 0.004].map(|v| signed(v, 2)), ["0.00", "0.00"]);
        assert_eq!(ratio(3.0, 0.0), DASH);
    }
}
