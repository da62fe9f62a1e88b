//! The rasteriser on the GPU. It has the rules of the CPU renderer, and draws from dense SH or directly from sparse
//! codes.
//!
//! The kernels run in this order. `cull` marks the Gaussians that may be visible, and `compact` gives them slots, in
//! order. `project` turns the Gaussians of the slots into ellipses, and `radiance` colours them. A stable radix sort
//! orders the slots by depth. `tiles` lists each slot for every tile that it may touch, and another sort brings the
//! entries of each tile together. `blend` draws the tiles. Only the GPU knows the numbers of slots and entries, so it
//! sizes its own dispatches. A buffer that turns out too small is made larger, and the picture is drawn again.
//!
//! To measure sensitivities, the second sort moves the indices of entries in the lists instead of their slots. After
//! `blend`, `moments` sums how the splat of each entry changes the tile, and `gather_moments` adds up the entries of each
//! splat. All sums have a fixed order. The processor carries the sums over to the world.
//!
//! Kernels need no more than WebGPU's default limits: 8 storage buffers, 256 lanes, and 16 KiB of workgroup memory. Only
//! [`ShPath::SparseShared`] with a large dictionary needs more workgroup memory. A scene is made of parts. [`ScenePart`]
//! lays out a part, and each part is uploaded by itself. Parts larger than a binding are cut into chunks. Pictures whose
//! lists are larger than a binding are cut into bands. If the slots do not hold the Gaussians of the whole view, each
//! band searches for its own Gaussians.
//!
//! The only functions that block are those with a twin ending in `_async`, and they do not exist in a browser. Outside of
//! a browser the futures need something that polls the device, such as `Gpu::wait` on another thread.

mod buffer;
mod capacity;
mod chunks;
mod columns;
mod constants;
mod counted;
mod device;
mod form;
mod moments;
mod part;
mod part_check;
mod part_layout;
mod part_sample;
mod part_scene;
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

pub use buffer::OwnedBuffer;
#[cfg(not(target_family = "wasm"))]
pub use device::adapters;
pub use device::{Gpu, adapters_async, rank};
pub use form::SceneForm;
pub use part::ScenePart;
pub(crate) use part_scene::PartGaussians;
pub use renderer::{Frame, GpuRenderer};
pub use scene::GpuScene;
#[cfg(not(target_family = "wasm"))]
pub use speed::measure_speed;
pub use speed::measure_speed_async;

pub use crate::gpu_report::{AdapterSummary, DrawStage, FrameStats, SceneBytes, Speed, StageTimes};
pub use crate::sh_path::ShPath;
