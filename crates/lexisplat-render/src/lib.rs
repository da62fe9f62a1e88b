//! Cameras and rasterisers that draw 3D Gaussian Splatting scenes.
//!
//! [`render`] draws a [`Scene`]: a trained model with dense SH, or a compressed model. [`Radiance`] evaluates
//! the view-dependent colours of both; a compressed model is drawn from its sparse codes, without dense SH. The rules
//! and numbers are those of the 3DGS authors' rasteriser ([`conventions`]).
//!
//! ```
//! use lexisplat::{Geometry, ShDegree, Splats};
//! use lexisplat_render::{RenderOptions, Scene, orbit, render};
//!
//! let splats = Splats {
//!     geometry: Geometry {
//!         positions: vec![[0.0, 0.0, 0.0]],
//!         dc: vec![[1.0, 0.0, -1.0]],
//!         opacities: vec![4.0],
//!         scales: vec![[-1.0; 3]],
//!         rotations: vec![[1.0, 0.0, 0.0, 0.0]],
//!         ..Geometry::default()
//!     },
//!     degree: ShDegree::ZERO,
//!     sh_rest: Vec::new(),
//!     meta: Default::default(),
//! };
//! for camera in orbit(&splats.geometry, 3, 64, 48) {
//!     let image = render(&Scene::from(&splats), &camera, &RenderOptions::default()).unwrap();
//!     let [red, _, blue] = image.pixels[24 * 64 + 32];
//!     assert!(red > 0.7 && red > blue);
//! }
//! ```
//!
//! [`render`] draws on the processor, with the same bits on every machine. With the feature `gpu` (on by default) the module `gpu`
//! draws the same pictures through Vulkan, Metal, DX12 or, in a browser, WebGPU. Without it the module finds no GPU. [`Renderer`] is one interface to both: start
//! there to draw many views. Methods of [`Renderer`] that may wait for a GPU are async. Each has a twin that blocks, outside of
//! browsers.
//!
//! Cameras come from files ([`read_views`]), or are generated: [`orbit`], [`object`], [`interior_views`] and [`natural_views`].
//! [`sensitivity`] and [`PictureAdjoint`] measure how pictures depend on Gaussians.
//!
//! Without the feature `parallel` (on by default) everything runs on the calling thread.

// Tests in here share helpers with those in `tests/`, which use the crate by its name.
#[cfg(all(test, feature = "gpu"))]
extern crate self as lexisplat_render;

mod aside;
mod between;
mod bulk;
mod camera;
mod cameras_json;
mod colmap;
pub mod conventions;
mod cpu;
mod error;
#[cfg_attr(not(feature = "gpu"), path = "no_gpu.rs")]
pub mod gpu;
mod gpu_report;
mod image;
mod interior_views;
mod json;
mod natural_views;
mod near;
mod object;
mod orbit;
mod parallel;
mod pose;
mod radiance;
mod read_views;
mod renderer;
mod scene;
mod sh_path;
mod squared_error;
mod subject;
mod surround;
mod tile_set;
mod transforms;
mod transmittance;
mod upright;
mod view_files;
mod view_set;
#[cfg(any(feature = "gpu", not(target_family = "wasm")))]
mod wait;

pub use aside::{aside, nearby};
pub use between::between;
pub use bulk::bulk;
pub use camera::{Camera, MAX_SIDE, Split};
pub use cameras_json::{MAX_CAMERAS, read_cameras_bytes};
pub use colmap::{MAX_COLMAP_BYTES, read_colmap_binary, read_colmap_text};
#[cfg(feature = "gpu")]
pub use cpu::CpuScene;
pub use cpu::{
    Differentiator, Drawn, GaussianChange, GaussianGradient, PictureAdjoint, PictureErrors, PictureGradient,
    RenderOptions, render, render_measured, sensitivity,
};
pub use error::{Error, Result};
pub use image::Image;
pub use interior_views::{interior_views, is_interior};
pub use natural_views::natural_views;
pub use near::{hidden_share, near_plane};
pub use object::object;
pub use orbit::orbit;
pub use pose::Pose;
pub use radiance::Radiance;
#[cfg(not(target_family = "wasm"))]
pub use read_views::{read_cameras, read_colmap, read_views};
pub use read_views::{read_view_files, read_views_bytes};
pub use renderer::{Device, Prepared, Renderer};
pub use scene::Scene;
pub use squared_error::squared_error;
pub use subject::subject;
pub use surround::{PLASTIC, surround};
pub use tile_set::TileSet;
pub use transforms::read_transforms_bytes;
pub use upright::{levelled, upward};
pub use view_files::{MAX_CAMERAS_BYTES, ReadSeek, ViewFile, ViewFiles};
pub use view_set::{SizeOf, ViewSet};
