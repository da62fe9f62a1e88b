//! Runs that are stopped or killed, disks that are full, outputs that are no plain files. docs/ROBUSTNESS.md
//! has the table.

mod disks;
mod kills;
mod outputs;
mod runs;
mod signals;
