//! The studio: its lamps, the bodies that block light, and the light that leaves a surface.

use crate::material::{Material, Surface};
use crate::math::{Vec3, dvec3, frame, mix, smoothstep, spiral};
use crate::random::Random;
use crate::shapes::{UP, block_axes, reflect};

/// Number of rays from a surface to each lamp. More rays make softer shadows.
const SHADOW_RAYS: usize = 12;
/// Number of rays from a surface that gather indirect light.
const GATHER_RAYS: usize = 32;
/// Distance between the start of rays and the surface, in world units. It is more than the gaps between beads and
/// surface.
const LIFT: f64 = 0.012;
/// Smallest roughness of surfaces that reflect only the studio, not other objects.
const TRACED_ROUGHNESS: f64 = 0.5;
/// Factor on light before the tone curve.
const EXPOSURE: f64 = 0.45;
/// Integral of a lamp's profile in [`Studio::surroundings`]: pi / 4.
const PROFILE: f64 = std::f64::consts::FRAC_PI_4;
/// Factor on the estimated light of other objects, because the estimate ignores shadows.
const BOUNCE: f64 = 0.45;

/// A soft box at infinity.
#[derive(Debug, Clone, Copy)]
struct Lamp {
    /// Direction to the lamp, of unit length.
    to: Vec3,
    colour: Vec3,
    /// `1 - cos` of half the angle that the lamp covers.
    width: f64,
}

/// A body that blocks light.
#[derive(Debug, Clone)]
pub(crate) enum Body {
    Ball {
        centre: Vec3,
        radius: f64,
    },
    /// Balls of the same radius, all within `bound` of the centre.
    Beads {
        centre: Vec3,
        bound: f64,
        beads: Vec<Vec3>,
        radius: f64,
    },
    Disc {
        centre: Vec3,
        radius: f64,
    },
    Block {
        centre: Vec3,
        half: Vec3,
        right: Vec3,
    },
}

/// All bodies with their colours in reflections, and the lamps.
#[derive(Debug)]
pub(crate) struct Studio {
    bodies: Vec<(Body, Vec3)>,
    lamps: [Lamp; 4],
}

/// A lit point of a surface.
#[derive(Debug)]
pub(crate) struct Lit<'a> {
    studio: &'a Studio,
    position: Vec3,
    normal: Vec3,
    surface: Surface,
    /// The diffuse light that leaves the point.
    diffuse: Vec3,
    /// Visible share of each lamp.
    seen: [f64; 4],
    /// Visible share of the wall.
    open: f64,
}

impl Studio {
    pub(crate) fn new(bodies: Vec<(Body, &Material)>) -> Self {
        let lamp = |to: [f64; 3], colour: [f64; 3], width| Lamp {
            to: Vec3::from(to).normalize(),
            colour: colour.into(),
            width,
        };
        Self {
            bodies: bodies.into_iter().map(|(body, material)| (body, material.mean())).collect(),
            lamps: [
                lamp([-0.75, -1.0, -0.55], [3.0, 2.75, 2.35], 0.05),
                lamp([0.95, -0.65, 0.35], [0.75, 1.0, 1.5], 0.05),
                lamp([-0.1, -0.55, 1.0], [1.1, 0.8, 0.75], 0.04),
                lamp([0.25, -1.0, -0.9], [0.7, 0.68, 0.65], 0.08),
            ],
        }
    }

    /// Returns the light of the studio's wall in `direction`: colours of dusk that depend on the height.
    pub(crate) fn wall(direction: Vec3) -> Vec3 {
        let height = direction.dot(UP);
        let low = mix(dvec3(0.012, 0.022, 0.045), dvec3(0.10, 0.15, 0.22), smoothstep(-0.9, -0.05, height));
        let high = mix(low, dvec3(0.52, 0.40, 0.34), smoothstep(-0.25, 0.18, height));
        let top = mix(high, dvec3(0.09, 0.17, 0.34), smoothstep(0.1, 0.75, height));
        // One side is warmer, so that a turn of the camera is visible.
        let warm = smoothstep(-0.4, 1.0, direction.x * 0.8 - direction.z * 0.6);
        top * mix(dvec3(0.8, 0.95, 1.15), dvec3(1.25, 1.0, 0.85), warm)
    }

