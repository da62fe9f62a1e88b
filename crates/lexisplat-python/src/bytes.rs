//! Files that are read: mapped files, or bytes from Python.

use std::path::PathBuf;
use std::sync::Arc;

use lexisplat::{Input, Limits};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyDict;

use crate::errors::{Result, raise};

/// The bytes of a file. Clones share them.
#[derive(Debug, Clone)]
pub(crate) enum Bytes {
    /// A file, which is mapped if possible.
    File(Arc<Input>),
    /// Bytes that Python owns.
    Python(Arc<PyBackedBytes>),
    /// Bytes that this module made.
    Own(Arc<Vec<u8>>),
}

impl AsRef<[u8]> for Bytes {
    fn as_ref(&self) -> &[u8] {
        match self {
            Self::File(input) => input,
            Self::Python(bytes) => bytes,
            Self::Own(bytes) => bytes,
        }
    }
}

/// A file as passed by Python: a path, or the bytes of the file.
#[derive(FromPyObject)]
pub(crate) enum Given {
    /// The bytes of the file.
    #[pyo3(transparent)]
    Memory(PyBackedBytes),
    /// The path of the file.
    #[pyo3(transparent)]
    Path(PathBuf),
}

impl Given {
    /// Returns the name of the file in messages.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Memory(_) => "bytes".to_owned(),
            Self::Path(path) => path.display().to_string(),
        }
    }

    /// Returns the bytes. A file must not be larger than `limits` allow.
    pub(crate) fn bytes(self, limits: &Limits) -> Result<Bytes> {
        Ok(match self {
            Self::Memory(bytes) => Bytes::Python(Arc::new(bytes)),
            Self::Path(path) => Bytes::File(Arc::new(Input::open_within(&path, limits)?)),
        })
    }
}

/// Returns the limits in `given`, by name. The others have their defaults.
pub(crate) fn limits(py: Python<'_>, given: Option<&Bound<'_, PyDict>>) -> PyResult<Limits> {
    let mut limits = Limits::default();
    for (name, value) in given.into_iter().flatten() {
        let (name, value): (String, u64) = (name.extract()?, value.extract()?);
        limits = limits.with(&name, value).map_err(|error| raise(py, &error.into()))?;
    }
    Ok(limits)
}
