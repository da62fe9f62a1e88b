//! Errors, split by whose fault they are.

use std::path::Path;

/// Result with this crate's [`Error`]. Functions that do not know the file return a text instead.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Any failure of this crate. The variant tells whose fault it is.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The codec's error: a file cannot be read, is not what it claims to be or has too much of something, the
    /// arrays of a scene do not fit one another, or the caller's [`Progress`](lexisplat::Progress) cancelled the
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
        /// What would have been accepted.
        expected: String,
    },
    /// Something is larger than this GPU can hold. The CPU renderer has no such limit.
    #[error("{what}: {found} is over the limit of {limit}")]
    GpuLimit {
        /// What there is too much of.
        what: String,
        /// How much there is.
        found: u64,
        /// The most that the GPU takes.
        limit: u64,
    },
    /// There is no GPU, or it or its driver refused something. The CPU renderer needs neither.
    #[error("{problem}")]
    Gpu {
        /// What the driver said, or what is missing.
        problem: String,
    },
}

impl Error {
    /// A [`lexisplat::Error::Io`] about `file`.
    pub(crate) fn io(file: impl AsRef<Path>, source: std::io::Error) -> Self {
        lexisplat::Error::io(file, source).into()
    }

    /// A [`lexisplat::Error::Format`] about `file`.
    pub(crate) fn format(file: impl Into<String>, problem: impl Into<String>) -> Self {
        lexisplat::Error::malformed(file, problem).into()
    }

    /// A [`lexisplat::Error::Limit`] that is fixed.
    pub(crate) fn limit(what: String, found: u64, limit: u64) -> Self {
        lexisplat::Error::Limit { what, found, limit, name: None }.into()
    }

    /// An [`Error::GpuLimit`].
    #[cfg(feature = "gpu")]
    pub(crate) fn gpu_limit(what: impl Into<String>, found: impl Into<u64>, limit: u64) -> Self {
        Self::GpuLimit { what: what.into(), found: found.into(), limit }
    }

    /// An [`Error::Parameter`].
    pub(crate) fn parameter(name: &'static str, value: impl ToString, expected: impl Into<String>) -> Self {
        Self::Parameter { name, value: value.to_string(), expected: expected.into() }
    }
}
