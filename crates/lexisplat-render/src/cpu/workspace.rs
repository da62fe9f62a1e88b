//! Memory for the pictures of one scene, which is kept from one picture to the next.

use lexisplat::Geometry;
use lexisplat::simd::Simd;

use crate::radiance::Radiance;
use crate::scene::Scene;

use super::clusters::Clusters;
use super::order::Order;
use super::project::Projection;
use super::tiles::TileLists;
use super::visible::{Piece, Visible};

/// Intermediate results of drawing a picture, about 90 bytes for each Gaussian. The next picture overwrites everything
/// but the clusters, which belong to the scene.
#[derive(Debug, Default)]
pub(crate) struct Workspace {
    pub(super) visible: Visible,
    pub(super) order: Order,
    pub(super) lists: TileLists,
    clusters: Option<Clusters>,
}

impl Workspace {
    /// Returns memory for many pictures of a scene.
    pub(super) fn of_scene(geometry: &Geometry) -> Self {
        Self { clusters: Some(Clusters::of(geometry)), ..Self::default() }
    }

    /// Makes clusters, unless this is the first picture. All pictures must be of the scene of `geometry`.
    pub(crate) fn cluster_again(&mut self, geometry: &Geometry) {
        let drawn_before = !self.visible.slots.is_empty();
        if drawn_before && self.clusters.is_none() {
            self.clusters = Some(Clusters::of(geometry));
        }
    }

    /// Projects the Gaussians that a picture of `scene` may show.
    pub(super) fn project(&mut self, scene: &Scene<'_>, radiance: &Radiance<'_>, projection: &Projection) {
        let (keys, geometry) = (&mut self.order.keys, scene.geometry());
        let clusters = self.clusters.as_ref().filter(|clusters| clusters.len() == geometry.len());
        let piece = Piece { geometry, clusters, radiance };
        self.visible.project(keys, Simd::current(), &[piece], projection);
    }

    /// Projects the Gaussians of `pieces` that a picture may show.
    #[cfg(feature = "gpu")]
    pub(super) fn project_pieces(&mut self, pieces: &[Piece<'_>], projection: &Projection) {
        self.visible.project(&mut self.order.keys, Simd::current(), pieces, projection);
    }
}
