//! Facts about a .lexi file, in the form of reports.

use lexisplat::packed::StreamBits;
use lexisplat::{Pursuit, Record};
use serde::Serialize;

/// The record of how a .lexi file was made and of its errors, to serialise. docs/FORMAT.md explains the keys.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[allow(missing_docs, reason = "the fields are those of a record, by their keys in reports")]
#[non_exhaustive]
pub struct RecordReport {
    /// `None` for a packed file.
    pub pursuit: Option<&'static str>,
    pub tol: Option<f64>,
    pub max_nonzeros: Option<u8>,
    pub seed: u64,
    pub max_residual: f64,
    pub rms_residual: f64,
    pub over_tolerance: u64,
}

impl From<&Record> for RecordReport {
    fn from(record: &Record) -> Self {
        Self {
            pursuit: record.pursuit.map(Pursuit::name),
            tol: record.tolerance,
            max_nonzeros: record.max_nonzeros,
            seed: record.seed,
            max_residual: record.max_residual,
            rms_residual: record.rms_residual,
            over_tolerance: record.over_tolerance,
        }
    }
}

/// A number of bytes, serialised as an integer if it is whole. It need not be whole, because the streams of a packed file
/// share bytes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(untagged)]
pub enum ByteCount {
    /// A whole number of bytes.
    Whole(u64),
    /// A number of bytes with a fraction.
    Fraction(f64),
}

impl From<f64> for ByteCount {
    fn from(bytes: f64) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
        if bytes >= 0.0 && bytes.fract() == 0.0 { Self::Whole(bytes as u64) } else { Self::Fraction(bytes) }
    }
}

/// Name of the entry that is the difference of the bytes of the tensor `packed.data` and the bits of its streams.
pub(crate) const ROUNDING: &str = "rounding";

/// Returns the bytes of each attribute of a file, by name. Their sum is the size of the file.
///
/// `tensors` are the bytes of each tensor and of the header. For a packed file `streams` are the bits of each stream in the
/// tensor `packed.data`. Streams are summed by attribute. Streams end in whole words, so the tensor has more bytes than the
/// streams have bits. The entry `rounding` is the difference.
#[must_use]
pub fn attribute_bytes(tensors: &[(String, u64)], streams: &[StreamBits]) -> Vec<(String, f64)> {
    let mut out: Vec<(String, f64)> = Vec::new();
    for stream in streams {
        match out.iter_mut().find(|a| a.0 == stream.attribute) {
            Some(found) => found.1 += stream.bits / 8.0,
            None => out.push((stream.attribute.to_owned(), stream.bits / 8.0)),
        }
    }
    let coded: f64 = out.iter().map(|a| a.1).sum();
    for (name, bytes) in tensors {
        let bytes = *bytes as f64;
        match name.strip_prefix("packed.") {
            Some("data") => out.push((ROUNDING.to_owned(), bytes - coded)),
            Some(name) => out.push((name.to_owned(), bytes)),
            None => out.push((name.clone(), bytes)),
        }
    }
    out
}

/// Returns the sum of the bytes of the `attributes` of SH-rest: the dictionary, codes and escapes.
#[must_use]
pub fn sh_bytes(attributes: &[(String, f64)]) -> f64 {
    let is_sh =
        |name: &str| name == "dictionary" || name.starts_with("codes.") || name.starts_with("escapes.");
    attributes.iter().filter(|a| is_sh(&a.0)).map(|a| a.1).sum()
}
