//! What can go wrong, split by who is to blame.

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Any failure of the viewer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A scene could not be read or compressed, or a word of a script not understood.
    #[error(transparent)]
    Codec(#[from] lexisplat::Error),
    /// A camera file could not be read, or a picture not be made.
    #[error(transparent)]
    Render(#[from] lexisplat_render::Error),
    /// Pictures could not be compared, or no camera is left.
    #[error(transparent)]
    Eval(#[from] lexisplat_eval::Error),
    /// There is nothing to open a window on.
    #[error("no display: neither DISPLAY nor WAYLAND_DISPLAY is set")]
    NoDisplay,
    /// There is nothing to draw a window with.
    #[error("no graphics adapter was found")]
    NoAdapter,
    /// The system refused a window.
    #[error("cannot open a window: {0}")]
    Window(String),
    /// The graphics device failed.
    #[error("graphics device: {0}")]
    Device(String),
    /// A screenshot's file is already there.
    #[error("{0} exists")]
    Exists(String),
}
