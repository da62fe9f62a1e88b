//! Metrics, view sets and comparison of 3D Gaussian Splatting scenes, without photos or with them; and
//! [`compression`] to a quality that views of the scene are judged by.
//!
//! ```
//! use lexisplat::{CompressOptions, Silent, compress};
//! # use lexisplat::{Geometry, ShDegree, Splats};
//! use lexisplat_eval::{DrawOptions, compare};
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
//! let comparison = compare(&mut Renderer::cpu(), &a, &b, &cameras, &DrawOptions::default(), &Silent, |_, _, _| Ok::<_, lexisplat_eval::Error>(()))?;
//! assert!(comparison.psnr.min.is_none_or(|psnr| psnr > 30.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bench;
mod compare;
pub mod compression;
mod drawing;
mod error;
pub mod format;
pub mod metrics;
mod misfit;
pub mod montage;
mod png;
mod scene_file;
mod scorer;
mod scores;
pub mod views;

pub use bench::{BenchOptions, PathTimes, RadianceModel, Spread, bench_cpu, bench_gpu, busy_lanes};
pub use compare::{compare, score_views};
pub use compression::{Compression, CompressionReport, Packing, Quality, Target};
pub use drawing::{DrawOptions, draw_views};
pub use error::{Error, Result};
pub use misfit::misfit;
pub use png::png;
pub use scene_file::{Loaded, OtherRead, SceneFile, Whereabouts};
pub use scorer::Scorer;
pub use scores::{Comparison, Summary, ViewScore};
pub use views::{
    ChosenViews, DEFAULT_HOLD, DEFAULT_MAX_WIDTH, DEFAULT_ORBIT, ORBIT_SIZE, SceneKind, SplitFilter, View,
    ViewOptions, choose_views, find_views, photo,
};
