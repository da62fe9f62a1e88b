//! Errors, split by whose fault they are.

use std::path::Path;

/// Result with this crate's [`Error`]. Functions that do not know the file return a text instead.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Any failure of this crate. The variant tells whose fault it is.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused a read. Retry or fix permissions.
    #[error("{file}: {source}")]
    Io {
        /// The file, as the caller named it.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The codec's error: the arrays of a scene do not fit one another, or the caller's
    /// [`Progress`](lexisplat::Progress) cancelled the work.
    #[error(transparent)]
    Codec(#[from] lexisplat::Error),
    /// The bytes are not what they claim to be. The file is at fault; the text names the camera, the
    /// field and the value.
    #[error("{file}: {problem}")]
    Format {
        /// The file, as the caller named it.
        file: String,
        /// What is wrong with it.
        problem: String,
    },
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
    /// A file has more of something than a limit allows.
    #[error("{what}: {found} is over the limit of {limit}")]
    Limit {
        /// What there is too much of.
        what: String,
        /// How much there is.
        found: u64,
        /// The most allowed.
        limit: u64,
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
    /// An [`Error::Io`] about `file`.
    pub(crate) fn io(file: impl AsRef<Path>, source: std::io::Error) -> Self {
        Self::Io { file: file.as_ref().display().to_string(), source }
    }

    /// An [`Error::Format`] about `file`.
    pub(crate) fn format(file: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Format { file: file.into(), problem: problem.into() }
    }

    /// An [`Error::Parameter`].
    pub(crate) fn parameter(name: &'static str, value: impl ToString, expected: impl Into<String>) -> Self {
        Self::Parameter { name, value: value.to_string(), expected: expected.into() }
    }
}
