//! Facts in the header of a file, for JavaScript.

use std::fmt::Write;

use lexisplat::lexi::Layout;

/// Returns a JSON object of whole numbers, the layout, and whether the source was anti-aliased. Names need no escapes.
pub(crate) fn json(layout: Layout, antialiased: bool, fields: &[(&str, u64)]) -> String {
    let mut json = format!(r#"{{"layout":"{layout}","antialiased":{antialiased}"#);
    for (name, value) in fields {
        // Writing to a `String` does not fail.
        let _ = write!(json, r#","{name}":{value}"#);
    }
    json.push('}');
    json
}
