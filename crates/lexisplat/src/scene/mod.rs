//! What a dense scene is: Gaussians, SH, what pictures depend on, what looks wrong.

pub(crate) mod sensitivity;
pub mod sh;
pub(crate) mod splats;
pub mod stats;
