//! Metrics, view sets and comparison of 3D Gaussian Splatting scenes, without photos or with them; and
//! [`compression`] to a quality that views of the scene are judged by.
//!
//! A PLY becomes the file that `lexisplat compress` writes, and a scene again:
//!
//! ```
//! use lexisplat::packed::Preset;
//! use lexisplat::{Limits, Silent, lexi, ply};
//! use lexisplat_eval::{Compression, Packing};
//! # use lexisplat_sample::{SampleOptions, scene};
//!
//! # let folder = tempfile::tempdir()?;
//! # let (input, output) = (folder.path().join("scene.ply"), folder.path().join("scene.lexi"));
//! # ply::write(&input, &scene(&SampleOptions::new(2000, 0)))?;
//! let original = ply::read(&input, &ply::ReadOptions::default())?.splats;
//! // The file that `lexisplat compress` writes.
//! let report = Compression::from(Packing::new(Preset::Balanced)).run(&original, &output, &Silent)?;
//! println!("{} bytes of {}", report.file_bytes, report.source_bytes);
//! let decoded = lexi::read(&output, &Limits::default())?.into_splats();
//! # assert_eq!(std::fs::metadata(&output)?.len(), report.file_bytes);
//! # assert_eq!(decoded.len() as u64 + report.removed, original.len() as u64);
//! # assert!(report.file_bytes * 10 < std::fs::metadata(&input)?.len(), "{}", report.file_bytes);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Two scenes compared:
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
mod in_turn;
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
pub use in_turn::{FrameRate, bench_cpu_in_turn, bench_gpu_in_turn};
pub use misfit::misfit;
pub use png::png;
pub use scene_file::{Loaded, OtherRead, SceneFile, Whereabouts};
pub use scorer::Scorer;
pub use scores::{Comparison, Summary, ViewScore};
pub use views::{
    ChosenViews, DEFAULT_HOLD, DEFAULT_MAX_WIDTH, DEFAULT_ORBIT, ORBIT_SIZE, SceneKind, SplitFilter, View,
    ViewOptions, cameras_beside, choose_views, find_views, photo,
};

#[cfg(test)]
mod tests {
    /// The README's example in Rust is the one above, which is compiled and run.
    #[test]
    fn the_example_of_the_readme_is_tested() {
        let Some(readme) = lexisplat_testing::repository_file("README.md") else { return };
        let readme = std::fs::read_to_string(readme).unwrap();
        let (_, example) = readme.split_once("```rust\n").unwrap();
        let (example, _) = example.split_once("```").unwrap();
        assert!(example.lines().count() >= 4 && example.contains("Compression"), "{example}");
        for line in example.lines() {
            assert!(include_str!("lib.rs").contains(&format!("//! {line}\n")), "{line}");
        }
    }
}
