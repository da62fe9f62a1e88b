//! Bundles a SOG of several files into one archive.

use std::collections::BTreeSet;

use lexisplat::{Limits, Result};

use super::meta::Meta;
use super::{META, ZIP, archive};
use crate::kind::Kind;
use crate::siblings::Siblings;

/// Returns the SOG whose `meta.json` has the content `bytes` as one archive. The files that it names are taken unchanged
/// from `siblings`. Returns `None` for scenes of other formats and for SOG archives, because these are single files.
///
/// # Errors
/// [`Error::Format`](lexisplat::Error::Format) for a damaged `meta.json`, [`Error::Limit`](lexisplat::Error::Limit) for
/// an archive of more than 4 GiB, and errors of `siblings`.
pub fn bundle(name: &str, bytes: &[u8], siblings: Siblings<'_>, limits: &Limits) -> Result<Option<Vec<u8>>> {
    if Kind::of(name, bytes) != Some(Kind::Sog) || bytes.starts_with(ZIP) {
        return Ok(None);
    }
    limits.check_header(name, bytes.len() as u64)?;
    let meta = Meta::parse(name, bytes)?;
    let sh = meta.sh.iter().flat_map(|sh| &sh.files);
    let files: BTreeSet<&str> = meta
        .means_files
        .iter()
        .chain([&meta.quats_file, &meta.scales_file, &meta.sh0_file])
        .chain(sh)
        .map(String::as_str)
        .collect();
    let mut members = vec![(META, bytes.to_vec())];
    for file in files {
        members.push((file, siblings.read_below(name, file, limits)?.to_vec()));
    }
    archive::write(&members).map(Some)
}