    /// Returns the light of the lamps and the wall from `direction`, blurred by `roughness`. `seen` and `open` are the
    /// visible shares of the lamps and of the wall.
    fn surroundings(&self, direction: Vec3, roughness: f64, seen: &[f64; 4], open: f64) -> Vec3 {
        let spread = roughness * roughness;
        let mut light = Self::wall(direction) * open;
        for (lamp, &seen) in self.lamps.iter().zip(seen) {
            let width = lamp.width + 0.5 * spread;
            let off = (1.0 - direction.dot(lamp.to)) / width;
            // A lamp that lights a white surface facing it to 1 sends pi into a solid angle of 2 pi width PROFILE.
            // Roughness widens the lamp and does not change its light.
            let strength = 0.5 / (PROFILE * width);
            light += lamp.colour * (seen * strength / ((1.0 + off * off) * (1.0 + off)));
        }
        light
    }

    /// Returns the nearest body on a ray: distance, outward normal, colour.
    fn hit(&self, origin: Vec3, direction: Vec3) -> Option<(f64, Vec3, Vec3)> {
        let mut nearest: Option<(f64, Vec3, Vec3)> = None;
        for (body, colour) in &self.bodies {
            if let Some((t, normal)) = body.hit(origin, direction)
                && nearest.is_none_or(|(best, ..)| t < best)
            {
                nearest = Some((t, normal, *colour));
            }
        }
        nearest
    }

    fn blocked(&self, origin: Vec3, direction: Vec3) -> bool {
        self.bodies.iter().any(|(body, _)| body.hit(origin, direction).is_some())
    }

    /// Estimates the diffuse light that leaves a surface if nothing blocks the lamps and the wall.
    fn rough_guess(&self, normal: Vec3, albedo: Vec3) -> Vec3 {
        let mut light = Self::wall(normal) * 0.5;
        for lamp in &self.lamps {
            light += lamp.colour * (0.55 * normal.dot(lamp.to).max(0.0));
        }
        light * albedo
    }

    /// Lights the point of `surface` at `position`.
    pub(crate) fn light(
        &self,
        position: Vec3,
        normal: Vec3,
        surface: Surface,
        random: &mut Random,
    ) -> Lit<'_> {
        let origin = position + normal * LIFT;
        let (side, other) = frame(normal);
        let mut light = Vec3::ZERO;
        let mut open = 0.0;
        let turn = random.uniform();
        // The directions are cosine-weighted.
        for (share, sin, cos) in spiral(turn, GATHER_RAYS) {
            let flat = share.sqrt();
            let direction = side * (flat * cos) + other * (flat * sin) + normal * (1.0 - share).sqrt();
            light += match self.hit(origin, direction) {
                Some((_, n, colour)) => self.rough_guess(n, colour) * BOUNCE,
                None => {
                    open += 1.0;
                    Self::wall(direction)
                }
            };
        }
        light *= 1.0 / GATHER_RAYS as f64;
        open /= GATHER_RAYS as f64;
        let mut seen = [0.0; 4];
        for (lamp, seen) in self.lamps.iter().zip(&mut seen) {
            let (side, other) = frame(lamp.to);
            let turn = random.uniform();
            let mut sum = 0.0;
            for (share, sin, cos) in spiral(turn, SHADOW_RAYS) {
                let flat = (2.0 * lamp.width * share).sqrt();
                let to = lamp.to + (side * (flat * cos) + other * (flat * sin));
                let facing = normal.dot(to);
                if facing > 0.0 && !self.blocked(origin, to.normalize()) {
                    sum += 1.0;
                    light += lamp.colour * (facing / SHADOW_RAYS as f64);
                }
            }
            *seen = sum / SHADOW_RAYS as f64;
        }
        let diffuse = light * surface.albedo;
        Lit { studio: self, position: origin, normal, surface, diffuse, seen, open }
    }
}

