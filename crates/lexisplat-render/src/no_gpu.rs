//! The rasteriser on the GPU, in a build without the feature `gpu`: no GPU is ever found.
//!
//! [`Gpu`], [`GpuRenderer`] and [`GpuScene`] have no values here, so that crates that can draw on a GPU compile without
//! one. Their functions are those of the other build that such crates call.

use crate::camera::Camera;
use crate::cpu::RenderOptions;
use crate::error::{Error, Result};
use crate::renderer::Device;
use crate::scene::Scene;

pub use crate::gpu_report::{AdapterSummary, DrawStage, FrameStats, SceneBytes, Speed, StageTimes};
pub use crate::sh_path::ShPath;

/// An open GPU, which does not exist in this build.
#[derive(Debug, Clone)]
pub enum Gpu {}

/// A renderer on a GPU, which does not exist in this build.
#[derive(Debug)]
pub enum GpuRenderer {}

/// A scene on a GPU, which does not exist in this build.
#[derive(Debug)]
pub enum GpuScene {}

/// A picture on a GPU, which no function of this build returns.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Frame {
    /// Measurements of the drawing.
    pub stats: FrameStats,
}

/// Returns the adapters of the machine that this build can draw on: none.
#[must_use]
pub fn adapters() -> Vec<AdapterSummary> {
    Vec::new()
}

/// Measures `gpu`.
///
/// # Errors
/// None in this build.
pub fn measure_speed(gpu: &Gpu) -> Result<Speed> {
    match *gpu {}
}

impl Device {
    /// Returns `None`, because this build draws on the processor.
    ///
    /// # Errors
    /// [`Error::Gpu`] if a GPU was asked for.
    pub fn open_gpu(self) -> Result<Option<Gpu>> {
        match self {
            Self::Auto | Self::Cpu => Ok(None),
            Self::Gpu | Self::Index(_) => {
                Err(Error::Gpu { problem: "this program was built without its `gpu` feature".to_owned() })
            }
        }
    }
}

impl Gpu {
    /// Returns the summary of the adapter.
    #[must_use]
    pub fn summary(&self) -> &AdapterSummary {
        match *self {}
    }

    /// Returns the largest number of bytes that were in use.
    #[must_use]
    pub fn most_bytes(&self) -> u64 {
        match *self {}
    }
}

impl GpuRenderer {
    /// Makes a renderer on `gpu`.
    ///
    /// # Errors
    /// None in this build.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        match *gpu {}
    }

    /// Draws `scene`.
    ///
    /// # Errors
    /// None in this build.
    pub fn draw(&mut self, _scene: &GpuScene, _camera: &Camera, _options: &RenderOptions) -> Result<Frame> {
        match *self {}
    }
}

impl GpuScene {
    /// Uploads `scene` to `gpu`.
    ///
    /// # Errors
    /// None in this build.
    pub fn new(gpu: &Gpu, _scene: &Scene<'_>, _path: ShPath) -> Result<Self> {
        match *gpu {}
    }

    /// Returns the numbers of bytes on the GPU.
    #[must_use]
    pub fn bytes(&self) -> SceneBytes {
        match *self {}
    }

    /// Returns the number of bytes that colouring one visible Gaussian moves on average.
    #[must_use]
    pub fn shading_bytes(&self) -> f64 {
        match *self {}
    }

    /// Returns the number of bytes of geometry that are read to find and project `visible` Gaussians.
    #[must_use]
    pub fn looking_bytes(&self, _visible: f64) -> f64 {
        match *self {}
    }
}
