//! Numbers and names as text, for people and for files.

/// Most bytes of a file name: file systems take 255, and a number and an extension may follow.
const LONGEST_NAME: usize = 180;

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

/// Decibels, or `identical` without a number.
#[must_use]
pub fn decibels(psnr: Option<f64>) -> String {
    psnr.map_or_else(|| "identical".to_owned(), |value| format!("{value:.2} dB"))
}

/// `whole / part` as `2.50x`, or `-` if `part` is 0.
#[must_use]
pub fn ratio(whole: u64, part: u64) -> String {
    if part == 0 { "-".to_owned() } else { format!("{:.2}x", whole as f64 / part as f64) }
}

/// Text from outside, such as a name in a file, made safe for a terminal: control characters, and those that
/// change the direction of text, are written as escapes such as `\n` and `\u{1b}`.
#[must_use]
pub fn printable(text: &str) -> String {
    let turns =
        |c: char| matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if c.is_control() || turns(c) {
            out.extend(c.escape_default());
        } else {
            out.push(c);
        }
    }
    out
}

/// `name` as one part of a path that is safe on every system: letters, digits and `-_.` stay, other characters become
/// `_`. The result is not empty, not `.` or `..`, and at most 180 bytes long. Two names may give the same result.
#[must_use]
pub fn file_name(name: &str) -> String {
    let mut out = name.trim().replace(|c: char| !c.is_alphanumeric() && !"-_.".contains(c), "_");
    out.truncate(out.floor_char_boundary(LONGEST_NAME));
    if out.chars().all(|c| c == '.') { "_".to_owned() } else { out }
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

    #[test]
    fn text_from_files_cannot_drive_the_terminal() {
        assert_eq!(printable("a\u{1b}[31mb\nc\u{7}\u{9b}2J"), r"a\u{1b}[31mb\nc\u{7}\u{9b}2J");
        assert_eq!(printable("left\u{202e}right\u{2066}"), r"left\u{202e}right\u{2066}");
        for plain in ["", "caf\u{e9} \u{4e2d}", r"C:\a b", "it's \"quoted\""] {
            assert_eq!(printable(plain), plain);
        }
    }

    #[test]
    fn file_names_are_one_part_of_a_path() {
        for (name, expected) in [
            ("bonsai-3dgs_1.0", "bonsai-3dgs_1.0"),
            ("a b/c\\d:e*f", "a_b_c_d_e_f"),
            (" caf\u{e9} ", "caf\u{e9}"),
            ("../..", ".._.."),
            ("..", "_"),
            ("", "_"),
            ("a\n\u{202e}b", "a__b"),
        ] {
            assert_eq!(file_name(name), expected, "{name:?}");
        }
        let long = file_name(&"\u{20000}".repeat(300));
        assert_eq!((long.len(), long.chars().count()), (180, 45));
    }
}
