//! Reads and writes 3D Gaussian Splatting scenes in the formats of other programs.
//!
//! [`open`] recognises the format of a file by its content and returns a [`SplatSource`](lexisplat::SplatSource), which all crates
//! of this project read. [`write`](fn@write) writes a scene in any of the formats of [`Kind::WRITTEN`]:
//!
//! ```
//! use lexisplat::ply::ReadOptions;
//! use lexisplat::{Input, Silent};
//! use lexisplat_formats::{Kind, Siblings, WriteOptions, open, write};
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("scene.spz");
//! # let scene = lexisplat_sample::scene(&lexisplat_sample::SampleOptions::new(2000, 0));
//! # write(Kind::Spz, &scene, &WriteOptions::default(), &path, &Silent)?;
//!
//! let bytes = Input::open(&path)?; // a file of any format
//! let opened = open("scene.spz", &bytes, Siblings::of(&path), &ReadOptions::default(), true, &Silent)?;
//! let splats = opened.source().whole()?;
//! println!("{}: {} Gaussians", opened.kind(), splats.len());
//! # assert_eq!((opened.kind(), splats.len()), (Kind::Spz, 2000));
//!
//! let mut glb = Vec::new();
//! let (size, lost) = write(Kind::Gltf, &splats, &WriteOptions::default(), &mut glb, &Silent)?;
//! println!("{size} bytes without {:?}", lost.extras);
//! # assert_eq!(size, glb.len() as u64);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`Edits`] cuts, scales, turns and moves a scene, and [`merge`](fn@merge) appends one scene to another. docs/FORMATS.md
//! lists for each format its content, its axes, and the properties that are lost.
//!
//! Scenes in memory have the axes of a trainer's PLY. Readers turn scenes to these axes, and writers turn them back.

mod axes;
mod compressed_ply;
mod edit;
mod gltf;
mod kind;
mod ksplat;
mod lost;
mod merge;
mod numbers;
mod opacity;
mod open;
mod quaternion;
mod rows;
mod settle;
mod siblings;
mod sog;
mod source;
mod splat;
mod spz;
mod turn_sh;
mod unknown;
mod write;
mod write_options;

pub use edit::Edits;
pub use kind::Kind;
pub use lost::Lost;
pub use merge::merge;
pub use open::{Opened, open};
pub use siblings::{Siblings, scene_path};
pub use sog::bundle;
pub use source::FormatSource;
pub use write::write;
pub use write_options::WriteOptions;
