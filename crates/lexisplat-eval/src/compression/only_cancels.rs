//! Progress of work within other work.

use lexisplat::Progress;

/// Passes cancellation on, but no reports: those of the work around it go on.
pub(super) struct OnlyCancels<'a>(pub(super) &'a dyn Progress);

impl Progress for OnlyCancels<'_> {
    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}
