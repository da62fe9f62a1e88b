//! JSON that means one thing only.
//!
//! Text that is no JSON is refused, and so are objects that name a member twice: one parser would take the first and another
//! the last.

use crate::support::order::order;

/// Largest depth of arrays and objects within one another (docs/FORMAT.md, "Container"). The outermost is 1 deep.
const MOST_DEPTH: usize = 32;

/// A JSON value.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) enum Json {
    #[default]
    Null,
    Bool(bool),
    /// A number as it is written.
    Number(String),
    Text(String),
    List(Vec<Json>),
    /// The members, sorted by their names.
    Object(Vec<(String, Json)>),
}

impl Json {
    /// Parses the value in `text`. The error is the fault of the text.
    pub(super) fn parse(text: &[u8]) -> Result<Self, String> {
        let mut parser = Parser { text, at: 0 };
        let value = parser.value(MOST_DEPTH)?;
        match parser.next_token() {
            None => Ok(value),
            Some(_) => Err(parser.wrong("something after the end")),
        }
    }

    /// Returns the member `name` of an object, if there is one.
    pub(super) fn get(&self, name: &str) -> Option<&Self> {
        let members = self.members()?;
        let index = members.binary_search_by(|member| member.0.as_str().cmp(name)).ok()?;
        members.get(index).map(|member| &member.1)
    }

    /// Returns the members of an object, sorted by their names; `None` for other values.
    pub(super) fn members(&self) -> Option<&[(String, Self)]> {
        if let Self::Object(members) = self { Some(members) } else { None }
    }

    /// Returns the items of a list; `None` for other values.
    pub(super) fn items(&self) -> Option<&[Self]> {
        if let Self::List(items) = self { Some(items) } else { None }
    }

    pub(super) fn text(&self) -> Option<&str> {
        if let Self::Text(text) = self { Some(text) } else { None }
    }

    pub(super) fn bool(&self) -> Option<bool> {
        if let Self::Bool(value) = self { Some(*value) } else { None }
    }

    /// Returns the number of type `T`; `None` if the value is not such a number.
    pub(super) fn number<T: std::str::FromStr>(&self) -> Option<T> {
        if let Self::Number(text) = self { text.parse().ok() } else { None }
    }
}

/// A parser of text, value by value.
struct Parser<'t> {
    text: &'t [u8],
    /// Position of the next byte.
    at: usize,
}

