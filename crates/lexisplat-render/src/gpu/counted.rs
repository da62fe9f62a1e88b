//! Bytes on the GPU, which are counted while they exist.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Bytes on the GPU. They are counted until this value is dropped.
#[derive(Debug)]
pub(super) struct Counted {
    pub(super) size: u64,
    total: Arc<AtomicU64>,
}

impl Counted {
    /// Adds `size` to `total`.
    pub(super) fn new(size: u64, total: &Arc<AtomicU64>) -> Self {
        total.fetch_add(size, Relaxed);
        Self { size, total: Arc::clone(total) }
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.total.fetch_sub(self.size, Relaxed);
    }
}
