//! The bounds of a scene, from the parts that have come.

use std::collections::BTreeMap;

use lexisplat::Geometry;
use lexisplat_render::gpu::ScenePart;
use lexisplat_render::{Camera, Pose, bulk, near_plane, orbit};
use lexisplat_view::{DVec3, SceneBounds, Slot};

/// Number of Gaussians of each part that are remembered.
const SAMPLE: usize = 2048;
/// Number of views of the orbit that is stepped through, as in `lexisplat view`, and their size, which the canvas
/// replaces.
const ORBIT: usize = 24;
const ORBIT_SIZE: (u32, u32) = (1280, 720);
/// Growth of the number of sampled Gaussians after which the bounds are found again. They are also found again when all
/// Gaussians have come.
const GROWTH: usize = 2;
/// Largest distance from a place of the picture at which Gaussians count as seen there, as a share of the picture's
/// shorter side.
const NEAR: f64 = 0.02;
/// Smallest opacity, after the sigmoid, of Gaussians that count as seen.
const SOLID: f32 = 0.3;
/// Share of the Gaussians near a place that are skipped in front of the point that is looked at.
const PASSED: f64 = 0.1;

/// A sample of the scene that is looked at.
#[derive(Debug, Default)]
pub(super) struct Bounds {
    slot: Option<Slot>,
    parts: BTreeMap<usize, Geometry>,
    /// Numbers of Gaussians that the scene will have, and that have come.
    wanted: u64,
    came: u64,
    /// Number of Gaussians of the sample when the bounds were last found.
    found_at: usize,
    /// Link to the view that was last chosen for the scene, until the user changes the view.
    pub(super) link: Option<String>,
    /// The view that the scene's file states.
    pub(super) first_view: Option<Pose>,
}

impl Bounds {
    /// Begins with the scene in `slot`, which will have `wanted` Gaussians.
    pub(super) fn begin(&mut self, slot: Slot, wanted: u64, first_view: Option<Pose>) {
        *self = Self { slot: Some(slot), wanted, first_view, link: self.link.take(), ..Self::default() };
    }

    /// Takes a part of the scene in `slot`. Returns whether the bounds should be found again. Parts that come when all wanted
    /// Gaussians have come change nothing.
    pub(super) fn add(&mut self, slot: Slot, index: usize, part: &ScenePart<'_>) -> bool {
        let is_whole = self.wanted > 0 && self.came >= self.wanted;
        if is_whole || self.slot != Some(slot) || self.parts.contains_key(&index) {
            return false;
        }
        self.parts.insert(index, part.sample((part.len() as usize / SAMPLE).max(1)));
        self.came += u64::from(part.len());
        let sampled: usize = self.parts.values().map(Geometry::len).sum();
        // The view of a whole scene must not depend on the order in which its parts came.
        let is_whole = self.came == self.wanted;
        if sampled > 0 && (is_whole || sampled >= GROWTH * self.found_at) {
            self.found_at = sampled;
            return true;
        }
        false
    }

    fn geometry(&self) -> Geometry {
        let mut all = Geometry::default();
        for part in self.parts.values() {
            all.positions.extend(&part.positions);
            all.opacities.extend(&part.opacities);
            all.scales.extend(&part.scales);
        }
        all
    }

    /// Returns the bounds of the scene at which `cameras` look.
    pub(super) fn of_scene(&self, cameras: &[Camera]) -> SceneBounds {
        Self::bounds(&self.geometry(), cameras)
    }

    /// Returns cameras around the scene, and the bounds of the scene.
    pub(super) fn around(&self) -> (Vec<Camera>, SceneBounds) {
        let geometry = self.geometry();
        let cameras = orbit(&geometry, ORBIT, ORBIT_SIZE.0, ORBIT_SIZE.1);
        (cameras, Self::bounds(&geometry, &[]))
    }

    fn bounds(geometry: &Geometry, cameras: &[Camera]) -> SceneBounds {
        SceneBounds::new(bulk(geometry), near_plane(geometry), cameras)
    }

    /// Returns the point of the scene that `camera` sees at a place, given in shares of its picture.
    pub(super) fn seen(&self, camera: &Camera, x: f64, y: f64) -> Option<DVec3> {
        let (width, height) = (f64::from(camera.width), f64::from(camera.height));
        let place = [x * width - width / 2.0, y * height - height / 2.0];
        let near = NEAR * width.min(height);
        let mut seen: Vec<(f64, [f32; 3])> = Vec::new();
        for part in self.parts.values() {
            for (&at, &opacity) in part.positions.iter().zip(&part.opacities) {
                let [right, down, depth] = camera.to_view(at).map(f64::from);
                let off = [
                    f64::from(camera.fx) * right / depth - place[0],
                    f64::from(camera.fy) * down / depth - place[1],
                ];
                let solid = 1.0 / (1.0 + (-opacity).exp()) > SOLID;
                if depth > 0.0 && solid && off[0].hypot(off[1]) < near {
                    seen.push((depth, at));
                }
            }
        }
        seen.sort_by(|a, b| a.0.total_cmp(&b.0));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "below the number of points"
        )]
        let passed = (seen.len() as f64 * PASSED) as usize;
        seen.get(passed).map(|(_, at)| DVec3::from_array(at.map(f64::from)))
    }
}