impl Parser<'_> {
    fn wrong(&self, what: &str) -> String {
        format!("{what} at byte {}", self.at)
    }

    fn peek(&self) -> Option<u8> {
        self.text.get(self.at).copied()
    }

    /// Skips white space, and returns the next byte without taking it.
    fn next_token(&mut self) -> Option<u8> {
        while let Some(b' ' | b'\n' | b'\t' | b'\r') = self.peek() {
            self.at += 1;
        }
        self.peek()
    }

    /// Takes and returns the next byte.
    fn take(&mut self) -> Result<u8, String> {
        let byte = self.peek().ok_or_else(|| self.wrong("it ends early"))?;
        self.at += 1;
        Ok(byte)
    }

    /// Takes a value with at most `depth` arrays and objects within one another.
    fn value(&mut self, depth: usize) -> Result<Json, String> {
        match self.next_token() {
            Some(b'"') => self.string().map(Json::Text),
            Some(b'-' | b'0'..=b'9') => self.number(),
            Some(b'[' | b'{') if depth == 0 => {
                Err(self.wrong(&format!("arrays and objects more than {MOST_DEPTH} deep")))
            }
            Some(b'[') => self.list(depth - 1),
            Some(b'{') => self.object(depth - 1),
            _ => self.word(),
        }
    }

    fn word(&mut self) -> Result<Json, String> {
        let words = [("null", Json::Null), ("true", Json::Bool(true)), ("false", Json::Bool(false))];
        let rest = self.text.get(self.at..).unwrap_or_default();
        for (word, value) in words {
            if rest.starts_with(word.as_bytes()) {
                self.at += word.len();
                return Ok(value);
            }
        }
        Err(self.wrong(if rest.is_empty() { "it ends early" } else { "no value" }))
    }

    fn number(&mut self) -> Result<Json, String> {
        let mut text = String::new();
        while let Some(byte @ (b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E')) = self.peek() {
            text.push(byte.into());
            self.at += 1;
        }
        let is_finite = is_number(&text) && text.parse::<f64>().is_ok_and(f64::is_finite);
        if is_finite { Ok(Json::Number(text)) } else { Err(self.wrong("no number")) }
    }

    fn string(&mut self) -> Result<String, String> {
        self.at += 1;
        let mut text = Vec::new();
        loop {
            match self.take()? {
                b'"' => return String::from_utf8(text).map_err(|_| self.wrong("text that is not UTF-8")),
                b'\\' => {
                    let char = self.escaped()?;
                    text.extend(char.encode_utf8(&mut [0; 4]).as_bytes());
                }
                0..0x20 => return Err(self.wrong("a control character")),
                byte => text.push(byte),
            }
        }
    }

    /// Takes an escape after its backslash, and returns the character that it stands for.
    fn escaped(&mut self) -> Result<char, String> {
        Ok(match self.take()? {
            byte @ (b'"' | b'\\' | b'/') => byte.into(),
            b'b' => '\u{8}',
            b'f' => '\u{c}',
            b'n' => '\n',
            b'r' => '\r',
            b't' => '\t',
            b'u' => {
                let mut code = self.hexadecimal()?;
                // Two surrogates stand for one character.
                if (0xd800..0xdc00).contains(&code) && self.take()? == b'\\' && self.take()? == b'u' {
                    let low = self.hexadecimal()?;
                    let bits = (code - 0xd800) << 10;
                    code = if (0xdc00..0xe000).contains(&low) { 0x10000 + bits + low - 0xdc00 } else { code };
                }
                char::from_u32(code).ok_or_else(|| self.wrong("half a character"))?
            }
            _ => return Err(self.wrong("an unknown escape")),
        })
    }

    /// Takes four hexadecimal digits, and returns their number.
    fn hexadecimal(&mut self) -> Result<u32, String> {
        let mut code = 0;
        for _ in 0..4 {
            let digit = char::from(self.take()?).to_digit(16);
            code = code << 4 | digit.ok_or_else(|| self.wrong("no hexadecimal digit"))?;
        }
        Ok(code)
    }

    /// Takes `end`, or a comma before another item. Returns whether there is another item.
    fn goes_on(&mut self, end: u8) -> Result<bool, String> {
        match self.next_token() {
            Some(byte) if byte == end || byte == b',' => {
                self.at += 1;
                Ok(byte != end)
            }
            _ => Err(self.wrong("no comma and no end of a list or object")),
        }
    }

    fn list(&mut self, depth: usize) -> Result<Json, String> {
        self.at += 1;
        let mut items = Vec::new();
        if self.next_token() == Some(b']') {
            self.at += 1;
            return Ok(Json::List(items));
        }
        loop {
            items.push(self.value(depth)?);
            if !self.goes_on(b']')? {
                return Ok(Json::List(items));
            }
        }
    }

    fn object(&mut self, depth: usize) -> Result<Json, String> {
        self.at += 1;
        let mut members: Vec<(String, Json)> = Vec::new();
        let mut goes_on = self.next_token() != Some(b'}');
        self.at += usize::from(!goes_on);
        while goes_on {
            if self.next_token() != Some(b'"') {
                return Err(self.wrong("no name of a member"));
            }
            let name = self.string()?;
            if self.next_token() != Some(b':') {
                return Err(self.wrong("no colon"));
            }
            self.at += 1;
            members.push((name, self.value(depth)?));
            goes_on = self.goes_on(b'}')?;
        }
        let sorted = order(members.len(), &mut |a, b| members[a].0.cmp(&members[b].0));
        let members: Vec<_> = sorted.into_iter().map(|k| std::mem::take(&mut members[k])).collect();
        match members.array_windows().find(|[a, b]| a.0 == b.0) {
            Some([twice, _]) => Err(format!("member '{}' is there twice", twice.0.escape_debug())),
            None => Ok(Json::Object(members)),
        }
    }
}

