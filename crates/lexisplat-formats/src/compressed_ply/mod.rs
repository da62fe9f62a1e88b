//! compressed.ply.

use lexisplat::ply::{Header, ReadOptions};
use lexisplat::{Error, Limits, Result, Splats};

use crate::rows::Described;
use crate::write::{Lost, WriteOptions};

/// Whether the PLY in `bytes` has packed elements.
pub(crate) fn is_likely(bytes: &[u8]) -> bool {
    let is_packed = |header: Header| {
        header
            .elements
            .iter()
            .any(|e| e.name == "chunk" || e.properties.iter().any(|p| p.name == "packed_position"))
    };
    Header::parse("", bytes, &Limits::default()).is_ok_and(is_packed)
}

pub(crate) fn read<'a>(name: &str, _bytes: &'a [u8], _options: &ReadOptions) -> Result<Described<'a>> {
    Err(Error::malformed(name, "not read yet"))
}

pub(crate) fn write(_splats: &Splats, _options: &WriteOptions) -> Result<(Vec<u8>, Lost)> {
    Err(Error::parameter("format", "compressed_ply", "not written yet"))
}
