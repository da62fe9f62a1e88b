//! Numbers for people.

/// Bytes in the largest unit that keeps a digit before the point (powers of 1000).
#[must_use]
pub fn bytes(count: u64) -> String {
    let units = ["kB", "MB", "GB", "TB"];
    if count < 1000 {
        return format!("{count} B");
    }
    let mut value = count as f64 / 1000.0;
    let mut unit = 0;
    while value >= 999.95 && unit + 1 < units.len() {
        value /= 1000.0;
        unit += 1;
    }
    format!("{value:.1} {}", units[unit])
}

/// A whole number with commas.
#[must_use]
pub fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// Decibels, or that the pictures are the same.
#[must_use]
pub fn decibels(psnr: Option<f64>) -> String {
    psnr.map_or_else(|| "identical".to_owned(), |value| format!("{value:.2} dB"))
}

/// `part / whole` as "N.NNx smaller", or a dash where there is nothing to divide.
#[must_use]
pub fn ratio(whole: u64, part: u64) -> String {
    if part == 0 { "-".to_owned() } else { format!("{:.2}x", whole as f64 / part as f64) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!([bytes(0), bytes(999), bytes(1000)], ["0 B", "999 B", "1.0 kB"]);
        assert_eq!([bytes(999_949), bytes(999_950), bytes(22_312_354)], ["999.9 kB", "1.0 MB", "22.3 MB"]);
        assert_eq!(
            [count(0), count(999), count(89_963), count(1_000_000)],
            ["0", "999", "89,963", "1,000,000"]
        );
        assert_eq!([ratio(10, 4), ratio(1, 0)], ["2.50x", "-"]);
    }
}
