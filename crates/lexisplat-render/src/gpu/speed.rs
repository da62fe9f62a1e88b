//! Measures how fast a GPU copies, and how fast it multiplies and adds.

use web_time::Instant;

use crate::error::Result;
use crate::gpu_report::Speed;

use super::constants::{GROUP, MULTIPLY_ADDS};
use super::device::Gpu;
use super::plan::dimensions;
use super::shaders::{all_from, bind, compile, pipeline};
use super::timestamps::Timestamps;

/// Number of bytes copied, or the size of a binding if that is smaller.
const COPIED: u64 = 256 << 20;
/// Number of bytes of a vector.
const VECTOR: u64 = 16;
/// Number of operations of a lane in a round: four chains, four numbers, two operations.
const OPERATIONS: f64 = 32.0;
/// Number of lanes of the first and of the last measurement. It is raised until a measurement takes [`LONG_ENOUGH`].
const LANES: std::ops::RangeInclusive<u32> = (1 << 16)..=(1 << 22);
/// Duration that a measurement should have, in seconds.
const LONG_ENOUGH: f64 = 2e-3;
/// Number of runs of a measurement. The fastest run counts.
const TIMES: usize = 5;

/// Blocks on [`measure_speed_async`].
///
/// # Errors
/// As [`measure_speed_async`].
#[cfg(not(target_family = "wasm"))]
pub fn measure_speed(gpu: &Gpu) -> Result<Speed> {
    gpu.block_on(measure_speed_async(gpu))
}

/// Measures `gpu`. Takes a fraction of a second on hardware.
///
/// # Errors
/// [`crate::Error::Gpu`] if the device fails.
pub async fn measure_speed_async(gpu: &Gpu) -> Result<Speed> {
    let size = COPIED.min(gpu.max_binding()) / VECTOR * VECTOR;
    let make = || {
        let module = compile(gpu, "speed", include_str!("kernels/speed.wgsl"));
        let (from, to) = (gpu.storage("from", size)?, gpu.storage("to", size)?);
        let copy = pipeline(gpu, &module, "copy_vectors");
        let copied = bind(gpu, &copy, all_from(0, [&from, &to]));
        let work = pipeline(gpu, &module, "multiply_add");
        let worked = bind(gpu, &work, all_from(1, [&to]));
        Ok([(copy, copied), (work, worked)])
    };
    let [(copy, copied), (work, worked)] = gpu.checked("speed", make).await?;
    let stopwatch = Stopwatch { gpu, timestamps: Timestamps::new(gpu, 1).await? };
    let vectors = u32::try_from(size / VECTOR).unwrap_or(u32::MAX);
    let seconds = stopwatch.best(&copy, &copied, vectors.div_ceil(GROUP)).await?;
    let bandwidth = 2.0 * size as f64 / seconds;
    let mut lanes = *LANES.start();
    loop {
        let seconds = stopwatch.best(&work, &worked, lanes / GROUP).await?;
        if seconds >= LONG_ENOUGH || lanes >= *LANES.end() {
            let operations = OPERATIONS * f64::from(MULTIPLY_ADDS) * f64::from(lanes);
            return Ok(Speed { copy: bandwidth, arithmetic: operations / seconds });
        }
        lanes *= 4;
    }
}

/// Times single dispatches by timestamps, or by the clock if the GPU has no timestamps.
struct Stopwatch<'a> {
    gpu: &'a Gpu,
    timestamps: Option<Timestamps>,
}

impl Stopwatch<'_> {
    /// Returns the duration of the fastest of [`TIMES`] runs, in seconds.
    async fn best(
        &self,
        pipeline: &wgpu::ComputePipeline,
        bound: &wgpu::BindGroup,
        groups: u32,
    ) -> Result<f64> {
        let gpu = self.gpu;
        let (x, y) = dimensions(groups);
        let mut best = f64::INFINITY;
        for _ in 0..TIMES {
            let timestamp_writes = self.timestamps.as_ref().and_then(|timestamps| timestamps.writes(0));
            let mut encoder = gpu.encoder();
            let mut pass =
                encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, bound, &[]);
            pass.dispatch_workgroups(x, y, 1);
            drop(pass);
            if let Some(timestamps) = &self.timestamps {
                timestamps.resolve(&mut encoder, 1);
            }
            let clock = Instant::now();
            gpu.queue().submit([encoder.finish()]);
            gpu.wait_async().await?;
            let seconds = match &self.timestamps {
                None => clock.elapsed().as_secs_f64(),
                Some(timestamps) => {
                    timestamps.read(gpu, 1).await?.first().map_or(0.0, |[start, end]| end - start) / 1e3
                }
            };
            best = best.min(seconds);
        }
        Ok(best)
    }
}
