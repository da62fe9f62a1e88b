//! The output of the program: results on standard output, notes on standard error.
//!
//! Everything goes through [`format::escape`], because names and comments from files may hold control characters.

use std::io::Write;

use anyhow::Result;
use lexisplat::Error;
use lexisplat_eval::format;
use serde::Serialize;
use serde_json::Value;

use crate::bar::without_bar;

/// Name of standard output in messages.
pub(crate) const STANDARD_OUTPUT: &str = "standard output";
/// Version of the objects that [`print_json`] prints. It rises when a member is removed or changes its meaning.
const SCHEMA_VERSION: u32 = 1;

/// Prints a line to standard error. If standard error is full, the program continues.
pub(crate) fn note(line: &str) {
    let line = format::escape(line);
    without_bar(|| {
        let _ = writeln!(std::io::stderr().lock(), "{line}");
    });
}

/// Prints warnings about `name` to standard error.
pub(crate) fn warn(name: &str, warnings: &[String]) {
    for warning in warnings {
        note(&format!("warning: {name}: {warning}"));
    }
}

/// Prints text of any number of lines to standard output.
pub(crate) fn print(text: &str) -> Result<()> {
    print_unescaped(&format::escape_lines(text))
}

/// Prints text that contains nothing from a file.
pub(crate) fn print_unescaped(text: &str) -> Result<()> {
    let write = || {
        let mut out = std::io::stdout().lock();
        out.write_all(text.as_bytes()).and_then(|()| out.flush())
    };
    without_bar(write).map_err(|e| Error::io(STANDARD_OUTPUT, e).into())
}

/// Prints a JSON object, with its schema version as the first member.
pub(crate) fn print_json(object: &Value) -> Result<()> {
    #[derive(Serialize)]
    struct Versioned<'a> {
        schema_version: u32,
        #[serde(flatten)]
        object: &'a Value,
    }
    let versioned = Versioned { schema_version: SCHEMA_VERSION, object };
    print(&format!("{}\n", serde_json::to_string_pretty(&versioned)?))
}
