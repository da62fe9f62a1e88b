//! A source of splats with a first view.

use std::borrow::Cow;
use std::ops::Range;

use lexisplat::{Progress, SplatSource, Splats};
use lexisplat_render::Pose;

use crate::error::Result;
use crate::first_view::first_view;

/// A source of splats with a first view, from which viewers show the compressed scene. For a source without a view,
/// [`Compression::run`](crate::Compression::run) chooses one.
pub struct WithView<'a> {
    source: &'a dyn SplatSource,
    view: String,
}

impl std::fmt::Debug for WithView<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("WithView").field("view", &self.view).finish_non_exhaustive()
    }
}

impl<'a> WithView<'a> {
    /// Returns `source` with this view. `None` stands for a file without a view.
    #[must_use]
    pub fn new(source: &'a dyn SplatSource, view: Option<Pose>) -> Self {
        Self { source, view: view.map_or_else(String::new, |pose| pose.to_string()) }
    }

    /// Returns `source` with the view that it has, or else the best of generated views.
    pub(crate) fn best(source: &'a dyn SplatSource, progress: &dyn Progress) -> Result<Self> {
        match source.empty().meta.view {
            Some(view) => Ok(Self { source, view }),
            None => Ok(Self::new(source, first_view(source, None, progress)?)),
        }
    }

    fn seen(&self, mut splats: Splats) -> Splats {
        splats.meta.view = Some(self.view.clone());
        splats
    }
}

impl SplatSource for WithView<'_> {
    fn len(&self) -> usize {
        self.source.len()
    }

    fn empty(&self) -> Splats {
        self.seen(self.source.empty())
    }

    fn has_normals(&self) -> bool {
        self.source.has_normals()
    }

    fn row_bytes(&self) -> u64 {
        self.source.row_bytes()
    }

    fn source_bytes(&self) -> u64 {
        self.source.source_bytes()
    }

    fn tiles(&self) -> &[&dyn SplatSource] {
        self.source.tiles()
    }

    fn warnings(&self) -> &[String] {
        self.source.warnings()
    }

    fn read(&self, range: Range<usize>, part: &mut Splats) -> lexisplat::Result<()> {
        let mut own = self.source.empty();
        std::mem::swap(&mut own, part);
        own.meta.view = None;
        let read = self.source.read(range, &mut own);
        *part = self.seen(own);
        read
    }

    fn whole(&self) -> lexisplat::Result<Cow<'_, Splats>> {
        Ok(Cow::Owned(self.seen(self.source.whole()?.into_owned())))
    }

    fn read_rest(&self, gaussians: &[usize], out: &mut Vec<f32>) -> lexisplat::Result<()> {
        self.source.read_rest(gaussians, out)
    }
}
