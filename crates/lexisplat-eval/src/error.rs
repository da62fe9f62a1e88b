//! What can go wrong, split by who is to blame.

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Any failure of evaluation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
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
    /// A scene could not be read or written.
    #[error(transparent)]
    Codec(#[from] lexisplat::Error),
    /// A camera file could not be read, or a picture not be made.
    #[error(transparent)]
    Render(#[from] lexisplat_render::Error),
}

impl Error {
    pub(crate) fn parameter(name: &'static str, value: impl ToString, expected: impl Into<String>) -> Self {
        Self::Parameter { name, value: value.to_string(), expected: expected.into() }
    }
}
