//! Progress of work that is one step, although its parts report stages of their own.

use lexisplat::Progress;

/// Passes on how much is done, but not where steps begin and end, because they are parts of a longer step.
pub(crate) struct OneStep<'a>(pub(crate) &'a dyn Progress);

impl Progress for OneStep<'_> {
    fn advance(&self, units: u64) {
        self.0.advance(units);
    }

    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}
