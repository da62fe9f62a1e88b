//! Version 3 of packed files: layers of chunks that are decoded coarse to fine.

mod around;
mod bytes;
mod chunk;
mod fine;
mod head;
mod index;
mod player;
#[cfg(target_arch = "x86_64")]
mod player_avx2;
mod range;
mod rest;
mod steering;
mod streams;
mod symbols;
mod tables;
mod target;
mod unpack;
mod values;
mod walk;

pub(super) use chunk::{Form, lanes};
pub(super) use head::Head;
pub(super) use index::{Chunk, Index, Pass, Range};
pub(super) use rest::RestForm;
pub(super) use steering::{Integers, Steering};
pub(super) use tables::{ALL_CONTEXTS, Histogram, Lookup, Tables};
pub(super) use target::Target;
pub(super) use unpack::{Frame, Place, unpack};
