//! Progress of work within other work.

use lexisplat::Progress;

/// Passes cancellation on, but no reports: those of the work around it go on.
pub(crate) struct OnlyCancels<'a>(pub(crate) &'a dyn Progress);

impl Progress for OnlyCancels<'_> {
    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}

/// Passes on what is done, but not where its steps begin and end: they are parts of a longer step.
pub(crate) struct OneStep<'a>(pub(crate) &'a dyn Progress);

impl Progress for OneStep<'_> {
    fn advance(&self, units: u64) {
        self.0.advance(units);
    }

    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}
