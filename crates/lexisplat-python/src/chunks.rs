//! Decodes a file part by part, on a thread of its own that is one part ahead.

use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use lexisplat::{Error, Splats};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{ShOrder, to_python};
use crate::errors::{Result, raise};
use crate::held::Held;
use crate::work::POLL;

/// Largest number of decoded parts that wait to be taken. With the part being decoded they bound the memory.
const WAITING: usize = 1;

/// The number of the first Gaussian, and the part.
type Part = Result<(usize, Splats)>;

/// An iterator over parts: the number of the first Gaussian, and arrays.
#[pyclass(frozen, module = "lexisplat._native")]
#[derive(Debug)]
pub(crate) struct Chunks(Mutex<Receiver<Part>>);

impl Chunks {
    pub(crate) fn start(held: Arc<Held>) -> Self {
        let (sender, receiver) = sync_channel(WAITING);
        thread::spawn(move || {
            let decoded = held.reader().and_then(|reader| {
                reader.each(&mut |start, model| {
                    // After the iterator is dropped, there is no receiver.
                    sender.send(Ok((start, model.into_splats()))).map_err(|_| Error::Cancelled)
                })?;
                Ok(())
            });
            if let Err(error) = decoded {
                // After the iterator is dropped, there is no receiver.
                let _ = sender.send(Err(error));
            }
        });
        Self(Mutex::new(receiver))
    }
}

#[pymethods]
impl Chunks {
    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __next__<'py>(&self, py: Python<'py>) -> PyResult<Option<(usize, Bound<'py, PyDict>)>> {
        loop {
            let next = py.detach(|| self.0.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(POLL));
            match next {
                Ok(Ok((start, splats))) => {
                    return Ok(Some((start, to_python(py, splats, ShOrder::Strided)?)));
                }
                Ok(Err(error)) => return Err(raise(py, &error)),
                Err(RecvTimeoutError::Disconnected) => return Ok(None),
                Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            }
        }
    }
}
