//! Errors, in variants by the cause: the system, the file, the caller, or a limit.

use std::path::{Path, PathBuf};

use crate::formats::kind::{FileKind, Unsupported};

/// Result with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Any failure of the codec. The variant tells the cause: the system, the file, the caller, or a limit.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused to read or write a file.
    #[error("{file}: {source}")]
    Io {
        /// The file, as the caller named it.
        file: String,
        /// The system's error.
        source: std::io::Error,
    },
    /// A writer that the caller passed refused bytes.
    #[error("output: {source}")]
    Writer {
        /// The writer's error.
        source: std::io::Error,
    },
    /// The operating system refused to make, read or write a temporary file.
    #[error("{}: {source}", folder.join("(temporary file)").display())]
    TemporaryFile {
        /// The folder of the temporary file.
        folder: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A file is damaged, or of an unsupported kind.
    #[error("{file}: {problem}")]
    Format {
        /// The file, as the caller named it.
        file: String,
        /// The fault.
        problem: FormatError,
    },
    /// An argument of the caller is out of range.
    #[error("{name} = {value}: {expected}")]
    Parameter {
        /// The parameter's name.
        name: &'static str,
        /// The value given.
        value: String,
        /// A description of the accepted values.
        expected: String,
    },
    /// The input may be well formed but is over [`crate::Limits`].
    #[error("{what}: {found} is over the limit of {limit}")]
    Limit {
        /// The counted things, and the file.
        what: String,
        /// The number in the file.
        found: u64,
        /// The allowed number.
        limit: u64,
        /// The limit to raise, one of [`crate::Limits::NAMES`]; `None` if it is fixed.
        name: Option<&'static str>,
    },
    /// The caller's [`Progress`](crate::Progress) cancelled the work.
    #[error("cancelled")]
    Cancelled,
}

/// The fault of a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FormatError {
    /// The file ends early.
    #[error("truncated: {what} needs {expected} bytes, the file has {found}")]
    Truncated {
        /// The part that does not fit.
        what: String,
        /// Number of bytes that the header promises.
        expected: u64,
        /// Number of bytes in the file.
        found: u64,
    },
    /// A property that every Gaussian needs does not exist.
    #[error("property '{name}' is missing{hint}")]
    MissingProperty {
        /// The property's name.
        name: String,
        /// The end of the message, starting with punctuation: the properties that the file has instead. It may be empty.
        hint: &'static str,
    },
    /// A file of a kind that another reader of this crate reads.
    #[error("this is {found}, not {expected}")]
    OtherKind {
        /// The kind of the file.
        found: FileKind,
        /// The kind that the reader expected.
        expected: FileKind,
    },
    /// A known kind of file that this crate does not read.
    #[error("this is {kind}, which is not supported; {}", kind.advice())]
    Unsupported {
        /// The kind of the file.
        kind: Unsupported,
    },
    /// NaN or infinite values. A reader leaves such Gaussians out if
    /// [`ReadOptions::drop_invalid`](crate::ply::ReadOptions::drop_invalid) is set.
    #[error(
        "{count} Gaussians hold NaN or infinite values, the first is number {first} (property '{property}')"
    )]
    NotFinite {
        /// Number of Gaussians that hold at least one such value.
        count: u64,
        /// Index of the first such Gaussian, from 0.
        first: u64,
        /// The first bad property of that Gaussian.
        property: String,
    },
    /// A stored checksum does not match the bytes.
    #[error("checksum of '{covered}' does not match: the file is damaged")]
    Checksum {
        /// The name of the bytes that the checksum covers: a tensor, `header`, a range of a chunk, the integers of a range,
        /// or a member of an archive.
        covered: String,
    },
    /// The file was written by a newer version of the format.
    #[error(
        "format version {found} is newer than {supported}, the newest this build reads; update lexisplat"
    )]
    Version {
        /// Version in the file.
        found: u64,
        /// Newest version that this crate reads.
        supported: u64,
    },
    /// Another fault. The text names the property and the value.
    #[error("{0}")]
    Malformed(String),
}

impl Error {
    /// Returns an [`Error::Io`] about `file`.
    pub fn io(file: impl AsRef<Path>, source: std::io::Error) -> Self {
        Self::Io { file: file.as_ref().display().to_string(), source }
    }

    /// Returns an [`Error::TemporaryFile`] in `folder`.
    pub(crate) fn temporary_file(folder: &Path, source: std::io::Error) -> Self {
        Self::TemporaryFile { folder: folder.to_owned(), source }
    }

    /// Returns an [`Error::Format`] about `file`.
    pub fn format(file: impl Into<String>, problem: FormatError) -> Self {
        Self::Format { file: file.into(), problem }
    }

    /// Returns an [`Error::Format`] about `file` with a free text.
    pub fn malformed(file: impl Into<String>, text: impl Into<String>) -> Self {
        Self::format(file, FormatError::Malformed(text.into()))
    }

    /// Returns an [`Error::Limit`].
    pub(crate) fn limit(what: impl Into<String>, found: u64, limit: u64, name: Option<&'static str>) -> Self {
        Self::Limit { what: what.into(), found, limit, name }
    }

    /// Returns an [`Error::Parameter`].
    pub fn parameter(name: &'static str, value: impl ToString, expected: impl Into<String>) -> Self {
        Self::Parameter { name, value: value.to_string(), expected: expected.into() }
    }
}
