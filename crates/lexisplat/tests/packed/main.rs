//! The packed form: what comes back, what is promised, odd scenes, and what is refused.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod convergence;
mod elsewhere;
mod feed;
mod odd;
mod order;
mod promises;
mod refusals;
mod round_trips;
mod streamed;
mod support;
