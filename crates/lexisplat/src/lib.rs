//! Codec for trained 3D Gaussian Splatting scenes: a learned dictionary, sparse codes, a promised error.
//!
//! The 45 view-dependent SH coefficients of a Gaussian become a few atoms of a dictionary learned from
//! the scene itself, without photos, cameras or retraining, and no Gaussian ends further from its
//! original than the tolerance.
//!
//! ```
//! use lexisplat_sample::{SampleOptions, scene};
//! use lexisplat::{CompressOptions, Limits, Silent, compress, lexi, ply};
//!
//! let folder = tempfile::tempdir()?;
//! let (input, output) = (folder.path().join("scene.ply"), folder.path().join("scene.lexi"));
//! ply::write(&input, &scene(&SampleOptions::new(2000, 0)))?; // or bring your own
//!
//! let original = ply::read(&input, &ply::ReadOptions::default())?.splats;
//! let (model, report) = compress(original.clone(), &CompressOptions::default(), &Silent)?;
//! lexi::write(&output, &model)?;
//! println!("{:.1} of 45 nonzeros a Gaussian", report.mean_nonzeros);
//!
//! let decoded = lexi::read(&output, &Limits::default())?.into_splats();
//! assert!(model.record().max_residual <= 0.1);
//! assert_eq!(decoded.geometry, original.geometry);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`packed`] makes files several times smaller. It quantises all values as coarsely as pictures allow:
//!
//! ```
//! use lexisplat::packed::{PackOptions, Packer};
//! use lexisplat_sample::{SampleOptions, scene};
//! use lexisplat::{Limits, Sensitivity, Silent, lexi};
//!
//! let splats = scene(&SampleOptions::new(2000, 0));
//! // `lexisplat_render::sensitivity` measures it; without a renderer it can be guessed.
//! let sensitivity = Sensitivity::guess(&splats.geometry);
//! let packer = Packer::new(&splats, &sensitivity, &PackOptions::default())?;
//! let (packed, _) = packer.pack(packer.step_for(40.0), &Silent)?; // about 40 dB
//!
//! let mut file = Vec::new();
//! lexi::LexiWriter::packed(&packed).write(&mut file, &Silent)?;
//! let model = lexi::read_bytes("scene.lexi", &file, &Limits::default())?; // drawn as it is
//! assert_eq!(model.len(), splats.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`compress()`] learns a dictionary ([`mod@learn`]) and codes every Gaussian with it ([`pursuit`]). [`ply`] and
//! [`lexi`] read and write files. [`Splats`] is the scene of a PLY, and [`Model`] that of a .lexi. docs/METHOD.md has the
//! mathematics, docs/FORMAT.md the file.
//!
//! The features `encode`, `parallel` and `mmap` are on by default. Without `encode` the crate reads every file, and
//! neither learns nor packs. Without the other two it needs neither threads nor files, and builds for
//! `wasm32-unknown-unknown`. Results are the same bit for bit.

#![cfg_attr(
    not(feature = "encode"),
    allow(
        dead_code,
        unreachable_pub,
        unused_imports,
        reason = "encoder and decoder of the syntax are one function; the encoder calls more of it"
    )
)]

mod formats;
pub mod packed;
mod scene;
mod sparse;
pub mod stream;
mod support;

pub use formats::kind::{FileKind, Unsupported, without_byte_order_mark};
pub use formats::lexi::{CodeLayout, Layout};
pub use formats::{lexi, ply};
pub use scene::dropped::DroppedRows;
pub use scene::extra::{Extra, ExtraValues};
pub use scene::joined::Joined;
pub use scene::moved::unite;
pub use scene::offset::Offset;
pub use scene::rounding::Rounding;
pub use scene::sensitivity::{AppearanceSensitivity, Sensitivity};
pub use scene::sh::ShDegree;
pub use scene::source::SplatSource;
pub use scene::splats::{FLAT_SCALE, Geometry, SURE_OPACITY, SceneMeta, Splats, flatten_scales};
pub use scene::{sh, stats};
pub use sparse::atoms::{Atoms, MAX_DIM};
pub use sparse::codes::{CodedRest, CodedRows, Column, Escapes, Indices, SparseCodes, Values, reconstruct};
#[cfg(feature = "encode")]
pub use sparse::compress::{CompressOptions, DEFAULT_TOLERANCE, compress};
pub use sparse::dictionary::Dictionary;
pub use sparse::model::{Model, Pursuit, Record};
#[cfg(feature = "encode")]
pub use sparse::tally::CompressReport;
#[cfg(feature = "encode")]
pub use sparse::{learn, pursuit};
pub use support::error::{Error, FormatError, Result};
pub use support::input::Input;
pub use support::inside::{file_inside, inside};
pub use support::limits::{Limits, MAX_ATOMS};
pub use support::progress::{Progress, Silent, Stage};
pub use support::sink::Sink;
pub use support::stopwatch::Stopwatch;
pub use support::{output, simd};
