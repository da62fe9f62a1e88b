//! The memory of pictures of one scene, kept from one to the next.

use lexisplat::Geometry;
use lexisplat::simd::Simd;

use crate::radiance::Radiance;
use crate::scene::Scene;

use super::clusters::Clusters;
use super::order::Order;
use super::project::Projection;
use super::tiles::TileLists;
use super::visible::Visible;

/// What drawing a picture makes on the way, about 90 bytes for each Gaussian. The next picture overwrites it, but for the
/// clusters, which are those of the scene.
#[derive(Debug, Default)]
pub(crate) struct Workspace {
    pub(super) visible: Visible,
    pub(super) order: Order,
    pub(super) lists: TileLists,
    clusters: Option<Clusters>,
}

impl Workspace {
    /// The memory of many pictures of a scene.
    pub(super) fn of_scene(geometry: &Geometry) -> Self {
        Self { clusters: Some(Clusters::of(geometry)), ..Self::default() }
    }

    /// Makes clusters, unless this is for the first picture. All pictures must be of the scene that `geometry` is of.
    pub(crate) fn cluster_again(&mut self, geometry: &Geometry) {
        let drawn_before = !self.visible.slots.is_empty();
        if drawn_before && self.clusters.is_none() {
            self.clusters = Some(Clusters::of(geometry));
        }
    }

    /// Projects what a picture of `scene` may show.
    pub(super) fn project(&mut self, scene: &Scene<'_>, radiance: &Radiance<'_>, projection: &Projection) {
        let (keys, geometry) = (&mut self.order.keys, scene.geometry());
        let clusters = self.clusters.as_ref().filter(|clusters| clusters.len() == geometry.len());
        self.visible.project(keys, Simd::current(), geometry, clusters, radiance, projection);
    }
}
