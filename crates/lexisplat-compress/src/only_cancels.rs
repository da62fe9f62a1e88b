//! Progress of work that is a part of other work.

use lexisplat::Progress;

/// Passes cancellation on, but no reports, because the surrounding work reports its own progress.
pub(crate) struct OnlyCancels<'a>(pub(crate) &'a dyn Progress);

impl Progress for OnlyCancels<'_> {
    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}

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