/// Returns whether `text` is a number as JSON writes it: no plus sign, no leading zeros, digits on both sides of a point.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_that_are_there_twice_are_refused() {
        for text in [r#"{"a":1,"b":{"a":[{"c":null},{"c":true}]},"c":-1.5e3,"d":"a"}  "#, "[]", "7"] {
            assert!(Json::parse(text.as_bytes()).is_ok(), "{text}");
        }
        for text in [r#"{"a":1,"a":1}"#, r#"{"b":[{"a":{},"\u0061":2}]}"#] {
            let error = Json::parse(text.as_bytes()).unwrap_err();
            assert!(error.contains("'a' is there twice"), "{error}");
        }
        for text in ["", "{", "{} {}", &"[".repeat(1000)] {
            assert!(Json::parse(text.as_bytes()).is_err(), "{text}");
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

    /// Returns the same value as `serde_json` has it.
    fn of_serde(value: &serde_json::Value) -> Json {
        use serde_json::Value;
        match value {
            Value::Null => Json::Null,
            Value::Bool(value) => Json::Bool(*value),
            Value::Number(number) => Json::Number(number.to_string()),
            Value::String(text) => Json::Text(text.clone()),
            Value::Array(items) => Json::List(items.iter().map(of_serde).collect()),
            Value::Object(members) => {
                Json::Object(members.iter().map(|(name, value)| (name.clone(), of_serde(value))).collect())
            }
        }
    }

    /// Returns the value with its numbers as `serde_json` writes them.
    fn rewritten(value: Json) -> Json {
        match value {
            Json::Number(text) => {
                let number: serde_json::Number = serde_json::from_str(&text).unwrap();
                Json::Number(number.to_string())
            }
            Json::List(items) => Json::List(items.into_iter().map(rewritten).collect()),
            Json::Object(members) => {
                Json::Object(members.into_iter().map(|(name, value)| (name, rewritten(value))).collect())
            }
            other => other,
        }
    }

    /// Checks that [`Json::parse`] takes and refuses the same texts as `serde_json`, except texts with a member twice or
    /// deeper than [`MOST_DEPTH`].
    fn agrees(text: &[u8]) {
        let shown = String::from_utf8_lossy(text);
        match (Json::parse(text), serde_json::from_slice::<serde_json::Value>(text)) {
            (Ok(own), Ok(other)) => assert_eq!(rewritten(own), of_serde(&other), "{shown}"),
            (Err(error), Ok(_)) => {
                let is_known =
                    ["is there twice", "more than 32 deep"].iter().any(|rule| error.contains(rule));
                assert!(is_known, "{shown}: {error}");
            }
            (Ok(_), Err(error)) => panic!("{shown}: {error}"),
            (Err(_), Err(_)) => {}
        }
    }

    #[test]
    fn texts_are_read_as_by_serde_json() {
        let texts: [&[u8]; 24] = [
            b" { \"a\" : [ 1 , -0.5e-3 , true , null ] , \"b\" : { } }\n\t\r",
            br#""\u0041\ud83d\ude00\\\/\b\f\n\r\t\"\u00e4""#,
            br#""\ud83d""#,
            br#""\ud83dx""#,
            br#""\ud83d\u0041""#,
            br#""\ude00""#,
            br#""\u00g0""#,
            br#""\x""#,
            b"\"\x01\"",
            b"\"\xff\"",
            b"\"\xc3\xa4\"",
            b"\"\xc3\\u00a4\"",
            b"[1,]",
            b"[,1]",
            b"{\"a\":1,}",
            b"{a:1}",
            b"1e400",
            b"-1e-400",
            b"1.7976931348623157e308",
            b"123456789012345678901234567890",
            b"1-2",
            b"nul",
            b"truefalse",
            b"\xef\xbb\xbf1",
        ];
        texts.into_iter().for_each(agrees);
        for depth in [1, 31, 32, 33, 128] {
            let lists = [vec![b'['; depth], vec![b']'; depth]].concat();
            let objects = [b"{\"a\":".repeat(depth), vec![b'1'], vec![b'}'; depth]].concat();
            for text in [lists, objects] {
                agrees(&text);
                assert_eq!(Json::parse(&text).is_ok(), depth <= MOST_DEPTH, "{depth}");
            }
        }
        const BYTES: &[u8] = b"\"\\u{}[]:,0-.eEd8x \x00\xff";
        let mut rng = crate::support::rng::SplitMix64::new(9);
        for _ in 0..20_000 {
            let mut text = texts[rng.below(2)].to_vec();
            for _ in 0..=rng.below(3) {
                let at = rng.below(text.len());
                match rng.below(3) {
                    0 => text[at] = BYTES[rng.below(BYTES.len())],
                    1 => drop(text.remove(at)),
                    _ => text.insert(at, BYTES[rng.below(BYTES.len())]),
                }
            }
            agrees(&text);
        }
    }
}
