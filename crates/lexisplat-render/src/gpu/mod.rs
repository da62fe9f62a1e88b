//! The rasteriser on the GPU: the rules of the CPU renderer, drawn straight from dense SH or sparse codes.
//!
//! `cull` marks what may be seen and `compact` gives it slots, in order; `project` makes ellipses of the
//! slots and `radiance` colours them; a stable radix sort orders them by depth; `tiles` lists them for every
//! tile they may touch, and another sort brings the lists of each tile together; `blend` draws the tiles.
//! How much there is of anything is only known on the GPU, which sizes its own dispatches; buffers that
//! turn out too small are made larger and the picture is drawn again.
//!
//! To measure sensitivities, entries are sorted by their places in the lists instead of their slots;
//! `moments` follows `blend` and sums how each entry's splat changes its tile, and `gather_moments` adds up
//! the entries of each splat, all in fixed order. The processor carries the sums over to the world.
//!
//! Kernels ask for no more than WebGPU's defaults: 8 storage buffers, 256 lanes, 16 KiB of workgroup memory
//! (but [`ShPath::SparseShared`] with a large dictionary). Scenes larger than a binding are cut into chunks,
//! pictures whose lists are larger into bands, which look for their own Gaussians where those of the whole
//! view are too many.

mod buffer;
mod columns;
mod constants;
mod device;
mod moments;
mod path;
mod plan;
mod radiance;
mod radiance_table;
pub mod readback;
mod renderer;
mod scene;
mod sensitivity;
mod sh_data;
mod shaders;
mod speed;
#[cfg(test)]
mod tests;
mod timestamps;
mod uniforms;
mod work;

pub use wgpu;

#[cfg(not(target_family = "wasm"))]
pub use device::adapters;
pub use device::{AdapterSummary, Gpu, GpuChoice, adapters_async, rank};
pub use path::ShPath;
pub use plan::DrawStage;
pub use renderer::{Frame, FrameStats, GpuRenderer, StageTimes};
pub use scene::{GpuScene, SceneBytes};
#[cfg(not(target_family = "wasm"))]
pub use speed::measure_speed;
pub use speed::{Speed, measure_speed_async};
