//! What the card can do at best: how fast it copies, and how fast it multiplies and adds.

use std::time::Instant;

use crate::error::Result;

use super::constants::{GROUP, MULTIPLY_ADDS};
use super::device::Gpu;
use super::plan::dimensions;
use super::shaders::{Bound, bind, compile, pipeline};
use super::stamps::Stamps;

/// Measured rates of a GPU.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Speed {
    /// Bytes read plus bytes written in a second, copying arrays larger than any cache.
    pub copy: f64,
    /// Single-precision operations in a second; a multiplication with an addition counts as two.
    pub arithmetic: f64,
}

/// Bytes copied, if a binding can be as large.
const COPIED: u64 = 256 << 20;
/// Bytes of a vector.
const VECTOR: u64 = 16;
/// Operations of a lane in a round: four chains, four numbers, two operations.
const OPERATIONS: f64 = 32.0;
/// Lanes at first and at most: as many as it takes for [`LONG_ENOUGH`].
const LANES: std::ops::RangeInclusive<u32> = (1 << 16)..=(1 << 22);
/// Seconds that a measurement should take.
const LONG_ENOUGH: f64 = 2e-3;
/// The best of so many.
const TIMES: usize = 5;

/// Measures `gpu`. Takes a fraction of a second on hardware.
///
/// # Errors
/// [`crate::Error::Gpu`] if it fails.
pub fn measure_speed(gpu: &Gpu) -> Result<Speed> {
    let module = compile(gpu, "speed", include_str!("kernels/speed.wgsl"))?;
    let size = COPIED.min(gpu.max_binding()) / VECTOR * VECTOR;
    let (from, to) = (gpu.storage("from", size)?, gpu.storage("to", size)?);
    let stopwatch = Stopwatch::new(gpu)?;

    let copy = pipeline(gpu, &module, "copy_vectors")?;
    let bound = bind(gpu, &copy, &[(0, Bound::All(&from.raw)), (1, Bound::All(&to.raw))])?;
    let vectors = u32::try_from(size / VECTOR).unwrap_or(u32::MAX);
    let seconds = stopwatch.best(&copy, &bound, vectors.div_ceil(GROUP))?;
    let bandwidth = 2.0 * size as f64 / seconds;

    let work = pipeline(gpu, &module, "multiply_add")?;
    let bound = bind(gpu, &work, &[(1, Bound::All(&to.raw))])?;
    let mut lanes = *LANES.start();
    loop {
        let seconds = stopwatch.best(&work, &bound, lanes / GROUP)?;
        if seconds >= LONG_ENOUGH || lanes >= *LANES.end() {
            let operations = OPERATIONS * f64::from(MULTIPLY_ADDS) * f64::from(lanes);
            return Ok(Speed { copy: bandwidth, arithmetic: operations / seconds });
        }
        lanes *= 4;
    }
}

/// Times single dispatches: by time stamps, or else by the clock.
struct Stopwatch<'a> {
    gpu: &'a Gpu,
    stamps: Option<Stamps>,
}

impl<'a> Stopwatch<'a> {
    fn new(gpu: &'a Gpu) -> Result<Self> {
        Ok(Self { gpu, stamps: Stamps::new(gpu, 1)? })
    }

    /// Least seconds of some runs.
    fn best(&self, pipeline: &wgpu::ComputePipeline, bound: &wgpu::BindGroup, groups: u32) -> Result<f64> {
        let mut best = f64::INFINITY;
        for _ in 0..TIMES {
            best = best.min(self.run(pipeline, bound, groups)?);
        }
        Ok(best)
    }

    fn run(&self, pipeline: &wgpu::ComputePipeline, bound: &wgpu::BindGroup, groups: u32) -> Result<f64> {
        let gpu = self.gpu;
        let mut encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let timestamp_writes = self.stamps.as_ref().and_then(|stamps| stamps.writes(0));
            let mut pass =
                encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, bound, &[]);
            let (x, y) = dimensions(groups);
            pass.dispatch_workgroups(x, y, 1);
        }
        if let Some(stamps) = &self.stamps {
            stamps.resolve(&mut encoder, 1);
        }
        let clock = Instant::now();
        gpu.queue().submit([encoder.finish()]);
        gpu.wait()?;
        let Some(stamps) = &self.stamps else { return Ok(clock.elapsed().as_secs_f64()) };
        let milliseconds = stamps.read(gpu, 1)?.first().map_or(0.0, |[start, end]| end - start);
        Ok(milliseconds / 1e3)
    }
}
