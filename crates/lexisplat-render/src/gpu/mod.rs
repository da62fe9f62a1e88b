//! The rasteriser on the GPU. It has the rules of the CPU renderer, and draws straight from dense SH or sparse
//! codes.
//!
//! The kernels run in this order. `cull` marks the Gaussians that may be visible, and `compact` gives them
//! slots, in order. `project` makes ellipses of the slots, and `radiance` colours them. A stable radix sort
//! orders them by depth. `tiles` lists them for every tile that they may touch, and another sort brings the
//! lists of each tile together. `blend` draws the tiles. Only the GPU knows how many slots and entries there
//! are, so it sizes its own dispatches. A buffer that turns out too small is made larger, and the picture is
//! drawn again.
//!
//! To measure sensitivities, the second sort moves the entries' places in the lists instead of their slots.
//! After `blend`, `moments` sums how each entry's splat changes its tile, and `gather_moments` adds up the
//! entries of each splat, all in fixed order. The processor carries the sums over to the world.
//!
//! Kernels ask for no more than WebGPU's defaults: 8 storage buffers, 256 lanes, and 16 KiB of workgroup memory.
//! Only [`ShPath::SparseShared`] with a large dictionary needs more of that. A scene is made of parts, each laid out by
//! [`ScenePart`] and uploaded by itself; those larger than a binding are cut into chunks. Pictures whose lists are larger than a binding are cut into bands; bands look for their own
//! Gaussians where the slots do not hold those of the whole view.
//!
//! Nothing blocks but the functions that have a twin ending in `_async`, and a browser does not have those.
//! Outside of a browser the futures need something that polls the device, such as `Gpu::wait` on another thread.

mod buffer;
mod chunks;
mod columns;
mod constants;
mod device;
mod form;
mod moments;
mod part;
mod part_check;
mod part_layout;
mod part_sample;
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
mod squared_error;
#[cfg(test)]
mod tests;
mod timestamps;
mod uniforms;
mod work;

pub use wgpu;

#[cfg(not(target_family = "wasm"))]
pub use device::adapters;
pub use device::{AdapterSummary, Gpu, adapters_async, rank};
pub use form::SceneForm;
pub use part::ScenePart;
pub use path::ShPath;
pub use plan::DrawStage;
pub use renderer::{Frame, FrameStats, GpuRenderer, StageTimes};
pub use scene::{GpuScene, SceneBytes};
#[cfg(not(target_family = "wasm"))]
pub use speed::measure_speed;
pub use speed::{Speed, measure_speed_async};
