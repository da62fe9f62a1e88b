//! Asking for what a view shows within a budget.

use super::LexiFeed;
use super::ranges::is_asked_for;
use crate::packed::{Budget, Eye, Selection};

/// Of a scene that is larger than a device can hold, a feed holds what an eye sees, and as finely as a budget allows.
///
/// ```
/// # use lexisplat::packed::{PackOptions, Packer};
/// # use lexisplat::{Limits, Sensitivity, Silent, lexi};
/// # let splats = lexisplat_sample::scene(&lexisplat_sample::SampleOptions::new(2000, 0));
/// # let sensitivity = Sensitivity::guess(&splats.geometry);
/// # let packer = Packer::new(&splats, &sensitivity, &PackOptions::default().with_layers_from(1))?;
/// # let (packed, _) = packer.pack(packer.step_for(40.0), &Silent)?;
/// # let mut file = Vec::new();
/// # lexi::LexiWriter::packed(&packed).write(&mut file, &Silent)?;
/// # let get = |range: std::ops::Range<u64>| &file[range.start as usize..range.end as usize];
/// use lexisplat::lexi::{FeedOptions, LexiFeed};
/// use lexisplat::packed::{Budget, Eye};
///
/// let mut feed = LexiFeed::new("scene.lexi", &FeedOptions::default(), &Limits::default());
/// while let (None, Some(range)) = (feed.outline(), feed.wants()) {
///     feed.feed(range.start, get(range))?; // the start of the file
/// }
/// let eye = Eye::at([0.0, 0.0, -3.0]).with_forward([0.0, 0.0, 1.0]).with_half_angle(0.6);
/// let seen = feed.look(&eye, &Budget::default().with_splats(500_u64)).unwrap();
/// while let Some(range) = feed.wants() {
///     feed.feed(range.start, get(range))?;
/// }
/// let gaussians: usize = seen.chunks.iter().map(|&c| feed.decode(c).map(|model| model.unwrap().len())).sum::<Result<_, _>>()?;
/// assert!(gaussians as u64 == seen.splats && gaussians <= 500);
/// # Ok::<(), lexisplat::Error>(())
/// ```
impl LexiFeed {
    /// Asks for the chunks that `eye` sees, as finely as `budget` allows, the most needed ranges first. Drops the bytes of all
    /// others, as if they had not come. Returns what was chosen; `None` before the start of the file came.
    ///
    /// A chunk decodes in another way when chunks of the next layer [around](Self::around) it come or are dropped. Feeds that
    /// have looked do not [forget](Self::forget) chunks, since these are decoded again then.
    pub fn look(&mut self, eye: &Eye, budget: &Budget) -> Option<Selection> {
        let options = &self.options;
        let ranges = self.ranges.as_deref_mut()?;
        let selection = ranges.outline.select(eye, budget, &|kind| is_asked_for(kind, options));
        ranges.hold(&selection.ranges);
        Some(selection)
    }
}
