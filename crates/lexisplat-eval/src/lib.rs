//! Scores of one 3D Gaussian Splatting scene against another, without photos.
//!
//! [`compare`] draws two scenes from the same cameras and scores each pair of pictures with [`psnr`]
//! and [`ssim`]; [`views`] finds the cameras; [`montage`](montage()) and [`report`] show the result.
//!
//! ```
//! use lexisplat::sample::{SampleOptions, scene};
//! use lexisplat_eval::{CompareOptions, compare};
//! use lexisplat_render::{Scene, orbit};
//!
//! let original = scene(&SampleOptions::new(500, 0));
//! let mut changed = original.clone();
//! changed.sh_rest.iter_mut().for_each(|v| *v *= 0.9);
//! let cameras = orbit(&original.geometry, 2, 64, 48);
//! let (a, b) = (Scene::from(&original), Scene::from(&changed));
//! let comparison = compare(&a, &b, &cameras, &CompareOptions::default());
//! assert!(comparison.psnr.mean.unwrap() > 20.0 && !comparison.identical);
//! ```

mod compare;
mod error;
mod metrics;
mod montage;
pub mod report;
pub mod views;

pub use compare::{CompareOptions, Comparison, Summary, View, ViewScore, compare, compare_with};
pub use error::{Error, Result};
pub use metrics::{psnr, ssim};
pub use montage::{DEFAULT_AMPLIFICATION, Montage, difference, montage};
