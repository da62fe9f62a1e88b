//! PLY reading and writing: dialects, refusals, a naive reader beside the fast one, real files.

#![allow(clippy::expect_used, clippy::unwrap_used, reason = "the helpers of tests are tests")]

mod dialects;
mod oracle;
mod real;
mod refusals;
mod support;
