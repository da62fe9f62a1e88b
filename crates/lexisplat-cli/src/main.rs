//! The `lexisplat` command.
fn main() {}
