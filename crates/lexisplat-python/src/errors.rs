//! Converts errors of the library to the exceptions of `lexisplat._errors`.

use std::io;

use lexisplat::FormatError;
use lexisplat_compress::Error;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::PyModule;

/// Result of the crates that this package calls.
pub(crate) type Result<T> = lexisplat_compress::Result<T>;

/// Numbers of errors of the operating system (POSIX `errno.h`), for errors whose number the library does not know.
const NOT_FOUND: i32 = 2;
const INPUT_OUTPUT: i32 = 5;
const PERMISSION_DENIED: i32 = 13;
const ALREADY_EXISTS: i32 = 17;
const IS_A_FOLDER: i32 = 21;
const NO_SPACE: i32 = 28;

/// Returns the Python exception for `error`.
pub(crate) fn raise(py: Python<'_>, error: &Error) -> PyErr {
    make(py, error).unwrap_or_else(|broken| broken)
}

/// Returns an exception about an argument.
pub(crate) fn parameter(
    py: Python<'_>,
    name: &'static str,
    value: impl ToString,
    expected: impl Into<String>,
) -> PyErr {
    raise(py, &Error::parameter(name, value, expected))
}

fn make(py: Python<'_>, error: &Error) -> PyResult<PyErr> {
    use lexisplat::Error as Codec;
    use lexisplat_render::Error as Render;

    let mut message = error.to_string();
    if let Error::Codec(Codec::Format { problem: FormatError::NotFinite { .. }, .. }) = error {
        message.push_str("; drop_invalid=True leaves such Gaussians out");
    }
    let (class, attributes): (&str, Vec<(&str, &str)>) = match error {
        Error::Io { file, source } | Error::Codec(Codec::Io { file, source }) => {
            return os_error(py, source, file);
        }
        Error::Codec(Codec::Writer { source }) => return os_error(py, source, "output"),
        Error::Codec(Codec::TemporaryFile { folder, source }) => {
            return os_error(py, source, &folder.display().to_string());
        }
        Error::Codec(Codec::Cancelled) => return Ok(PyKeyboardInterrupt::new_err(message)),
        Error::Format { file, .. } | Error::Codec(Codec::Format { file, .. }) => {
            ("FormatError", vec![("file", file)])
        }
        Error::Parameter { name, value, .. }
        | Error::Codec(Codec::Parameter { name, value, .. })
        | Error::Render(Render::Parameter { name, value, .. }) => {
            ("ParameterError", vec![("name", name), ("value", value)])
        }
        Error::Memory { .. } => ("ParameterError", vec![("name", "memory")]),
        Error::Limit { .. } | Error::Codec(Codec::Limit { .. }) => ("LimitError", Vec::new()),
        Error::Render(Render::GpuLimit { .. } | Render::Gpu { .. }) => ("GpuError", Vec::new()),
        _ => ("Error", Vec::new()),
    };
    let exception = module(py)?.getattr(class)?.call1((message,))?;
    for (name, value) in attributes {
        exception.setattr(name, value)?;
    }
    Ok(PyErr::from_value(exception))
}

fn os_error(py: Python<'_>, source: &io::Error, file: &str) -> PyResult<PyErr> {
    let number = source.raw_os_error().unwrap_or(match source.kind() {
        io::ErrorKind::NotFound => NOT_FOUND,
        io::ErrorKind::PermissionDenied => PERMISSION_DENIED,
        io::ErrorKind::AlreadyExists => ALREADY_EXISTS,
        io::ErrorKind::IsADirectory => IS_A_FOLDER,
        io::ErrorKind::StorageFull => NO_SPACE,
        _ => INPUT_OUTPUT,
    });
    let text = source.to_string();
    // The standard library appends the number to the text, and so does Python.
    let text = text.strip_suffix(&format!(" (os error {number})")).unwrap_or(&text);
    Ok(PyErr::from_value(module(py)?.getattr("os_error")?.call1((number, text, file))?))
}

fn module(py: Python<'_>) -> PyResult<Bound<'_, PyModule>> {
    PyModule::import(py, "lexisplat._errors")
}
