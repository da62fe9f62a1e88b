//! Measures sensitivities on the GPU, like `cpu::sensitivity` on the processor.

use std::collections::HashMap;

use lexisplat::{Geometry, Progress, Sensitivity, Stage};

use crate::camera::Camera;
use crate::cpu::{Moments, Projection, RenderOptions, carry};
use crate::error::{Error, Result};

use super::capacity::WORD;
use super::moments::{MAX_BYTES, MOMENTS_BYTES};
use super::renderer::{CapacityLimits, GpuRenderer};
use super::scene::GpuScene;
use super::shaders::{self, MEASURING};
use super::uniforms::ChunkUniform;

impl GpuRenderer {
    /// Blocks on [`Self::sensitivity_async`].
    ///
    /// # Errors
    /// As [`Self::sensitivity_async`].
    #[cfg(not(target_family = "wasm"))]
    pub fn sensitivity(
        &mut self,
        scene: &GpuScene,
        geometry: &Geometry,
        cameras: &[Camera],
        progress: &dyn Progress,
    ) -> Result<Sensitivity> {
        self.gpu.clone().block_on(self.sensitivity_async(scene, geometry, cameras, progress))
    }

    /// Measures on the GPU what [`crate::sensitivity`] measures on the processor. `scene` must be made of a scene with
    /// this `geometry`. Reports [`Stage::Draw`] to `progress`, in views.
    ///
    /// The result has the same bits each time on the same GPU and driver. It is within rounding of the processor's
    /// result, except where a value lies within rounding of a threshold of the rasteriser.
    ///
    /// The buffers for pictures are freed. The next picture makes them again.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `scene` and `geometry` differ in length; [`Error::Codec`] if `progress` cancelled the
    /// work; otherwise as [`Self::draw_async`].
    pub async fn sensitivity_async(
        &mut self,
        scene: &GpuScene,
        geometry: &Geometry,
        cameras: &[Camera],
        progress: &dyn Progress,
    ) -> Result<Sensitivity> {
        if scene.len() as usize != geometry.len() {
            let expected = format!("{} Gaussians, as the scene has", scene.len());
            return Err(Error::parameter("geometry", geometry.len(), expected));
        }
        let mut measuring = self.measuring().await?;
        let first_indices = first_indices(scene);
        let mut total = Sensitivity::zeros(geometry.len());
        let mut sums = vec![Moments::default(); geometry.len()];
        progress.begin(Stage::Draw, cameras.len() as u64);
        for camera in cameras {
            progress.check()?;
            let frame = measuring.draw_async(scene, camera, &RenderOptions::default()).await?;
            let (gaussians, moments) = measuring.read_moments(frame.stats.visible).await?;
            for (gaussian, moments) in gaussians.into_iter().zip(moments) {
                sums[index(&first_indices, gaussian)] = moments;
            }
            let projection = Projection::new(&camera.clone().with_tiles(None), scene.antialiased);
            carry(&mut total, &projection, geometry, cameras.len(), &mut sums);
            progress.advance(1);
        }
        progress.end();
        Ok(total)
    }

    /// Makes a renderer that also computes moments. This renderer frees its buffers, because the buffers of both together
    /// may not fit.
    async fn measuring(&mut self) -> Result<Self> {
        self.plans.clear();
        self.work = None;
        let mut kernels = self.kernels.clone();
        kernels.extend(shaders::kernels(&self.gpu, &MEASURING).await?);
        let binding = self.gpu.max_binding();
        let limits = CapacityLimits {
            slots: self.limits.slots.min(binding / MOMENTS_BYTES),
            entries: self.limits.entries.min(binding.min(MAX_BYTES) / MOMENTS_BYTES),
            ..self.limits
        };
        Ok(Self {
            gpu: self.gpu.clone(),
            kernels,
            measuring: true,
            work: None,
            plans: Vec::new(),
            timestamps: None,
            cuts: HashMap::new(),
            limits,
        })
    }

    /// Returns the Gaussians in the `slots` slots of the last view, and their moments.
    async fn read_moments(&self, slots: u32) -> Result<(Vec<u32>, Vec<Moments>)> {
        let Some((work, moments)) = self.work.as_ref().and_then(|work| Some((work, work.moments.as_ref()?)))
        else {
            return Ok((Vec::new(), Vec::new()));
        };
        let sizes = [u64::from(slots) * WORD, u64::from(slots) * MOMENTS_BYTES];
        let mut encoder = self.gpu.encoder();
        let (from, to) = (&work.gaussians.raw, &moments.gaussians_back.raw);
        encoder.copy_buffer_to_buffer(from, 0, to, 0, sizes[0]);
        let (from, to) = (&moments.of_slots.raw, &moments.of_slots_back.raw);
        encoder.copy_buffer_to_buffer(from, 0, to, 0, sizes[1]);
        self.gpu.queue().submit([encoder.finish()]);
        let gaussians = self.gpu.read(&moments.gaussians_back, sizes[0]).await?;
        Ok((gaussians, self.gpu.read(&moments.of_slots_back, sizes[1]).await?))
    }
}

/// Returns for each chunk the number that kernels give its first Gaussian, and the index of that Gaussian in the scene.
fn first_indices(scene: &GpuScene) -> Vec<[u32; 2]> {
    let mut index = 0;
    let of_chunk = |chunk: ChunkUniform| {
        let own = [chunk.first, index];
        index += chunk.count;
        own
    };
    scene.numbering().into_iter().map(of_chunk).collect()
}

/// Returns the index in the scene of the Gaussian with the kernels' number `number`.
fn index(first_indices: &[[u32; 2]], number: u32) -> usize {
    let chunk = first_indices.partition_point(|[first, _]| *first <= number).saturating_sub(1);
    first_indices.get(chunk).map_or(number, |[first, index]| number - first + index) as usize
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat_sample::{SampleOptions, scene};

    use super::super::tests::gpu;
    use super::*;
    use crate::scene::Scene;
    use crate::sh_path::ShPath;
    use crate::surround::surround;

    /// Every sum goes on in the next band where it stopped in the one before.
    #[test]
    fn bands_change_not_one_bit() {
        let Some(gpu) = gpu() else { return };
        let splats = scene(&SampleOptions::new(3000, 3));
        let cameras = surround(&splats.geometry, 2, [130, 100], [1.0, 4.0]);
        let on_gpu = GpuScene::new(&gpu, &Scene::from(&splats), ShPath::DenseF32).unwrap();
        let measure =
            |mut renderer: GpuRenderer| renderer.sensitivity(&on_gpu, &splats.geometry, &cameras, &Silent);
        let mut whole = GpuRenderer::new(&gpu).unwrap();
        let limits = whole.limits;
        // Less than a view has, more than any row of tiles.
        let few = 4000;
        let frame = whole.draw(&on_gpu, &cameras[0], &RenderOptions::default()).unwrap();
        assert!(frame.stats.bands == 1 && frame.stats.entries > few, "{:?}", frame.stats);
        let banded =
            |entries| GpuRenderer::new(&gpu).unwrap().with_limits(CapacityLimits { entries, ..limits });
        let whole = measure(whole).unwrap();
        assert!(whole.colour.iter().any(|&v| v > 0.0));
        assert!(whole == measure(banded(few.into())).unwrap());
        let refused = measure(banded(10));
        assert!(matches!(refused, Err(Error::GpuLimit { .. })), "{:?}", refused.map(|s| s.len()));
    }
}
