//! A procedural scene for demonstrations and tests: a still life on a chequered table.
//!
//! ```
//! use lexisplat_sample::{SampleOptions, scene};
//!
//! let splats = scene(&SampleOptions::new(2000, 0));
//! assert_eq!(splats.len(), 2000);
//! ```
//!
//! Flat Gaussians cover glossy balls, a copper knot on a marble block, a mirror ball, an iced doughnut, clay, books and the wall
//! of a studio. The axes are those of scenes trained from COLMAP's cameras: y points down. The table top is at y = 0 and has a
//! radius of 1.7 world units.
//!
//! Each Gaussian has the view-dependent colour of its surface. The light that leaves the surface is evaluated in directions all
//! over the sphere: diffuse and mirrored light of lamps, with shadows, Fresnel reflection and reflections of other objects. Least
//! squares projects this light onto SH of degree 3. Seeded noise, like that of training, is added. By construction the SH are not
//! sparse in any dictionary.
//!
//! The code uses only operations that IEEE 754 rounds exactly. The same options give the same bits on every platform and with
//! every number of threads.

mod fit;
mod light;
mod material;
mod math;
mod random;
mod scene;
mod shapes;
mod still_life;

pub use scene::{DEFAULT_GAUSSIANS, SampleOptions, scene};
