//! A bound on the memory of the arrays of one file.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crate::support::error::{Error, Result};
use crate::support::limits::Limits;

/// Number of bytes of a Gaussian's position, base colour, opacity, scales and rotation.
pub(crate) const GEOMETRY_BYTES: usize = (3 + 3 + 1 + 3 + 4) * size_of::<f32>();
/// Number of bytes of a Gaussian's number of nonzeros.
pub(crate) const COUNT_BYTES: usize = 1;

/// The memory that [`Limits::bytes`] and [`Limits::expansion`] leave for the arrays of one file. Threads share it.
#[derive(Debug)]
pub(crate) struct MemoryBudget<'a> {
    file: &'a str,
    file_bytes: u64,
    limit: u64,
    /// Name of the limit that gives the bound.
    name: &'static str,
    used: AtomicU64,
}

impl<'a> MemoryBudget<'a> {
    /// Creates the budget of `file`, by the name that the caller gave, of `file_bytes` bytes.
    pub(crate) fn new(limits: &Limits, file: &'a str, file_bytes: u64) -> Self {
        let expanded = limits.expansion.saturating_mul(file_bytes);
        let (limit, name) =
            if expanded < limits.bytes { (expanded, "expansion") } else { (limits.bytes, "bytes") };
        Self { file, file_bytes, limit, name, used: AtomicU64::new(0) }
    }

    /// Takes `count` times `each` bytes before they are allocated.
    pub(crate) fn take(&self, count: usize, each: usize) -> Result<()> {
        let bytes = (count as u64).saturating_mul(each as u64);
        let used = self.used.load(Relaxed).saturating_add(bytes);
        self.used.store(used, Relaxed);
        if used <= self.limit { Ok(()) } else { Err(self.error(used, "")) }
    }

    /// Does the same as [`Self::take`], for several threads. Returns whether the budget was large enough.
    pub(crate) fn grow(&self, count: usize, each: usize) -> bool {
        let bytes = (count as u64).saturating_mul(each as u64);
        self.used.fetch_add(bytes, Relaxed).saturating_add(bytes) <= self.limit
    }

    /// Returns the error after [`Self::grow`] returned false. It does not depend on the thread that noticed first, so it has
    /// no number of missing bytes.
    pub(crate) fn full(&self) -> Error {
        self.error(self.limit.saturating_add(1), " (at least)")
    }

    fn error(&self, found: u64, suffix: &str) -> Error {
        let of =
            if self.name == "expansion" { format!("the {} of ", self.file_bytes) } else { String::new() };
        let what = format!("bytes of arrays for {of}{}{suffix}", self.file);
        Error::limit(what, found, self.limit, Some(self.name))
    }
}

impl Limits {
    /// Refuses `count` Gaussians of `each` bytes in memory, made from a file of `file_bytes` bytes, if [`Self::bytes`] or
    /// [`Self::expansion`] do not allow them. It is for readers of further formats.
    ///
    /// # Errors
    /// [`Error::Limit`].
    pub fn check_arrays(&self, file: &str, file_bytes: u64, count: usize, each: usize) -> Result<()> {
        MemoryBudget::new(self, file, file_bytes).take(count, each)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smaller_limit_counts_and_is_named() {
        let limits = Limits::default().with_bytes(1000).with_expansion(3);
        let budget = MemoryBudget::new(&limits, "a.lexi", 100);
        assert!(budget.take(50, 4).is_ok() && budget.grow(25, 4) && !budget.grow(1, 1));
        let said = budget.full().to_string();
        let expected = "bytes of arrays for the 100 of a.lexi (at least): 301 is over the limit of 300";
        assert_eq!(said, expected);
        assert!(matches!(budget.full(), Error::Limit { name: Some("expansion"), .. }));
        let budget = MemoryBudget::new(&limits, "a.lexi", 1000);
        assert!(budget.take(1, 1000).is_ok());
        let said = budget.take(1, 1).unwrap_err().to_string();
        assert_eq!(said, "bytes of arrays for a.lexi: 1001 is over the limit of 1000");
        let none = MemoryBudget::new(&Limits::default().with_expansion(u64::MAX), "a.lexi", u64::MAX);
        assert!(none.take(usize::MAX, usize::MAX).is_ok());
    }
}
