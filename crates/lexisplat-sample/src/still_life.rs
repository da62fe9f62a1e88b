//! The objects of the scene.

use crate::light::{Body, Studio};
use crate::material::Material;
use crate::math::{Vec3, dvec3, sin_cos_turns};
use crate::shapes::{Shape, knot_beads, torus_beads};

/// Radius of the table.
const TABLE: f64 = 1.7;
/// Radius of the studio's wall. Cameras that show the whole table are well inside the wall.
const WALL: f64 = 12.0;
/// Number of balls that block light in place of a torus or a knot.
const BEADS: usize = 48;

/// An object of the scene.
#[derive(Debug, Clone)]
pub(crate) struct Thing {
    pub(crate) shape: Shape,
    pub(crate) material: Material,
    /// Number of Gaussians per area, relative to that of the table. Fine patterns need more.
    pub(crate) density: f64,
}

/// Returns the position `x` to the right, `height` above the table and `z` away from the first viewer.
fn at(x: f64, height: f64, z: f64) -> Vec3 {
    dvec3(x, -height, z)
}

/// Returns the level direction at `turns` from the x axis.
fn level(turns: f64) -> Vec3 {
    let (sin, cos) = sin_cos_turns(turns);
    dvec3(cos, 0.0, sin)
}

fn ball(x: f64, z: f64, radius: f64, material: Material) -> Thing {
    raised_ball(x, radius, z, radius, material)
}

fn raised_ball(x: f64, height: f64, z: f64, radius: f64, material: Material) -> Thing {
    let shape = Shape::Sphere { centre: at(x, height, z), radius, inward: false };
    Thing { shape, material, density: 0.6 }
}

fn block(centre: Vec3, half: [f64; 3], turns: f64, material: Material) -> Thing {
    Thing { shape: Shape::Block { centre, half: half.into(), right: level(turns) }, material, density: 0.9 }
}

/// Returns all objects; the wall is the last.
pub(crate) fn things() -> Vec<Thing> {
    let paint = |colour: [f64; 3], roughness| Material::Paint { colour: colour.into(), roughness };
    let thing = |shape, material, density| Thing { shape, material, density };
    let metal = |colour: [f64; 3], roughness| Material::Metal { colour: colour.into(), roughness };
    vec![
        thing(Shape::Disc { centre: Vec3::ZERO, radius: TABLE }, Material::Chequered, 1.0),
        thing(Shape::Rim { centre: Vec3::ZERO, radius: TABLE, thickness: 0.12 }, Material::DarkWood, 0.7),
        block(at(0.0, 0.15, 0.1), [0.36, 0.15, 0.36], 0.06, Material::Marble),
        thing(
            Shape::Knot { centre: at(0.0, 0.80, 0.1), size: 0.14, tube: 0.08 },
            metal([0.95, 0.55, 0.28], 0.22),
            0.85,
        ),
        ball(-0.92, -0.42, 0.40, paint([0.62, 0.015, 0.02], 0.06)),
        ball(-0.34, -0.92, 0.27, paint([0.01, 0.05, 0.42], 0.1)),
        ball(0.36, -1.12, 0.17, paint([0.72, 0.40, 0.01], 0.3)),
        ball(0.98, 0.48, 0.36, metal([0.86, 0.87, 0.88], 0.04)),
        ball(0.62, 1.10, 0.22, paint([0.01, 0.28, 0.08], 0.08)),
        ball(-1.02, 0.62, 0.30, Material::Clay { colour: dvec3(0.56, 0.21, 0.11) }),
        ball(-0.62, 1.12, 0.15, paint([0.55, 0.53, 0.50], 0.15)),
        thing(
            Shape::Torus { centre: at(0.82, 0.155, -0.52), ring: 0.30, tube: 0.155 },
            Material::Doughnut,
            1.1,
        ),
        block(
            at(-0.12, 0.06, 1.05),
            [0.36, 0.06, 0.27],
            0.03,
            Material::Book { colour: dvec3(0.02, 0.22, 0.24) },
        ),
        block(
            at(-0.08, 0.17, 1.03),
            [0.30, 0.05, 0.22],
            -0.06,
            Material::Book { colour: dvec3(0.60, 0.32, 0.03) },
        ),
        raised_ball(-0.08, 0.22 + 0.13, 1.03, 0.13, paint([0.30, 0.03, 0.30], 0.05)),
        thing(Shape::Sphere { centre: Vec3::ZERO, radius: WALL, inward: true }, Material::Backdrop, 0.0012),
    ]
}

/// Returns the studio with all bodies that block light.
pub(crate) fn studio(things: &[Thing]) -> Studio {
    let bodies = things.iter().filter_map(|thing| {
        let body = match thing.shape.clone() {
            Shape::Sphere { centre, radius, inward: false } => Body::Ball { centre, radius },
            Shape::Disc { centre, radius } => Body::Disc { centre, radius },
            Shape::Torus { centre, ring, tube } => {
                let beads = torus_beads(centre, ring, BEADS);
                Body::Beads { centre, bound: ring + tube, beads, radius: tube }
            }
            Shape::Knot { centre, size, tube } => {
                let beads = knot_beads(centre, size, BEADS);
                Body::Beads { centre, bound: 3.0 * size + tube, beads, radius: tube }
            }
            Shape::Block { centre, half, right } => Body::Block { centre, half, right },
            Shape::Rim { .. } | Shape::Sphere { .. } => return None,
        };
        Some((body, &thing.material))
    });
    Studio::new(bodies.collect())
}
