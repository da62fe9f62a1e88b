//! `.ksplat`.

use lexisplat::ply::ReadOptions;
use lexisplat::{Error, Result};

use crate::rows::Described;

pub(crate) fn is_likely(_bytes: &[u8]) -> bool {
    false
}

pub(crate) fn read<'a>(name: &str, _bytes: &'a [u8], _options: &ReadOptions) -> Result<Described<'a>> {
    Err(Error::malformed(name, "not read yet"))
}
