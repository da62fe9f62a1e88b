//! Errors, split by whose fault they are.

use std::path::Path;

/// Result with this crate's [`Error`]. Functions that do not know the name of the file return a text as the error
/// instead.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Any failure of this crate. The variant tells whose fault it is.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An error of the codec: a file cannot be read, is not of the format that it claims, or has too much of something;
    /// the lengths of a scene's arrays do not match; or the caller's [`Progress`](lexisplat::Progress) cancelled the
    /// work.
    #[error(transparent)]
    Codec(#[from] lexisplat::Error),
    /// An argument is out of range. The caller is at fault.
    #[error("{name} = {value}: expected {expected}")]
    Parameter {
        /// The parameter's name.
        name: &'static str,
        /// The value given.
        value: String,
        /// The values that would have been accepted.
        expected: String,
    },
    /// A size is over a limit of this GPU. The CPU renderer has no such limit.
    #[error("{what}: {found} is over the limit of {limit}")]
    GpuLimit {
        /// The measured thing.
        what: String,
        /// The size found.
        found: u64,
        /// The largest size that the GPU allows.
        limit: u64,
    },
    /// There is no GPU, or the GPU or its driver refused something. The CPU renderer needs neither.
    #[error("{problem}")]
    Gpu {
        /// The message of the driver, or the thing that is missing.
        problem: String,
    },
}

impl Error {
    /// Returns a [`lexisplat::Error::Io`] about `file`.
    pub(crate) fn io(file: impl AsRef<Path>, source: std::io::Error) -> Self {
        lexisplat::Error::io(file, source).into()
    }

    /// Returns a [`lexisplat::Error::Format`] about `file`.
    pub(crate) fn format(file: impl Into<String>, problem: impl Into<String>) -> Self {
        lexisplat::Error::malformed(file, problem).into()
    }

    /// Returns a [`lexisplat::Error::Limit`] on a limit that a caller cannot change.
    pub(crate) fn limit(what: String, found: u64, limit: u64) -> Self {
        lexisplat::Error::Limit { what, found, limit, name: None }.into()
    }

    /// Returns an [`Error::GpuLimit`].
    #[cfg(feature = "gpu")]
    pub(crate) fn gpu_limit(what: impl Into<String>, found: impl Into<u64>, limit: u64) -> Self {
        Self::GpuLimit { what: what.into(), found: found.into(), limit }
    }

    /// Returns an [`Error::Parameter`].
    pub(crate) fn parameter(name: &'static str, value: impl ToString, expected: impl Into<String>) -> Self {
        Self::Parameter { name, value: value.to_string(), expected: expected.into() }
    }
}
