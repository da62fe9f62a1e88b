//! The materials of the surfaces.

use crate::math::{Vec3, dvec3, mix, sin_cos_turns, smoothstep};
use crate::random::value_noise;
use crate::shapes::Edge;

/// Reflectance at normal incidence of all materials that are not metals.
const DIELECTRIC: f64 = 0.04;
/// Side of the squares of the table top, in world units.
const SQUARE: f64 = 0.25;
/// Radius of the chequered part of the table top.
const CHEQUERED: f64 = 1.5;
const MAPLE: Vec3 = dvec3(0.62, 0.41, 0.22);
const WALNUT: Vec3 = dvec3(0.17, 0.075, 0.035);
const DOUGH: Vec3 = dvec3(0.58, 0.32, 0.11);
const ICING: Vec3 = dvec3(0.80, 0.22, 0.36);
const PAPER: Vec3 = dvec3(0.72, 0.66, 0.52);
const SPRINKLES: [Vec3; 4] =
    [dvec3(0.9, 0.75, 0.1), dvec3(0.1, 0.45, 0.8), dvec3(0.95, 0.92, 0.9), dvec3(0.15, 0.6, 0.25)];

/// The look of a surface as a function of the position on it.
#[derive(Debug, Clone)]
pub(crate) enum Material {
    /// A lacquered table top of light and dark squares.
    Chequered,
    /// Lacquered dark wood.
    DarkWood,
    /// A single colour under a clear coat, with roughness from 0 to 1.
    Paint { colour: Vec3, roughness: f64 },
    /// A single colour with fine grain and without gloss.
    Clay { colour: Vec3 },
    /// A metal that reflects with this colour.
    Metal { colour: Vec3, roughness: f64 },
    /// White stone with grey veins.
    Marble,
    /// Iced on its upper half, with sprinkles.
    Doughnut,
    /// A book with its cover above and its pages at the sides.
    Book { colour: Vec3 },
    /// The studio's wall, which emits light and reflects none.
    Backdrop,
}

/// Optical properties at one position.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Surface {
    /// Diffuse reflectance, linear.
    pub(crate) albedo: Vec3,
    /// Mirror reflectance at normal incidence, linear.
    pub(crate) mirror: Vec3,
    /// Roughness: 0 is a mirror, 1 is matt.
    pub(crate) roughness: f64,
}

impl Material {
    /// Returns the properties at `local`, a position relative to the shape, with the outward `normal`.
    pub(crate) fn at(&self, local: Vec3, normal: Vec3, up: Vec3) -> Surface {
        let coated = |albedo, roughness| Surface { albedo, mirror: Vec3::splat(DIELECTRIC), roughness };
        match self {
            Self::Chequered => {
                let radius = (local.x * local.x + local.z * local.z).sqrt();
                if radius > CHEQUERED {
                    return coated(wood(local, WALNUT), 0.62);
                }
                let (a, b) = (local.x / SQUARE, local.z / SQUARE);
                let dark = (a.floor() + b.floor()).rem_euclid(2.0) > 0.5;
                let grain = if dark { dvec3(local.z, local.y, local.x) } else { local };
                let albedo = wood(grain, if dark { WALNUT } else { MAPLE });
                coated(albedo, if dark { 0.58 } else { 0.66 })
            }
            Self::DarkWood => coated(wood(dvec3(local.y, local.x, local.z), WALNUT), 0.65),
            Self::Paint { colour, roughness } => coated(*colour, *roughness),
            Self::Clay { colour } => {
                let grain = value_noise(local * 18.0) + 0.5 * value_noise(local * 41.0);
                Surface {
                    albedo: *colour * (0.72 + 0.38 * grain),
                    mirror: Vec3::splat(0.015),
                    roughness: 0.9,
                }
            }
            Self::Metal { colour, roughness } => {
                Surface { albedo: Vec3::ZERO, mirror: *colour, roughness: *roughness }
            }
            Self::Marble => coated(marble(local), 0.55),
            Self::Doughnut => doughnut(local, normal.dot(up)),
            Self::Book { colour } => {
                if normal.dot(up) > 0.5 {
                    return coated(*colour, 0.4);
                }
                let leaf = value_noise(dvec3(local.y * 160.0, 0.5, 0.5));
                Surface { albedo: PAPER * (0.65 + 0.4 * leaf), mirror: Vec3::splat(0.02), roughness: 0.8 }
            }
            Self::Backdrop => Surface { albedo: Vec3::ZERO, mirror: Vec3::ZERO, roughness: 1.0 },
        }
    }

