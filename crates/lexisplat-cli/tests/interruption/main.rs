//! Runs that are stopped or killed, disks that are full, outputs that are no plain files. docs/ROBUSTNESS.md
//! has the table.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod disks;
#[path = "../folder/mod.rs"]
mod folder;
mod kills;
mod places;
mod runs;
mod signals;
