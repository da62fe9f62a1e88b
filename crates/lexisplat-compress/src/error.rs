//! Errors, split by who is to blame.

/// Result with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Any failure of compression or evaluation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused a read or a write. Retry or fix permissions.
    #[error("{file}: {source}")]
    Io {
        /// The file, as the caller named it.
        file: String,
        /// The error of the system.
        source: std::io::Error,
    },
    /// A file is damaged, or of an unsupported kind.
    #[error("{file}: {problem}")]
    Format {
        /// The file, as the caller named it.
        file: String,
        /// The fault.
        problem: String,
    },
    /// A size is over a limit.
    #[error("{what}: {found} is over the limit of {limit}")]
    Limit {
        /// The measured thing.
        what: String,
        /// The size found.
        found: u64,
        /// The largest size allowed.
        limit: u64,
    },
    /// An argument of the caller is out of range.
    #[error("{name} = {value}: {expected}")]
    Parameter {
        /// The parameter's name.
        name: &'static str,
        /// The value given.
        value: String,
        /// The values that would have been accepted.
        expected: String,
    },
    /// A choice needs the whole scene in memory, and the memory allowed is too small for it. Allow more memory, or choose a
    /// preset or a mean PSNR without cameras, with which a scene can be packed in parts.
    #[error("memory = {allowed}: at least {needed} bytes, because {choice} needs the whole scene at once")]
    Memory {
        /// The choice that needs the whole scene.
        choice: &'static str,
        /// Bytes that the whole scene needs.
        needed: u64,
        /// Bytes that are allowed.
        allowed: u64,
    },
    /// A scene could not be read or written, a camera file could not be read, or the caller's
    /// [`Progress`](lexisplat::Progress) cancelled the work.
    #[error(transparent)]
    Codec(#[from] lexisplat::Error),
    /// A camera is not valid, or a picture could not be made.
    #[error(transparent)]
    Render(lexisplat_render::Error),
}

impl From<lexisplat_render::Error> for Error {
    fn from(error: lexisplat_render::Error) -> Self {
        match error {
            lexisplat_render::Error::Codec(error) => Self::Codec(error),
            error => Self::Render(error),
        }
    }
}

impl Error {
    /// Returns an [`Error::Io`] about `file`.
    pub fn io(file: impl AsRef<std::path::Path>, source: std::io::Error) -> Self {
        Self::Io { file: file.as_ref().display().to_string(), source }
    }

    /// Returns an [`Error::Format`] about `file`.
    pub fn format(file: impl AsRef<std::path::Path>, problem: impl Into<String>) -> Self {
        Self::Format { file: file.as_ref().display().to_string(), problem: problem.into() }
    }

    /// Returns an [`Error::Parameter`].
    pub fn parameter(name: &'static str, value: impl ToString, expected: impl Into<String>) -> Self {
        Self::Parameter { name, value: value.to_string(), expected: expected.into() }
    }
}
