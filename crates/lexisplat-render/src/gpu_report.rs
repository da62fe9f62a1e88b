//! Plain values that tell of a GPU and of drawing on it. They exist without the feature `gpu` too.

/// An adapter that this machine offers.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct AdapterSummary {
    /// Index in the list of adapters, best first. It is the number that [`Device::Index`](crate::Device::Index) takes.
    pub index: usize,
    /// Name of the adapter, from the driver.
    pub name: String,
    /// Driver and version.
    pub driver: String,
    /// `Vulkan`, `Metal`, `Dx12` or `BrowserWebGpu`.
    pub backend: String,
    /// Whether the adapter is software on the processor, such as lavapipe.
    pub software: bool,
    /// Largest part of a buffer that a kernel can see at once, in bytes.
    #[serde(rename = "max_binding_bytes")]
    pub max_binding: u64,
    /// Whether stages can be timed.
    pub timestamps: bool,
}

/// Measured rates of a GPU.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Speed {
    /// Bytes read plus bytes written in a second, when arrays larger than any cache are copied.
    pub copy: f64,
    /// Single-precision operations in a second. A multiplication with an addition counts as two operations.
    pub arithmetic: f64,
}

/// Numbers of bytes of a scene on the GPU.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SceneBytes {
    /// Bytes of positions, shapes and opacities.
    pub geometry: u64,
    /// Bytes of everything that colours need: base colours, coefficients or codes, dictionary, table.
    pub sh: u64,
}

/// A stage of drawing, which is timed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum DrawStage {
    /// Finds the Gaussians that may be visible.
    Cull,
    /// Projects these Gaussians to ellipses on screen.
    Project,
    /// Computes their colours.
    Radiance,
    /// Orders them by depth.
    Sort,
    /// Lists the Gaussians that may touch each tile.
    Tiles,
    /// Draws the pixels.
    Blend,
}

impl DrawStage {
    /// All stages, in the order they run.
    pub const ALL: [Self; 6] =
        [Self::Cull, Self::Project, Self::Radiance, Self::Sort, Self::Tiles, Self::Blend];

    /// Returns the name of the stage in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Cull => "cull",
            Self::Project => "project",
            Self::Radiance => "radiance",
            Self::Sort => "sort",
            Self::Tiles => "tiles",
            Self::Blend => "blend",
        }
    }
}

/// Duration of each stage, in milliseconds.
pub type StageTimes = Vec<(DrawStage, f64)>;

/// Measurements of drawing a picture.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct FrameStats {
    /// Number of Gaussians that passed the coarse test and were projected and coloured. If bands searched for their own
    /// Gaussians: that number in the fullest band.
    pub visible: u32,
    /// Number of pairs of a Gaussian and a tile that it may touch.
    pub entries: u32,
    /// Number of bands of rows of tiles. It is above 1 if the lists do not fit at once.
    pub bands: u32,
    /// How often the picture was drawn again with larger buffers. It is above 0 only if the view is fuller than all views
    /// before.
    pub retries: u32,
    /// Duration of each stage on the GPU, in milliseconds; empty if the GPU has no timestamps.
    pub stages: StageTimes,
    /// Time from the start of the first stage to the end of the last, in milliseconds.
    pub total: Option<f64>,
}
