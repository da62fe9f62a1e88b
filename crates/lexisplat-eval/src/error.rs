//! What can go wrong, split by who is to blame.

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Any failure of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The cameras could not be read. See [`lexisplat_render::Error`] for whose fault it is.
    #[error(transparent)]
    Cameras(#[from] lexisplat_render::Error),
    /// The file has cameras, but none of those asked for.
    #[error("{file}: none of its {cameras} cameras is in the {split} split{advice}")]
    NoViews {
        /// The file, as the caller named it.
        file: String,
        /// Cameras in the file.
        cameras: usize,
        /// The split asked for.
        split: crate::views::SplitFilter,
        /// What to do, starting with punctuation.
        advice: &'static str,
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
}
