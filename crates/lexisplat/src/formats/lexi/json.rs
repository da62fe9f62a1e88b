//! JSON that means one thing only.

use std::collections::HashSet;
use std::fmt;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};

/// Refuses text that is no JSON, and objects that name a member twice: one parser would take the first and another the
/// last. The message says which.
pub(super) fn check(text: &[u8]) -> Result<(), String> {
    serde_json::from_slice::<Unambiguous>(text).map(drop).map_err(|error| error.to_string())
}

/// Whether `text` is a number as JSON writes it: no plus sign, no leading zeros, digits on both sides of a point.
pub(super) fn is_number(text: &str) -> bool {
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let text = text.strip_prefix('-').unwrap_or(text);
    let (mantissa, exponent) = match text.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, Some(exponent)),
        None => (text, None),
    };
    let (whole, fraction) = match mantissa.split_once('.') {
        Some((whole, fraction)) => (whole, Some(fraction)),
        None => (mantissa, None),
    };
    digits(whole)
        && (whole == "0" || !whole.starts_with('0'))
        && fraction.is_none_or(digits)
        && exponent.is_none_or(|e| digits(e.strip_prefix(['+', '-']).unwrap_or(e)))
}

/// Any JSON value in which no object names a member twice.
struct Unambiguous;

impl<'de> Deserialize<'de> for Unambiguous {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Self)
    }
}

impl<'de> Visitor<'de> for Unambiguous {
    type Value = Self;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_bool<E>(self, _: bool) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_i64<E>(self, _: i64) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_u64<E>(self, _: u64) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_f64<E>(self, _: f64) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_str<E>(self, _: &str) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_unit<E>(self) -> Result<Self, E> {
        Ok(self)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Self, A::Error> {
        while items.next_element::<Self>()?.is_some() {}
        Ok(self)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<Self, A::Error> {
        let mut names = HashSet::new();
        while let Some(name) = members.next_key::<String>()? {
            members.next_value::<Self>()?;
            if let Some(twice) = names.replace(name) {
                return Err(A::Error::custom(format_args!(
                    "member '{}' is there twice",
                    twice.escape_debug()
                )));
            }
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_that_are_there_twice_are_refused() {
        for text in [r#"{"a":1,"b":{"a":[{"c":null},{"c":true}]},"c":-1.5e3,"d":"a"}  "#, "[]", "7"] {
            assert_eq!(check(text.as_bytes()), Ok(()), "{text}");
        }
        for text in [r#"{"a":1,"a":1}"#, r#"{"b":[{"a":{},"\u0061":2}]}"#] {
            let error = check(text.as_bytes()).unwrap_err();
            assert!(error.contains("'a' is there twice"), "{error}");
        }
        for text in ["", "{", "{} {}", &"[".repeat(1000)] {
            assert!(check(text.as_bytes()).is_err(), "{text}");
        }
    }

    #[test]
    fn numbers_are_those_of_json() {
        for text in ["0", "7", "-0", "10", "0.5", "-12.25", "1e9", "0.1E-7", "3e+05", "18446744073709551615"]
        {
            assert!(is_number(text), "{text}");
            assert!(serde_json::from_str::<serde_json::Number>(text).is_ok(), "{text}");
        }
        for text in
            ["", "-", "+7", "017", "00", ".5", "5.", "1e", "1e+", "0x1", "inf", "NaN", " 1", "1 ", "1_0"]
        {
            assert!(!is_number(text), "{text}");
        }
    }
}
