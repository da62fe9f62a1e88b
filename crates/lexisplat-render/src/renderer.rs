//! One interface to drawing on the processor and on a GPU.

use std::str::FromStr;

use lexisplat::{Progress, Sensitivity};

use crate::camera::Camera;
use crate::cpu::{RenderOptions, render, sensitivity};
use crate::error::{Error, Result};
#[cfg(feature = "gpu")]
use crate::gpu::{Gpu, GpuChoice, GpuRenderer, GpuScene, ShPath};
use crate::image::Image;
use crate::scene::Scene;

/// What to draw on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Device {
    /// The best GPU that is not software, or else the processor.
    #[default]
    Auto,
    /// The processor: the same bits on every machine.
    Cpu,
    /// The best GPU, software such as lavapipe if there is nothing else.
    Gpu,
    /// The GPU at this place in `gpu::adapters`.
    Index(usize),
}

#[cfg(feature = "gpu")]
impl Device {
    /// The GPU that this means, or `None` if it means the processor.
    ///
    /// # Errors
    /// As [`Renderer::open`].
    pub fn open_gpu(self) -> Result<Option<Gpu>> {
        match self {
            Self::Cpu => Ok(None),
            Self::Auto => Gpu::find(GpuChoice::Hardware),
            Self::Gpu => Gpu::open(GpuChoice::Best).map(Some),
            Self::Index(index) => Gpu::open(GpuChoice::Index(index)).map(Some),
        }
    }
}

impl FromStr for Device {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "auto" => Ok(Self::Auto),
            "cpu" => Ok(Self::Cpu),
            "gpu" => Ok(Self::Gpu),
            _ => text.parse().map(Self::Index).map_err(|_| {
                Error::parameter("device", text, "auto, cpu, gpu, or a number from the list of devices")
            }),
        }
    }
}

/// Draws scenes on what it was opened for.
#[derive(Debug)]
pub struct Renderer {
    #[cfg(feature = "gpu")]
    gpu: Option<(Gpu, GpuRenderer)>,
    name: String,
}

/// A scene ready to be drawn by the renderer that prepared it.
#[derive(Debug)]
pub struct Prepared<'a> {
    scene: Scene<'a>,
    #[cfg(feature = "gpu")]
    gpu: Option<GpuScene>,
}

/// Name of the processor as a device.
const CPU: &str = "cpu";

impl Renderer {
    /// Draws on the processor.
    #[must_use]
    pub fn cpu() -> Self {
        Self {
            #[cfg(feature = "gpu")]
            gpu: None,
            name: CPU.to_owned(),
        }
    }

    /// Opens `device`. [`Device::Auto`] always succeeds where the processor will do.
    ///
    /// # Errors
    /// [`Error::Gpu`] if a GPU was asked for and there is none, or it refuses; [`Error::Parameter`] for a
    /// number out of range.
    #[cfg(feature = "gpu")]
    pub fn open(device: Device) -> Result<Self> {
        device.open_gpu()?.map_or_else(|| Ok(Self::cpu()), |gpu| Self::on(&gpu))
    }

    /// Opens `device`, which can only be the processor: the GPU was left out when this was built.
    ///
    /// # Errors
    /// [`Error::Gpu`] if a GPU was asked for.
    #[cfg(not(feature = "gpu"))]
    pub fn open(device: Device) -> Result<Self> {
        match device {
            Device::Auto | Device::Cpu => Ok(Self::cpu()),
            Device::Gpu | Device::Index(_) => {
                Err(Error::Gpu { problem: "this program was built without its `gpu` feature".to_owned() })
            }
        }
    }

    /// Draws on `gpu`.
    ///
    /// # Errors
    /// [`Error::Gpu`] if its driver refuses a kernel.
    #[cfg(feature = "gpu")]
    pub fn on(gpu: &Gpu) -> Result<Self> {
        let name = gpu.summary().name.clone();
        Ok(Self { gpu: Some((gpu.clone(), GpuRenderer::new(gpu)?)), name })
    }

    /// What it draws on: `cpu`, or the GPU's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether it draws on a GPU.
    #[must_use]
    pub fn is_gpu(&self) -> bool {
        #[cfg(feature = "gpu")]
        return self.gpu.is_some();
        #[cfg(not(feature = "gpu"))]
        false
    }

    /// Makes `scene` ready: uploads it, as it is stored, to the GPU.
    ///
    /// # Errors
    /// [`Error::GpuLimit`] or [`Error::Gpu`] if it does not fit on the GPU.
    pub fn prepare<'a>(&self, scene: Scene<'a>) -> Result<Prepared<'a>> {
        Ok(Prepared {
            #[cfg(feature = "gpu")]
            gpu: match &self.gpu {
                Some((gpu, _)) => Some(GpuScene::new(gpu, &scene, ShPath::of(&scene))?),
                None => None,
            },
            scene,
        })
    }

    /// Draws a scene that this renderer prepared, as `camera` sees it.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the camera cannot be drawn with; on a GPU also [`Error::GpuLimit`] if the view
    /// needs more than it has, and [`Error::Gpu`] if it fails.
    pub fn render(
        &mut self,
        prepared: &Prepared<'_>,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Image> {
        camera.validate()?;
        #[cfg(feature = "gpu")]
        if let (Some((_, renderer)), Some(scene)) = (&mut self.gpu, &prepared.gpu) {
            return Ok(renderer.render(scene, camera, options)?.0);
        }
        Ok(render(&prepared.scene, camera, options))
    }

    /// Returns how much the pictures of `scene` from `cameras` change with each value of each Gaussian: see
    /// [`crate::sensitivity`]. Reports `Stage::Draw`, in views, to `progress`.
    ///
    /// # Errors
    /// [`Error::Codec`] if `progress` cancelled the work; otherwise as [`Self::prepare`] and [`Self::render`].
    pub fn sensitivity(
        &mut self,
        scene: &Scene<'_>,
        cameras: &[Camera],
        progress: &dyn Progress,
    ) -> Result<Sensitivity> {
        cameras.iter().try_for_each(Camera::validate)?;
        #[cfg(feature = "gpu")]
        if let Some((gpu, renderer)) = &mut self.gpu {
            let uploaded = GpuScene::new(gpu, scene, ShPath::of(scene))?;
            return renderer.sensitivity(&uploaded, scene.geometry(), cameras, progress);
        }
        sensitivity(scene, cameras, progress)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_have_names() {
        for (text, device) in
            [("auto", Device::Auto), ("cpu", Device::Cpu), ("gpu", Device::Gpu), ("2", Device::Index(2))]
        {
            assert_eq!(text.parse::<Device>().unwrap(), device);
        }
        for bad in ["", "GPU", "-1", "1.5", "nvidia"] {
            let message = bad.parse::<Device>().unwrap_err().to_string();
            assert!(message.starts_with("device"), "{message}");
        }
        assert_eq!(Renderer::open(Device::Cpu).unwrap().name(), "cpu");
    }
}
