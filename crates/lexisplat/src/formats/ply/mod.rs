//! PLY scenes: a reader of the dialects of all trainers, and a writer of INRIA's layout.
//!
//! The reader finds properties by name, in any order and of any scalar type, in binary files of either byte order
//! and in ASCII files. It keeps properties beyond 3DGS as [`Extra`](crate::Extra). It refuses files that this crate
//! cannot code (compressed and anchor models, point clouds) with an error that names their kind. 2D Gaussians become flat
//! ones.
//!
//! Rounding to f32 could move Gaussians by more than a hundredth of their size if positions have another type. An
//! [`Offset`](crate::Offset) is then subtracted first, and the writer adds it again.
//!
//! The reader is tested on the layouts of INRIA (also 3DGS-MCMC and Pixel-GS), gsplat, nerfstudio, Brush and Postshot.
//!
//! A binary file is mapped, and the arrays are filled in parallel. Each task copies a chunk of rows, one run of
//! neighbouring properties after another. Type and byte order are looked up once for each run. Rows of an ASCII file become
//! binary rows first.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use lexisplat::{Geometry, SceneMeta, ShDegree, Splats, ply};
//!
//! let one = Splats {
//!     geometry: Geometry {
//!         positions: vec![[0.0, 1.0, 2.0]],
//!         dc: vec![[0.5; 3]],
//!         opacities: vec![3.0],
//!         scales: vec![[-4.0; 3]],
//!         rotations: vec![[1.0, 0.0, 0.0, 0.0]],
//!         ..Geometry::default()
//!     },
//!     degree: ShDegree::ZERO,
//!     sh_rest: Vec::new(),
//!     meta: SceneMeta::default(),
//! };
//! let mut bytes = Vec::new();
//! ply::write(&mut bytes, &one)?;
//! let read = ply::read_bytes("one.ply", &bytes, &ply::ReadOptions::default())?;
//! assert_eq!(read.splats, one);
//! assert!(read.warnings.is_empty());
//! # Ok(())
//! # }
//! ```

mod ascii;
mod chunks;
mod columns;
mod file;
mod fill;
mod found;
mod header;
mod layout;
mod marks;
mod names;
mod options;
mod position_facts;
mod read;
mod rows;
mod scalar;
mod summary;
mod write;

pub use crate::scene::extra::ScalarType;
pub use chunks::{PlyRead, PlySource};
pub use header::{Element, Format, Header, Kind as PropertyKind, Property};
pub use marks::meta_of;
pub(crate) use names::is_extra_name;
pub use options::ReadOptions;
pub use read::{read, read_bytes};
pub use summary::{Dialect, PlySummary};
pub(crate) use write::write_parts;
pub use write::{comments, write};
