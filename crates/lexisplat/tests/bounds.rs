//! Damaged and hostile files of every kind under an allocator that counts. Each test holds
//! [`allocator::alone`], so that it counts nothing but its own memory.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

#[path = "common/allocator.rs"]
mod allocator;
mod common;
mod lexi_mutation;
#[path = "limits/main.rs"]
mod limits;
#[path = "packed_mutation/main.rs"]
mod packed_mutation;
#[path = "common/parts.rs"]
mod parts;
mod ply_mutation;
#[path = "ply/support.rs"]
mod ply_support;
