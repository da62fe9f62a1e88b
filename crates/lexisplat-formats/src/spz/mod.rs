//! SPZ.

use lexisplat::ply::ReadOptions;
use lexisplat::{Error, Result, Splats};

use crate::rows::Described;
use crate::write::{Lost, WriteOptions};

pub(crate) fn read<'a>(name: &str, _bytes: &'a [u8], _options: &ReadOptions) -> Result<Described<'a>> {
    Err(Error::malformed(name, "not read yet"))
}

pub(crate) fn write(_splats: &Splats, _options: &WriteOptions) -> Result<(Vec<u8>, Lost)> {
    Err(Error::parameter("format", "spz", "not written yet"))
}
