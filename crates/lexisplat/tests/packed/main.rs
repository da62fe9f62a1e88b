//! The packed form: what comes back, what is promised, odd scenes, and what is refused.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

#[path = "../common/mod.rs"]
mod common;
mod convergence;
mod odd;
mod order;
#[path = "../common/parts.rs"]
mod parts;
mod promises;
mod refusals;
mod round_trips;
mod support;
