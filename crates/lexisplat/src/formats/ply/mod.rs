//! PLY scenes: every trainer's dialect in, the INRIA layout out.
//!
//! Properties are found by name, in any order and of any scalar type, in binary of either byte order
//! or ASCII. What a trainer adds beyond 3DGS stays as [`Extra`](crate::Extra); what this crate cannot
//! code (compressed, 2D or anchor models, point clouds) is refused by name.
//!
//! Layouts this is tested on: INRIA (also 3DGS-MCMC and Pixel-GS), gsplat, nerfstudio, Brush, Postshot.
//!
//! A binary file is mapped and filled in parallel, a chunk of rows at a time and in each chunk a run of
//! neighbouring properties at a time; type and byte order are looked up once a run, never once a value.
//! ASCII rows are turned into binary ones a chunk at a time and take the same way.
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
//! ply::write_to(&mut bytes, &one)?;
//! let read = ply::read_bytes("one.ply", &bytes, &ply::ReadOptions::default())?;
//! assert_eq!(read.splats, one);
//! assert!(read.warnings.is_empty());
//! # Ok(())
//! # }
//! ```

mod ascii;
mod chunks;
mod columns;
mod fill;
mod header;
mod layout;
mod marks;
mod names;
mod read;
mod rows;
mod source;
mod summary;
mod write;

pub use chunks::PlySource;
pub use header::{Format, ScalarType};
pub use read::{PlyRead, ReadOptions, read, read_bytes};
pub use summary::{Dialect, PlySummary};
pub(crate) use write::{PlyWriter, check, file_bytes};
pub use write::{write, write_to};