impl Lit<'_> {
    /// Returns the display colour, 0 to 1, seen by a viewer in the unit direction `to_viewer`. The back of the surface
    /// shows the mirror image of its front, so that the colour is continuous.
    pub(crate) fn colour(&self, to_viewer: Vec3) -> Vec3 {
        let facing = to_viewer.dot(self.normal);
        let to_viewer = if facing < 0.0 { to_viewer - self.normal * (2.0 * facing) } else { to_viewer };
        let facing = facing.abs();
        let Surface { mirror, roughness, .. } = self.surface;
        // Schlick's Fresnel term, reduced on rough surfaces.
        let grazing = (1.0 - facing) * (1.0 - facing);
        let grazing = grazing * grazing * (1.0 - facing) * (1.0 - roughness) * (1.0 - roughness);
        let strength = mix(mirror, Vec3::ONE, grazing);
        let direction = reflect(to_viewer, self.normal);
        let traced = roughness < TRACED_ROUGHNESS;
        let hit = if traced { self.studio.hit(self.position, direction) } else { None };
        let reflected = match hit {
            Some((_, normal, colour)) => self.studio.rough_guess(normal, colour),
            None => {
                let open = if traced { 1.0 } else { self.open };
                self.studio.surroundings(direction, roughness, &self.seen, open)
            }
        };
        tone(self.diffuse * (Vec3::ONE - strength) + reflected * strength)
    }
}

/// Returns the display values of `light`: Narkowicz's fit of the ACES tone curve, then a square root for gamma.
pub(crate) fn tone(light: Vec3) -> Vec3 {
    light.map(|v| {
        let x = v.max(0.0) * EXPOSURE;
        let y = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14);
        y.clamp(0.0, 1.0).sqrt()
    })
}

/// Returns the distance to a ball on a ray, and the normal there.
fn hit_ball(origin: Vec3, direction: Vec3, centre: Vec3, radius: f64) -> Option<(f64, Vec3)> {
    let to = centre - origin;
    let along = to.dot(direction);
    let off = to.dot(to) - along * along;
    if along < 0.0 || off > radius * radius {
        return None;
    }
    let t = along - (radius * radius - off).sqrt();
    (t > 0.0).then(|| (t, (direction * t - to).normalize()))
}

impl Body {
    fn hit(&self, origin: Vec3, direction: Vec3) -> Option<(f64, Vec3)> {
        match self {
            Self::Ball { centre, radius } => hit_ball(origin, direction, *centre, *radius),
            Self::Beads { centre, bound, beads, radius } => {
                let to = *centre - origin;
                let along = to.dot(direction);
                let apart = to.dot(to) - bound * bound;
                // The ray starts outside of the bound and does not enter the bound.
                if apart > 0.0 && (along < 0.0 || to.dot(to) - along * along > bound * bound) {
                    return None;
                }
                let hits = beads.iter().filter_map(|bead| hit_ball(origin, direction, *bead, *radius));
                hits.min_by(|a, b| a.0.total_cmp(&b.0))
            }
            Self::Disc { centre, radius } => {
                let t = (centre.y - origin.y) / direction.y;
                let at = origin + direction * t - *centre;
                let inside = t > 0.0 && t.is_finite() && dvec3(at.x, 0.0, at.z).length() < *radius;
                inside.then_some((t, UP))
            }
            Self::Block { centre, half, right } => {
                let axes = block_axes(*right);
                let from = origin - *centre;
                let (mut near, mut far, mut face) = (0.0, f64::INFINITY, None);
                for (&axis, half) in axes.iter().zip(half.to_array()) {
                    let (start, step) = (from.dot(axis), direction.dot(axis));
                    let (a, b) = ((-half - start) / step, (half - start) / step);
                    let (enter, leave) = if a < b { (a, b) } else { (b, a) };
                    if enter > near {
                        near = enter;
                        face = Some(axis * if step > 0.0 { -1.0 } else { 1.0 });
                    }
                    far = if leave < far { leave } else { far };
                }
                face.filter(|_| near < far).map(|normal| (near, normal))
            }
        }
    }
}
