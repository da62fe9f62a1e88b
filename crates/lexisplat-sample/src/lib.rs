//! A procedural scene to try everything on: a still life on a chequered table.
//!
//! Glossy balls, a copper knot on a marble block, a mirror ball, an iced doughnut, clay, books and a
//! dusky studio wall, all covered with flat Gaussians. World units and axes are those of scenes trained
//! from COLMAP's cameras: y points down; the table top is at y = 0 and has a radius of 1.7.
//!
//! The view-dependent colour of each Gaussian is that of its surface: the light that leaves it (diffuse
//! and mirrored, with lamps, shadows, Fresnel reflection and reflections of the neighbours) is evaluated
//! in directions all over the sphere and projected onto SH of degree 3 by least squares. Then comes
//! seeded noise like that of training. Nothing about it is sparse in any dictionary by construction.
//!
//! Only operations that IEEE 754 rounds exactly are used, so the same options give the same bits on any
//! platform and thread count.

mod fit;
mod light;
mod material;
mod math;
mod random;
mod scene;
mod shapes;
mod still_life;

pub use scene::{DEFAULT_GAUSSIANS, SampleOptions, scene};
