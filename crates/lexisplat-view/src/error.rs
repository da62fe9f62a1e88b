//! Errors of this crate.

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Any failure of the viewer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A scene could not be read or compressed, or a word of a script is not valid.
    #[error(transparent)]
    Codec(#[from] lexisplat::Error),
    /// A camera file could not be read, or a picture could not be drawn.
    #[error(transparent)]
    Render(#[from] lexisplat_render::Error),
    /// Pictures could not be compared, or no camera is left.
    #[cfg(feature = "window")]
    #[error(transparent)]
    Eval(#[from] lexisplat_compress::Error),
    /// There is no display for a window.
    #[error("no display: neither DISPLAY nor WAYLAND_DISPLAY is set")]
    NoDisplay,
    /// There is no graphics adapter and no OpenGL for the window.
    #[error(
        "nothing was found to draw a window with: no graphics adapter of Vulkan, Metal or DX12, and no OpenGL"
    )]
    NoAdapter,
    /// The operating system did not open the window or start a thread.
    #[error("cannot open a window: {0}")]
    Window(String),
    /// The graphics device failed.
    #[error("graphics device: {0}")]
    Device(String),
    /// The file of a screenshot exists already.
    #[error("{0} exists already")]
    Exists(String),
}
