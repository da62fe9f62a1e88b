//! Numbers and names as text, for people and for files.

use std::borrow::Cow;

/// Largest number of bytes of a file name. File systems allow 255, and a number and an extension may follow.
const LONGEST_NAME: usize = 180;

/// Returns `text` with certain characters escaped as in JSON, such as `\u001b`: those that a terminal obeys instead of
/// showing.
///
/// These are the control characters, the line separators and the marks that change the direction of text. Text from files
/// may hold any of them.
#[must_use]
pub fn escape(text: &str) -> Cow<'_, str> {
    escape_all(text, is_obeyed)
}

/// Escapes text of several lines like [`escape`]. Line feeds stay.
#[must_use]
pub fn escape_lines(text: &str) -> Cow<'_, str> {
    escape_all(text, |c| c != '\n' && is_obeyed(c))
}

fn escape_all(text: &str, is_escaped: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&is_escaped) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if is_escaped(c) {
            // All these characters are in the basic plane, so four digits are enough, as JSON requires.
            out += &format!("\\u{:04x}", u32::from(c));
        } else {
            out.push(c);
        }
    }
    Cow::Owned(out)
}

fn is_obeyed(c: char) -> bool {
    let is_direction =
        matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || is_direction || matches!(c, '\u{2028}' | '\u{2029}')
}

/// Returns `text` as a cell of CSV that no spreadsheet takes for a formula: text that would begin a formula gets a `'`
/// before it. Texts such as names come from files. Numbers stay as they are.
#[must_use]
pub fn csv_cell(text: &str) -> Cow<'_, str> {
    let is_formula = text.starts_with(['=', '+', '-', '@', '\t', '\r']);
    match is_formula && text.parse::<f64>().is_err() {
        true => Cow::Owned(format!("'{text}")),
        false => Cow::Borrowed(text),
    }
}

/// Returns a number of bytes as text, in the largest unit that keeps a digit before the point (powers of 1000).
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

/// Returns a whole number with a comma between thousands.
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

/// Returns a PSNR in decibels, or `identical` for `None`.
#[must_use]
pub fn decibels(psnr: Option<f64>) -> String {
    psnr.map_or_else(|| "identical".to_owned(), |value| format!("{value:.2} dB"))
}

/// Returns the ratio of `whole` to `part`, such as `2.50x`, or a dash if `part` is 0.
#[must_use]
pub fn ratio(whole: u64, part: u64) -> String {
    if part == 0 { "-".to_owned() } else { format!("{:.2}x", whole as f64 / part as f64) }
}

/// Returns `name` as one part of a path that is safe on every system. Letters, digits and `-_.` stay; other characters
/// become `_`. The result is not empty, not `.` or `..`, and at most 180 bytes long. Two names may give the same result.
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
    fn formulas_in_cells_are_text() {
        for formula in ["=1+1", "+SUM(A1)", "-2+3", "@a", "\tb", "=", "-"] {
            assert_eq!(csv_cell(formula), format!("'{formula}"));
        }
        for plain in ["-0.5", "+1e-3", "-inf", "12", "a=b", "", "bonsai-7", "'a"] {
            assert_eq!(csv_cell(plain), plain);
        }
    }

    #[test]
    fn what_a_terminal_obeys_is_written_out() {
        assert_eq!(
            escape("red \u{1b}[31m, C1 \u{9b}2J, DEL \u{7f}"),
            r"red \u001b[31m, C1 \u009b2J, DEL \u007f"
        );
        assert_eq!(escape("two\nlines\r"), r"two\u000alines\u000d");
        assert_eq!(escape("turned \u{202e}round\u{2028}"), r"turned \u202eround\u2028");
        assert_eq!(escape_lines("two\nlines\t"), "two\nlines\\u0009");
        for shown in ["C:\\scene.ply", "e\u{301}t\u{e9} \u{1f600} \u{5e9}", ""] {
            assert!(matches!(escape(shown), Cow::Borrowed(same) if same == shown));
        }
        // JSON says the same with and without.
        let value = serde_json::json!({ "name": "\u{9b}31m\n" });
        let text = value.to_string();
        assert_eq!(serde_json::from_str::<serde_json::Value>(&escape(&text)).unwrap(), value);
    }

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