    /// Returns the nearest line of the pattern at `local`; `None` if the pattern has no lines.
    pub(crate) fn edge(&self, local: Vec3) -> Option<Edge> {
        if !matches!(self, Self::Chequered) {
            return None;
        }
        let radius = (local.x * local.x + local.z * local.z).sqrt();
        let round = Edge {
            distance: (radius - CHEQUERED).abs(),
            along: dvec3(-local.z / radius, 0.0, local.x / radius),
        };
        if radius > CHEQUERED {
            return Some(round);
        }
        let line = |v: f64, along| {
            let from = (v / SQUARE).rem_euclid(1.0);
            Some(Edge { distance: from.min(1.0 - from) * SQUARE, along })
        };
        let grid = Edge::nearer(line(local.x, Vec3::Z), line(local.z, Vec3::X));
        Edge::nearer(grid, Some(round))
    }

    /// Returns the mean colour, which reflections show.
    pub(crate) fn mean(&self) -> Vec3 {
        match self {
            Self::Chequered => mix(MAPLE, WALNUT, 0.5),
            Self::DarkWood => WALNUT,
            Self::Paint { colour, .. } | Self::Clay { colour } | Self::Book { colour } => *colour,
            Self::Metal { colour, .. } => *colour * 0.5,
            Self::Marble => Vec3::splat(0.7),
            Self::Doughnut => mix(DOUGH, ICING, 0.6),
            Self::Backdrop => Vec3::ZERO,
        }
    }
}

/// Returns the colour of wood with its grain along x.
fn wood(p: Vec3, colour: Vec3) -> Vec3 {
    let wander = value_noise(dvec3(p.x * 1.7, p.y, p.z * 4.0));
    let rings = (p.z * 9.0 + wander * 2.5).rem_euclid(1.0);
    let fibre = value_noise(dvec3(p.x * 6.0, p.y * 6.0, p.z * 70.0));
    let band = 0.34 * smoothstep(0.0, 0.8, rings) * (1.0 - smoothstep(0.9, 1.0, rings));
    colour * (0.72 + band + 0.25 * fibre)
}

fn marble(p: Vec3) -> Vec3 {
    let warp = value_noise(p * 3.0) + 0.5 * value_noise(p * 7.0);
    let (vein, _) = sin_cos_turns(p.x * 1.1 + p.y * 1.9 + p.z * 0.7 + warp * 1.1);
    let vein = 1.0 - smoothstep(0.0, 0.25, vein.abs());
    mix(dvec3(0.66, 0.64, 0.60), dvec3(0.30, 0.32, 0.36), 0.75 * vein)
}

fn doughnut(p: Vec3, upward: f64) -> Surface {
    // The edge of the icing is wavy.
    let edge = -0.05 + 0.55 * (value_noise(dvec3(p.x * 7.0, 0.5, p.z * 7.0)) - 0.5);
    if upward < edge {
        let baked = smoothstep(-1.0, edge, upward);
        let albedo = DOUGH * (0.75 + 0.35 * (1.0 - baked) + 0.2 * value_noise(p * 25.0));
        return Surface { albedo, mirror: Vec3::splat(0.02), roughness: 0.75 };
    }
    let cell = value_noise(dvec3(p.x * 17.0, 7.5, p.z * 17.0));
    let kind = value_noise(dvec3(p.x * 9.0 + 40.0, 3.5, p.z * 9.0));
    let sprinkle = [0.30, 0.45, 0.58].iter().filter(|&&limit| kind > limit).count();
    let albedo = if cell > 0.72 { SPRINKLES[sprinkle] } else { ICING };
    Surface { albedo, mirror: Vec3::splat(DIELECTRIC), roughness: 0.16 }
}
