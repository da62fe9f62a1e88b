//! Compresses a 3D Gaussian Splatting scene to a quality of its pictures, or to a size.
//!
//! [`compress`] does what the program `lexisplat compress` does, and writes the same bytes:
//!
//! ```
//! # use lexisplat_sample::{SampleOptions, scene};
//! # let folder = tempfile::tempdir()?;
//! # std::env::set_current_dir(&folder)?;
//! # lexisplat::ply::write("scene.ply", &scene(&SampleOptions::new(300, 0)))?;
//! # // A scene is packed by the cameras beside it much sooner than by views that are looked for.
//! # let [left, right] = ["-0.5", "0.5"].map(|x| format!(r#"{{"img_name": "at {x}", "width": 64, "height": 48, "fx": 60,
//! #     "fy": 60, "position": [{x}, -0.5, -4], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}}"#));
//! # std::fs::write("cameras.json", format!("[{left}, {right}]"))?;
//! let report = lexisplat_compress::compress("scene.ply").psnr(42.0).write("scene.lexi")?;
//! println!("{} bytes of {}", report.file_bytes, report.source_bytes);
//! let decoded = lexisplat::lexi::read("scene.lexi", &lexisplat::Limits::default())?.into_splats();
//! # assert_eq!(std::fs::metadata("scene.lexi")?.len(), report.file_bytes);
//! # assert_eq!(decoded.len() as u64 + report.removed, 300);
//! # assert!(report.file_bytes * 8 < std::fs::metadata("scene.ply")?.len(), "{}", report.file_bytes);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Start with [`Compress`], which has the common choices. [`Compression`] has all choices, for packed files ([`Packing`]) and for
//! files with exact geometry. [`Compression::run`] takes any source and any sink.
//!
//! A scene is packed in these steps:
//!
//! 1. [`PackingViews`] chooses the cameras: given cameras, cameras that lie beside the scene, or views like photographs, which a
//!    search finds.
//! 2. [`Looked`] has the sensitivity: how much the pictures from these cameras depend on each value of each Gaussian.
//! 3. [`lexisplat::packed::Packer`] makes a file at one overall step of quantisation.
//! 4. Refitting fits base colours and opacities to the pictures of the original, which makes up for removal and quantisation.
//! 5. [`Judge`] scores the file. The search for a [`Target`] repeats steps 3 to 5 at other overall steps.
//!
//! A scene in parts goes through steps 1 to 4 part by part ([`tiles`]). docs/METHOD.md has the reasons and the figures.

mod backgrounds;
mod beginning;
mod belonging;
mod decibels;
mod drawing;
mod effort;
mod error;
mod facts;
mod fewer;
mod first_view;
mod fit_pictures;
mod found;
mod interim;
mod judge;
mod layout;
mod memo;
mod merge;
mod natural_width;
mod observed_directions;
mod one_step;
mod packing;
mod packing_views;
mod part_step;
mod parts;
mod photo_views;
mod reduce;
mod refine;
mod refit;
mod report;
mod run;
mod sharp_views;
mod signs;
mod size_spread;
mod solve;
mod target;
pub mod tiles;
pub mod views;
mod with_view;

pub use beginning::{Compress, Source, compress};
pub use belonging::belong;
pub use decibels::decibels;
pub use drawing::{DrawOptions, draw_views};
pub use effort::Refine;
pub use error::{Error, Result};
pub use facts::{ByteCount, RecordReport, attribute_bytes, sh_bytes};
pub use judge::{Judge, Score};
pub use layout::choose_layout;
pub use packing::{Compression, DEFAULT_MEMORY, Packing, Quality};
pub use packing_views::{Looked, PackingViews, judging_views};
pub use report::{CompressionReport, RefineReport, SensitivitySource, overshoot, uncertain_by};
pub use signs::shows_almost_nothing;
pub use target::Target;
pub use views::{
    ChosenViews, DEFAULT_HOLD, DEFAULT_MAX_WIDTH, DEFAULT_ORBIT, ORBIT_SIZE, SplitFilter, View, ViewOptions,
    Viewpoints, cameras_beside, choose_views, find_views, photo, read_beside,
};
pub use with_view::WithView;

#[cfg(test)]
mod tests {
    /// The README's example in Rust is the one above, which is compiled and run.
    #[test]
    fn the_example_of_the_readme_is_tested() {
        let Some(readme) = lexisplat_testing::repository_file("README.md") else { return };
        let readme = std::fs::read_to_string(readme).unwrap();
        let (_, example) = readme.split_once("```rust\n").unwrap();
        let (example, _) = example.split_once("```").unwrap();
        assert!(example.lines().count() >= 3 && example.contains("compress("), "{example}");
        for line in example.lines() {
            assert!(include_str!("lib.rs").contains(&format!("//! {line}\n")), "{line}");
        }
    }
}
