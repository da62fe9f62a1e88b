//! A dictionary on its own, for reuse on other scenes.

use std::path::Path;

use safetensors::Dtype;

use super::checked::{Checked, Extent};
use super::exact::refuse_unknown;
use super::fields;
use super::layout::Layout;
use super::schema::{DICTIONARY_FORMAT, FORMAT, VERSION, key, tensor};
use super::tensors::{Source, Tensor, preamble};
use super::write::LexiWriter;
use crate::packed::Decoder;
use crate::scene::sh::ShDegree;
use crate::sparse::dictionary::Dictionary;
use crate::support::error::{Error, Result};
use crate::support::input::Input;
use crate::support::limits::Limits;
use crate::support::progress::Silent;
use crate::support::sink::Sink;

/// Reads the dictionary of a dictionary file or of a .lexi scene.
///
/// # Errors
/// As [`super::read()`]. [`Error::Format`] also for a scene of degree 0, which has no dictionary.
pub fn read_dictionary(path: &Path, limits: &Limits) -> Result<Dictionary> {
    let bytes = Input::open_within(path, limits)?;
    read_dictionary_bytes(&path.display().to_string(), &bytes, limits)
}

/// Reads the dictionary of a file in memory. `file` is its name in errors.
///
/// # Errors
/// As [`read_dictionary`].
pub fn read_dictionary_bytes(file: &str, bytes: &[u8], limits: &Limits) -> Result<Dictionary> {
    let formats = [DICTIONARY_FORMAT, FORMAT];
    let checked = Checked::open(file.to_owned(), Box::new(bytes), &formats, Extent::Whole, limits)?;
    let degree = fields::degree(&checked)?;
    if degree == ShDegree::ZERO {
        return Err(checked.malformed("a scene of SH degree 0 has no dictionary"));
    }
    if checked.text(key::FORMAT)? == FORMAT {
        let layout = fields::layout(&checked)?;
        if layout == Layout::Packed {
            let head = super::packed::head(&checked, limits)?;
            super::packed::check_columns(&checked, head.gaussians)?;
            let data = super::packed::data(&checked)?;
            return Ok(Decoder::new(&head, data.len() as u64)?.dictionary().clone());
        }
        refuse_unknown(&checked, layout, degree)?;
    } else {
        checked.refuse_unknown(|name| name == tensor::DICTIONARY, "in a dictionary")?;
    }
    fields::dictionary(&checked, degree, limits)
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
    metadata.insert(key::DEGREE, dictionary.degree().to_string());
    let shape = [dictionary.len(), dictionary.dim()];
    let atoms = Source::of(dictionary.as_slice());
    let tensor = Tensor::new(tensor::DICTIONARY, Dtype::F32, &shape, atoms);
    LexiWriter::new(metadata, vec![tensor]).write(sink, &Silent)
}
