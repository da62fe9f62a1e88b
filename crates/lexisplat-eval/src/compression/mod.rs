//! Compression as one call: a source of splats in, a .lexi file and a report out.
//!
//! A [`Compression`] says how. [`Compression::run`] measures what shows in pictures, packs to a quality or a size
//! without what does not show, writes, and reports. Programs, windows and bindings need no more than this:
//!
//! ```
//! use lexisplat::packed::Preset;
//! use lexisplat::{Limits, Silent, lexi};
//! use lexisplat_eval::{Compression, Packing};
//! use lexisplat_sample::{SampleOptions, scene};
//!
//! let splats = scene(&SampleOptions::new(2000, 0));
//! let compression = Compression::from(Packing::new(Preset::Small));
//! let mut file = Vec::new();
//! let report = compression.run(&splats, &mut file, &Silent)?;
//! assert_eq!(report.file_bytes, file.len() as u64);
//! let read = lexi::read_bytes("scene.lexi", &file, &Limits::default())?;
//! assert_eq!(read.len() as u64 + report.removed, splats.len() as u64);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod alone;
mod belonging;
mod facts;
mod fewer;
mod found;
mod judge;
mod layout;
mod memo;
mod natural_width;
mod observed_directions;
mod only_cancels;
mod packing;
mod part_step;
mod parts;
mod photo_views;
mod refit;
mod report;
mod run;
mod sharp_views;
mod size_spread;
mod solve;
mod target;
pub mod tiles;
mod views;

pub use facts::{ByteCount, RecordReport, part_bytes, sh_bytes};
pub use judge::{Judge, Score};
pub use layout::choose_layout;
pub use packing::{Compression, Packing, Quality};
pub use report::{CompressionReport, SensitivitySource, overshoot, uncertain_by};
pub use target::Target;
pub use views::{Looked, PackingViews, judging_views};
