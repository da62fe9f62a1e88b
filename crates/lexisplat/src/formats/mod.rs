//! Files: PLY, .lexi, and how to tell which of them some bytes are.

mod expected_kind;
pub(crate) mod kind;
pub mod lexi;
pub mod ply;
