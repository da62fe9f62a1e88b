//! GPU against CPU.
