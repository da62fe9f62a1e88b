//! A dictionary on its own, for reuse on other scenes.

use std::path::Path;

use safetensors::Dtype;

use super::exact::refuse_unknown;
use super::read;
use super::schema::{DICTIONARY_FORMAT, FORMAT, IGNORED_PREFIX, VERSION, key, tensor};
use super::tensors::{Checked, Draft, Tensor, preamble};
use crate::packed::Decoder;
use crate::scene::sh::ShDegree;
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::Layout;
use crate::support::error::{Error, Result};
use crate::support::input::Input;
use crate::support::limits::Limits;
use crate::support::progress::Silent;
use crate::support::sink::Sink;

/// Reads the dictionary of a dictionary file or of a .lexi scene.
///
/// # Errors
/// As [`super::read()`]; a scene of degree 0 has none.
pub fn read_dictionary(path: &Path, limits: &Limits) -> Result<Dictionary> {
    let bytes = Input::open_within(path, limits)?;
    read_dictionary_bytes(&path.display().to_string(), &bytes, limits)
}

/// Reads the dictionary of a file in memory. `file` is its name in errors.
///
/// # Errors
/// As [`read_dictionary`].
pub fn read_dictionary_bytes(file: &str, bytes: &[u8], limits: &Limits) -> Result<Dictionary> {
    let checked = Checked::open(file, bytes, &[DICTIONARY_FORMAT, FORMAT], limits)?;
    let degree = ShDegree::new(checked.number(key::DEGREE)?)
        .map_err(|e| checked.malformed(format!("metadata 'degree': {e}")))?;
    if degree == ShDegree::ZERO {
        return Err(checked.malformed("a scene of SH degree 0 has no dictionary"));
    }
    if checked.text(key::FORMAT)? == FORMAT {
        let layout = read::layout(&checked)?;
        if layout == Layout::Packed {
            let head = super::packed::head(&checked, bytes.len() as u64, limits)?;
            let decoder = Decoder::new(&head, file, super::packed::data(&checked)?);
            return Ok(decoder.map_err(|e| e.of_file(file))?.dictionary);
        }
        refuse_unknown(&checked, layout, degree)?;
    } else {
        let known = |name: &str| {
            [tensor::DICTIONARY, tensor::HEADER_CHECKSUM].contains(&name) || name.starts_with(IGNORED_PREFIX)
        };
        if let Some(name) = checked.names().iter().find(|name| !known(name)) {
            return Err(checked.malformed(format!("tensor '{name}' is not known in a dictionary")));
        }
    }
    read::dictionary(&checked, degree, limits)
}

/// Writes `dictionary`. Returns the number of bytes.
///
/// # Errors
/// [`Error::Parameter`] for the empty dictionary of degree 0, [`Error::Io`] for the sink.
pub fn write_dictionary<'a>(sink: impl Into<Sink<'a>>, dictionary: &Dictionary) -> Result<u64> {
    if dictionary.is_empty() {
        return Err(Error::parameter("dictionary", "empty", "a scene with view-dependent colour"));
    }
    let mut metadata = preamble(DICTIONARY_FORMAT, VERSION);
    metadata.insert(key::DEGREE.to_owned(), dictionary.degree().to_string());
    let shape = [dictionary.len(), dictionary.dim()];
    let tensor = Tensor::plain(tensor::DICTIONARY, Dtype::F32, &shape, dictionary.as_slice());
    Draft::new(metadata, vec![tensor]).save(sink.into(), &Silent)
}
