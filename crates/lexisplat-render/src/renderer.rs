//! One interface for drawing on the processor and on a GPU.

use std::str::FromStr;
use std::sync::Mutex;

use lexisplat::{Progress, Sensitivity};

use crate::camera::Camera;
use crate::cpu::{RenderOptions, Workspace, render_with, sensitivity};
use crate::error::{Error, Result};
#[cfg(feature = "gpu")]
use crate::gpu::{Gpu, GpuRenderer, GpuScene, ShPath};
use crate::image::Image;
use crate::scene::Scene;
#[cfg(not(target_family = "wasm"))]
use crate::wait::block_on;

/// The device to draw on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Device {
    /// The best GPU that is not software, or the processor if there is none.
    #[default]
    Auto,
    /// The processor. It gives the same bits on every machine.
    Cpu,
    /// The best GPU. Software such as lavapipe counts if there is nothing else.
    Gpu,
    /// The GPU at this index in `gpu::adapters`.
    Index(usize),
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

/// Draws scenes on the device for which it was opened.
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
    /// Memory of the processor, kept from one picture to the next.
    workspace: Mutex<Workspace>,
    #[cfg(feature = "gpu")]
    gpu: Option<GpuScene>,
}

/// Name of the processor as a device.
const CPU: &str = "cpu";

impl Renderer {
    /// Makes a renderer that draws on the processor.
    #[must_use]
    pub fn cpu() -> Self {
        Self {
            #[cfg(feature = "gpu")]
            gpu: None,
            name: CPU.to_owned(),
        }
    }

    /// Opens `device`. [`Device::Auto`] opens the processor if there is no GPU.
    ///
    /// # Errors
    /// [`Error::Gpu`] if a GPU was asked for and there is none, or the GPU fails; [`Error::Parameter`] for a number out
    /// of range.
    #[cfg(feature = "gpu")]
    pub async fn open_async(device: Device) -> Result<Self> {
        match device.open_gpu_async().await? {
            Some(gpu) => Self::on_async(&gpu).await,
            None => Ok(Self::cpu()),
        }
    }

    /// Blocks on [`Self::open_async`].
    ///
    /// # Errors
    /// As [`Self::open_async`].
    #[cfg(all(feature = "gpu", not(target_family = "wasm")))]
    pub fn open(device: Device) -> Result<Self> {
        pollster::block_on(Self::open_async(device))
    }

    /// Opens `device`, which must be the processor, because this crate was built without the feature `gpu`.
    ///
    /// # Errors
    /// [`Error::Gpu`] if a GPU was asked for.
    #[cfg(not(feature = "gpu"))]
    pub fn open(device: Device) -> Result<Self> {
        device.open_gpu()?.map_or(Ok(Self::cpu()), |gpu| Self::on(&gpu))
    }

    /// Makes a renderer that draws on `gpu`, which does not exist without the feature `gpu`.
    ///
    /// # Errors
    /// None in this build.
    #[cfg(not(feature = "gpu"))]
    pub fn on(gpu: &crate::gpu::Gpu) -> Result<Self> {
        match *gpu {}
    }

    /// Makes a renderer that draws on `gpu`.
    ///
    /// # Errors
    /// [`Error::Gpu`] if the driver refuses a kernel.
    #[cfg(feature = "gpu")]
    pub async fn on_async(gpu: &Gpu) -> Result<Self> {
        let name = gpu.summary().name.clone();
        Ok(Self { gpu: Some((gpu.clone(), GpuRenderer::new_async(gpu).await?)), name })
    }

    /// Blocks on [`Self::on_async`].
    ///
    /// # Errors
    /// As [`Self::on_async`].
    #[cfg(all(feature = "gpu", not(target_family = "wasm")))]
    pub fn on(gpu: &Gpu) -> Result<Self> {
        gpu.block_on(Self::on_async(gpu))
    }

    /// Returns the name of the device: `cpu`, or the name of the GPU.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns whether the device is a GPU.
    #[must_use]
    pub fn is_gpu(&self) -> bool {
        #[cfg(feature = "gpu")]
        return self.gpu.is_some();
        #[cfg(not(feature = "gpu"))]
        false
    }

