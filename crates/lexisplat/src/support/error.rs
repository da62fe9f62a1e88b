//! What can go wrong, split by who is to blame.

use std::path::Path;

/// Result with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Any failure of the codec. The variant tells whose fault it is.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused a read or a write. Retry, free space, or fix permissions.
    #[error("{file}: {source}")]
    Io {
        /// The file, as the caller named it.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The bytes are not what they claim to be. The file is at fault.
    #[error("{file}: {problem}")]
    Format {
        /// The file, as the caller named it.
        file: String,
        /// What is wrong with it.
        problem: FormatError,
    },
    /// An argument is out of range. The caller is at fault.
    #[error("{name} = {value}: {expected}")]
    Parameter {
        /// The parameter's name, as the command line spells it where it has one.
        name: &'static str,
        /// The value given.
        value: String,
        /// What would have been accepted.
        expected: String,
    },
    /// The input may be well formed but asks for more than [`crate::Limits`] allows.
    #[error("{what}: {found} is over the limit of {limit}{}", advice(*.name))]
    Limit {
        /// What was counted, and the file.
        what: String,
        /// How many were asked for.
        found: u64,
        /// How many are allowed.
        limit: u64,
        /// Which of [`crate::Limits`] it is; `None` if it cannot be raised.
        name: Option<&'static str>,
    },
    /// The caller's [`Progress`](crate::Progress) cancelled the work.
    #[error("cancelled")]
    Cancelled,
}

/// How to raise the limit `name`, starting with punctuation.
fn advice(name: Option<&'static str>) -> String {
    name.map(|name| format!("; if you trust the file, raise it with --limit {name}=N")).unwrap_or_default()
}

/// What is wrong with a file's bytes.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FormatError {
    /// The file ends early.
    #[error("truncated: {what} needs {expected} bytes, the file has {found}")]
    Truncated {
        /// The part that does not fit.
        what: String,
        /// Bytes the header promises.
        expected: u64,
        /// Bytes there are.
        found: u64,
    },
    /// Bytes follow the last one the header accounts for.
    #[error("{extra} bytes follow the end of the data")]
    TrailingBytes {
        /// How many.
        extra: u64,
    },
    /// A property every Gaussian needs is not there.
    #[error("property '{name}' is missing{advice}")]
    MissingProperty {
        /// The property's name.
        name: String,
        /// What to do, starting with punctuation; may be empty.
        advice: String,
    },
    /// A known kind of file that this reader does not take.
    #[error("this is {kind}, which is not supported; {advice}")]
    Unsupported {
        /// What it is, with an article.
        kind: String,
        /// What to do instead.
        advice: String,
    },
    /// NaN or infinite values.
    #[error(
        "{count} Gaussians hold NaN or infinite values, the first is number {first} (property '{property}'); remove them with --drop-invalid"
    )]
    NotFinite {
        /// How many Gaussians hold at least one.
        count: u64,
        /// Index of the first such Gaussian, from 0.
        first: u64,
        /// The first bad property of that Gaussian.
        property: String,
    },
    /// A stored checksum does not match the bytes.
    #[error("checksum of '{part}' does not match: the file is damaged")]
    Checksum {
        /// The tensor, or `header`.
        part: String,
    },
    /// Written by a newer version of the format.
    #[error(
        "format version {found} is newer than {supported}, the newest this build reads; update lexisplat"
    )]
    Version {
        /// Version in the file.
        found: u64,
        /// Newest version this build reads.
        supported: u64,
    },
    /// Anything else; the text names the property and the value.
    #[error("{0}")]
    Malformed(String),
}

impl Error {
    /// An [`Error::Io`] about `file`.
    pub fn io(file: impl AsRef<Path>, source: std::io::Error) -> Self {
        Self::Io { file: file.as_ref().display().to_string(), source }
    }

    /// An [`Error::Format`] about `file`.
    pub fn format(file: impl Into<String>, problem: FormatError) -> Self {
        Self::Format { file: file.into(), problem }
    }

    /// An [`Error::Format`] about `file` with a free text.
    pub fn malformed(file: impl Into<String>, text: impl Into<String>) -> Self {
        Self::format(file, FormatError::Malformed(text.into()))
    }

    /// An [`Error::Limit`].
    pub(crate) fn limit(what: impl Into<String>, found: u64, limit: u64, name: Option<&'static str>) -> Self {
        Self::Limit { what: what.into(), found, limit, name }
    }

    /// An [`Error::Parameter`].
    pub fn parameter(name: &'static str, value: impl ToString, expected: impl Into<String>) -> Self {
        Self::Parameter { name, value: value.to_string(), expected: expected.into() }
    }
}
