//! Metrics and comparison of 3D Gaussian Splatting scenes, with or without photos, and frame rates.
//!
//! An example that compares two scenes:
//!
//! ```
//! use lexisplat::{CompressOptions, Silent, compress};
//! # use lexisplat::{Geometry, ShDegree, Splats};
//! use lexisplat_compress::DrawOptions;
//! use lexisplat_eval::compare;
//! use lexisplat_render::{Renderer, Scene, orbit};
//!
//! # let n = 50;
//! # let at = |i: usize| f32::from(u8::try_from(i).unwrap()) / 50.0;
//! # let splats = Splats {
//! #     geometry: Geometry {
//! #         positions: (0..n).map(|i| [at(i), at(i * 7 % n), at(i * 3 % n)]).collect(),
//! #         dc: vec![[0.5; 3]; n],
//! #         opacities: vec![2.0; n],
//! #         scales: vec![[-3.0; 3]; n],
//! #         rotations: vec![[1.0, 0.0, 0.0, 0.0]; n],
//! #         ..Geometry::default()
//! #     },
//! #     degree: ShDegree::ONE,
//! #     sh_rest: (0..9 * n).map(|i| at(i * 31 % n) - 0.5).collect(),
//! #     meta: Default::default(),
//! # };
//! let (model, _) = compress(splats.clone(), &CompressOptions::default(), &Silent)?;
//! let cameras = orbit(&splats.geometry, 2, 64, 48);
//! let (a, b) = (Scene::from(&splats), Scene::from(&model));
//! let comparison = compare(&mut Renderer::cpu(), &a, &b, &cameras, &DrawOptions::default(), &Silent, |_, _, _| Ok::<_, lexisplat_compress::Error>(()))?;
//! assert!(comparison.psnr.min.is_none_or(|psnr| psnr > 30.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Start with [`compare`]. A [`Scorer`] scores pairs of pictures, such as a drawn picture and a photo, by more metrics. [`metrics`]
//! has the metrics themselves, [`bench_cpu`] and [`bench_gpu`] measure times, and [`SceneFile`] reads a scene of any format.

mod bench;
mod compare;
pub mod format;
mod in_turn;
pub mod metrics;
mod misfit;
pub mod montage;
mod png;
mod scene_file;
mod scorer;
mod scores;

pub use bench::{BenchOptions, PathTimes, RadianceModel, Spread, bench_cpu, bench_gpu, busy_lanes};
pub use compare::{compare, score_views};
pub use in_turn::{FrameRate, bench_cpu_in_turn, bench_gpu_in_turn};
pub use misfit::misfit;
pub use png::png;
pub use scene_file::{Loaded, OtherRead, SceneFile, Whereabouts};
pub use scorer::Scorer;
pub use scores::{Comparison, Summary, ViewScore};