    /// Prepares `scene` for drawing. On a GPU the scene is uploaded in its own representation.
    ///
    /// # Errors
    /// [`Error::Codec`] if the lengths of the scene's arrays do not match; [`Error::GpuLimit`] or [`Error::Gpu`] if the
    /// scene does not fit on the GPU.
    pub async fn prepare_async<'a>(&self, scene: Scene<'a>) -> Result<Prepared<'a>> {
        scene.validate()?;
        Ok(Prepared {
            #[cfg(feature = "gpu")]
            gpu: match &self.gpu {
                Some((gpu, _)) => Some(GpuScene::new_async(gpu, &scene, ShPath::of(&scene)).await?),
                None => None,
            },
            scene,
            workspace: Mutex::default(),
        })
    }

    /// Draws a scene that this renderer prepared, as `camera` sees it.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the camera is not valid; on a GPU also [`Error::GpuLimit`] if the view needs more than the
    /// GPU has, and [`Error::Gpu`] if the GPU fails.
    pub async fn render_async(
        &mut self,
        prepared: &Prepared<'_>,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Image> {
        #[cfg(feature = "gpu")]
        if let (Some((_, renderer)), Some(scene)) = (&mut self.gpu, &prepared.gpu) {
            let whole = renderer.render_async(scene, camera, options).await?.0;
            return Ok(match &camera.tiles {
                Some(set) => set.cut(&whole, options.behind(camera)),
                None => whole,
            });
        }
        // A picture that is drawn from another thread at the same time has memory of its own. So has a picture after a
        // panic.
        let mut own = Workspace::default();
        let mut shared = prepared.workspace.try_lock().ok();
        let workspace = shared.as_deref_mut().unwrap_or(&mut own);
        workspace.cluster_again(prepared.scene.geometry());
        Ok(render_with(workspace, &prepared.scene, camera, options)?.image)
    }

    /// Returns the sensitivity of the pictures of `scene` from `cameras` to each value of each Gaussian, like
    /// [`crate::sensitivity`]. Reports `Stage::Draw` to `progress`, in views.
    ///
    /// # Errors
    /// [`Error::Codec`] if `progress` cancelled the work; otherwise as [`Self::prepare_async`] and
    /// [`Self::render_async`].
    pub async fn sensitivity_async(
        &mut self,
        scene: &Scene<'_>,
        cameras: &[Camera],
        progress: &dyn Progress,
    ) -> Result<Sensitivity> {
        #[cfg(feature = "gpu")]
        if let Some((gpu, renderer)) = &mut self.gpu {
            let uploaded = GpuScene::new_async(gpu, scene, ShPath::of(scene)).await?;
            return renderer.sensitivity_async(&uploaded, scene.geometry(), cameras, progress).await;
        }
        sensitivity(scene, cameras, progress)
    }
}

/// Blocking twins of the methods above.
#[cfg(not(target_family = "wasm"))]
impl Renderer {
    /// Blocks on [`Self::prepare_async`].
    ///
    /// # Errors
    /// As [`Self::prepare_async`].
    pub fn prepare<'a>(&self, scene: Scene<'a>) -> Result<Prepared<'a>> {
        block_on(self.poll(), self.prepare_async(scene))
    }

    /// Blocks on [`Self::render_async`].
    ///
    /// # Errors
    /// As [`Self::render_async`].
    pub fn render(
        &mut self,
        prepared: &Prepared<'_>,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Image> {
        block_on(self.poll(), self.render_async(prepared, camera, options))
    }

    /// Blocks on [`Self::sensitivity_async`].
    ///
    /// # Errors
    /// As [`Self::sensitivity_async`].
    pub fn sensitivity(
        &mut self,
        scene: &Scene<'_>,
        cameras: &[Camera],
        progress: &dyn Progress,
    ) -> Result<Sensitivity> {
        block_on(self.poll(), self.sensitivity_async(scene, cameras, progress))
    }

    /// Returns the function that polls the GPU while a thread blocks on it.
    fn poll(&self) -> impl FnMut() -> Result<()> + use<> {
        #[cfg(feature = "gpu")]
        let gpu = self.gpu.as_ref().map(|(gpu, _)| gpu.clone());
        move || {
            #[cfg(feature = "gpu")]
            if let Some(gpu) = &gpu {
                gpu.poll()?;
            }
            Ok(())
        }
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
