//! Files that are read: mapped, or bytes that Python gave.

use std::path::PathBuf;
use std::sync::Arc;

use lexisplat::{Input, Limits};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyDict;

use crate::errors::{Result, raise};

/// The bytes of a file, shared.
#[derive(Debug, Clone)]
pub(crate) enum Bytes {
    /// A file, mapped if that is possible.
    File(Arc<Input>),
    /// Bytes that Python holds.
    Python(Arc<PyBackedBytes>),
    /// Bytes that were made here.
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

/// What Python calls a file: a path, or its bytes.
#[derive(FromPyObject)]
pub(crate) enum Given {
    /// The bytes.
    #[pyo3(transparent)]
    Memory(PyBackedBytes),
    /// The path.
    #[pyo3(transparent)]
    Path(PathBuf),
}

impl Given {
    /// The name in messages, where it is not given.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Memory(_) => "bytes".to_owned(),
            Self::Path(path) => path.display().to_string(),
        }
    }

    /// The bytes, of a file that is no larger than `limits` allow.
    pub(crate) fn bytes(self, limits: &Limits) -> Result<Bytes> {
        Ok(match self {
            Self::Memory(bytes) => Bytes::Python(Arc::new(bytes)),
            Self::Path(path) => Bytes::File(Arc::new(Input::open_within(&path, limits)?)),
        })
    }
}

/// The limits that `given` says by name.
pub(crate) fn limits(py: Python<'_>, given: Option<&Bound<'_, PyDict>>) -> PyResult<Limits> {
    let mut limits = Limits::default();
    for (name, value) in given.into_iter().flatten() {
        let (name, value): (String, u64) = (name.extract()?, value.extract()?);
        limits = limits.with(&name, value).map_err(|error| raise(py, &error.into()))?;
    }
    Ok(limits)
}
