//! Surfaces, and points that cover surfaces evenly.

use crate::math::{Vec3, any_tangent, dvec3, sin_cos_turns, tangent};

/// Up in the world: y points down, as in scenes trained from COLMAP's cameras.
pub(crate) const UP: Vec3 = Vec3::NEG_Y;
/// The fractional part of the golden ratio. Its multiples fill the unit interval most evenly, and a lattice made of them
/// stays even if it is stretched.
const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// Number of Newton steps for points of a torus tube. Fewer steps would be enough.
const NEWTON: usize = 8;
/// Number of straight pieces by which the length of the knot's curve is measured.
const KNOT_PIECES: u32 = 512;

/// A surface in world units.
#[derive(Debug, Clone)]
pub(crate) enum Shape {
    /// A sphere. Its normals point to the centre if `inward` is set.
    Sphere { centre: Vec3, radius: f64, inward: bool },
    /// A level disc that faces up.
    Disc { centre: Vec3, radius: f64 },
    /// The side of a level disc of some thickness. `centre` is the centre of its upper face.
    Rim { centre: Vec3, radius: f64, thickness: f64 },
    /// A level torus.
    Torus { centre: Vec3, ring: f64, tube: f64 },
    /// An upright trefoil knot on a torus with a ring of `2 * size` and a tube of `size`. `tube` is the radius of the
    /// knot's own tube.
    Knot { centre: Vec3, size: f64, tube: f64 },
    /// A level box. `half` are its half sides along `right`, up, and the direction perpendicular to both.
    Block { centre: Vec3, half: Vec3, right: Vec3 },
}

/// A point on a surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Point {
    pub(crate) position: Vec3,
    /// Outward normal, of unit length.
    pub(crate) normal: Vec3,
    /// Tangent along the surface, of unit length.
    pub(crate) tangent: Vec3,
    /// Position relative to the shape, in the axes of a block. Patterns depend on it.
    pub(crate) local: Vec3,
    /// The nearest edge of the surface, if it has edges.
    pub(crate) edge: Option<Edge>,
}

/// A line across which Gaussians should not reach.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Edge {
    /// Distance of the point from the line, in world units.
    pub(crate) distance: f64,
    /// Unit vector along the line.
    pub(crate) along: Vec3,
}

impl Edge {
    /// Returns the nearer of two edges.
    pub(crate) fn nearer(a: Option<Self>, b: Option<Self>) -> Option<Self> {
        match (a, b) {
            (Some(a), Some(b)) => Some(if b.distance < a.distance { b } else { a }),
            (a, b) => a.or(b),
        }
    }
}

/// Returns the share of `count` points up to the middle of point `index`, 0 to 1.
fn share(index: usize, count: usize) -> f64 {
    (index as f64 + 0.5) / count as f64
}

/// Returns the fractional part of `index` times the golden ratio, in \[0, 1).
fn golden(index: usize) -> f64 {
    let turns = index as f64 * GOLDEN;
    turns - turns.floor()
}

impl Shape {
    /// Returns the area in square world units.
    pub(crate) fn area(&self) -> f64 {
        use std::f64::consts::{PI, TAU};
        match self {
            Self::Sphere { radius, .. } => 2.0 * TAU * radius * radius,
            Self::Disc { radius, .. } => PI * radius * radius,
            Self::Rim { radius, thickness, .. } => TAU * radius * thickness,
            Self::Torus { ring, tube, .. } => TAU * ring * TAU * tube,
            Self::Knot { size, tube, .. } => knot_length(*size) * TAU * tube,
            Self::Block { half, .. } => faces(*half).iter().map(|f| f.area).sum(),
        }
    }

    /// Returns point `index` of `count` points that cover the surface evenly.
    pub(crate) fn point(&self, index: usize, count: usize) -> Point {
        let (u, v) = (share(index, count), golden(index));
        match self {
            Self::Sphere { centre, radius, inward } => {
                let y = 1.0 - 2.0 * u;
                let (sin, cos) = sin_cos_turns(v);
                let level = (1.0 - y * y).sqrt();
                let out = dvec3(level * cos, y, level * sin);
                on(*centre, out * *radius, if *inward { -out } else { out }, any_tangent(out))
            }
            Self::Disc { centre, radius } => {
                let (sin, cos) = sin_cos_turns(v);
                let r = radius * u.sqrt();
                let edge = Some(Edge { distance: radius - r, along: dvec3(-sin, 0.0, cos) });
                Point { edge, ..on(*centre, dvec3(r * cos, 0.0, r * sin), UP, dvec3(cos, 0.0, sin)) }
            }
            Self::Rim { centre, radius, thickness } => {
                let (sin, cos) = sin_cos_turns(u);
                let out = dvec3(cos, 0.0, sin);
                let down = thickness * v;
                let along = dvec3(-sin, 0.0, cos);
                let edge = Some(Edge { distance: down.min(thickness - down), along });
                Point { edge, ..on(*centre, out * *radius - UP * down, out, along) }
            }
            Self::Torus { centre, ring, tube } => {
                let (sin, cos) = sin_cos_turns(u);
                let out = dvec3(cos, 0.0, sin);
                let (lift, away) = sin_cos_turns(even_round_tube(v, tube / ring));
                let normal = out * away + UP * lift;
                on(*centre, out * *ring + normal * *tube, normal, dvec3(-sin, 0.0, cos))
            }
            Self::Knot { centre, size, tube } => {
                let (curve, along, side) = knot(knot_at_length(u), *size);
                let (sin, cos) = sin_cos_turns(v);
                let normal = side * cos + along.cross(side) * sin;
                on(*centre, curve + normal * *tube, normal, along)
            }
            Self::Block { centre, half, right } => {
                let axes = block_axes(*right);
                let mut start = 0.0;
                let total = self.area();
                let sides = faces(*half);
                let face = sides.iter().find(|face| {
                    let found = u * total < start + face.area;
                    if !found {
                        start += face.area;
                    }
                    found
                });
                let Some(face) = face.or(sides.last()) else { unreachable!("a box has five faces") };
                let along = ((u * total - start) / face.area).clamp(0.0, 1.0);
                let mut local = Vec3::ZERO;
                local[face.axis] = face.sign * half[face.axis];
                local[face.u] = half[face.u] * (2.0 * along - 1.0);
                local[face.v] = half[face.v] * (2.0 * v - 1.0);
                let offset = (0..3).fold(Vec3::ZERO, |sum, a| sum + axes[a] * local[a]);
                let normal = axes[face.axis] * face.sign;
                let end = |axis: usize, along: usize| {
                    Some(Edge { distance: half[axis] - local[axis].abs(), along: axes[along] })
                };
                let edge = Edge::nearer(end(face.u, face.v), end(face.v, face.u));
                Point { position: *centre + offset, normal, tangent: axes[face.u], local, edge }
            }
        }
    }
}

/// Returns a point without an edge.
fn on(centre: Vec3, local: Vec3, normal: Vec3, tangent: Vec3) -> Point {
    Point { position: centre + local, normal, tangent, local, edge: None }
}

/// A face of a box: the axis and sign of its normal, its own two axes, and its area.
struct Face {
    axis: usize,
    sign: f64,
    u: usize,
    v: usize,
    area: f64,
}

/// Returns the axes of a block whose right axis is `right`.
pub(crate) fn block_axes(right: Vec3) -> [Vec3; 3] {
    [right, UP, right.cross(UP)]
}

/// Returns all faces except the bottom, which is never visible.
fn faces(half: Vec3) -> [Face; 5] {
    [(1, 1.0), (0, 1.0), (0, -1.0), (2, 1.0), (2, -1.0)].map(|(axis, sign)| {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        Face { axis, sign, u, v, area: 4.0 * half[u] * half[v] }
    })
}

/// Returns the angle around the tube of a torus, in turns from the outside, up to which the share `v` of the tube's area
/// lies. `ratio` is the radius of the tube over the radius of the ring. Solves `t + ratio sin(2 pi t) / 2 pi = v`.
fn even_round_tube(v: f64, ratio: f64) -> f64 {
    let mut t = v;
    for _ in 0..NEWTON {
        let (sin, cos) = sin_cos_turns(t);
        t -= (t + ratio * sin / std::f64::consts::TAU - v) / (1.0 + ratio * cos);
    }
    t
}

/// Returns the trefoil at `t` turns: point, unit tangent, and the unit normal towards the outside of its torus.
fn knot(t: f64, size: f64) -> (Vec3, Vec3, Vec3) {
    let (sin2, cos2) = sin_cos_turns(2.0 * t);
    let (sin3, cos3) = sin_cos_turns(3.0 * t);
    // The knot is upright: x points to the right, y is vertical, and z points to the viewer.
    let point = dvec3((2.0 + cos3) * cos2, (2.0 + cos3) * sin2, sin3);
    let along = dvec3(
        -3.0 * sin3 * cos2 - 2.0 * (2.0 + cos3) * sin2,
        -3.0 * sin3 * sin2 + 2.0 * (2.0 + cos3) * cos2,
        3.0 * cos3,
    );
    let along = along.normalize();
    let side = tangent(dvec3(cos3 * cos2, cos3 * sin2, sin3), along);
    (point * size, along, side)
}

/// Returns the length of the knot's curve.
fn knot_length(size: f64) -> f64 {
    knot_lengths().last().map_or(0.0, |last| last * size)
}

/// Returns the length of the curve of a knot of size 1 up to the end of each piece.
fn knot_lengths() -> Vec<f64> {
    let at = |i: u32| knot(f64::from(i) / f64::from(KNOT_PIECES), 1.0).0;
    let mut sum = 0.0;
    (0..KNOT_PIECES)
        .map(|i| {
            sum += at(i + 1).distance(at(i));
            sum
        })
        .collect()
}

/// Returns the turns of the trefoil after the share `u` of its length.
fn knot_at_length(u: f64) -> f64 {
    static LENGTHS: std::sync::OnceLock<Vec<f64>> = std::sync::OnceLock::new();
    let lengths = LENGTHS.get_or_init(knot_lengths);
    let target = u * lengths.last().copied().unwrap_or(0.0);
    let piece = lengths.partition_point(|&l| l < target).min(lengths.len() - 1);
    let before = if piece == 0 { 0.0 } else { lengths[piece - 1] };
    let inside = (target - before) / (lengths[piece] - before);
    (piece as f64 + inside) / f64::from(KNOT_PIECES)
}

/// Returns the centres of `count` balls along the knot.
pub(crate) fn knot_beads(centre: Vec3, size: f64, count: usize) -> Vec<Vec3> {
    (0..count).map(|i| centre + knot(knot_at_length(share(i, count)), size).0).collect()
}

/// Returns the centres of `count` balls around the torus.
pub(crate) fn torus_beads(centre: Vec3, ring: f64, count: usize) -> Vec<Vec3> {
    (0..count)
        .map(|i| {
            let (sin, cos) = sin_cos_turns(share(i, count));
            centre + dvec3(ring * cos, 0.0, ring * sin)
        })
        .collect()
}

/// Returns the unit quaternion (w, x, y, z) of the rotation with these columns.
pub(crate) fn quaternion(x: Vec3, y: Vec3, z: Vec3) -> [f64; 4] {
    // Shepperd's method divides by the largest component.
    let trace = x.x + y.y + z.z;
    let of = |diagonal: f64| 1.0 + 2.0 * diagonal - trace;
    let squares = [1.0 + trace, of(x.x), of(y.y), of(z.z)];
    let largest = (0..4).fold(0, |best, i| if squares[i] > squares[best] { i } else { best });
    let (a, b, c) = (y.z - z.y, z.x - x.z, x.y - y.x);
    let (d, e, f) = (x.y + y.x, z.x + x.z, y.z + z.y);
    let raw = match largest {
        0 => [squares[0], a, b, c],
        1 => [a, squares[1], d, e],
        2 => [b, d, squares[2], f],
        _ => [c, e, f, squares[3]],
    };
    let length = raw.iter().map(|v| v * v).sum::<f64>().sqrt();
    raw.map(|v| v / length)
}

/// Returns `v` mirrored at the axis `n`.
pub(crate) fn reflect(v: Vec3, n: Vec3) -> Vec3 {
    n * (2.0 * v.dot(n)) - v
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shapes() -> Vec<Shape> {
        let centre = dvec3(0.3, -0.7, 1.1);
        vec![
            Shape::Sphere { centre, radius: 0.8, inward: false },
            Shape::Disc { centre, radius: 1.3 },
            Shape::Rim { centre, radius: 1.3, thickness: 0.2 },
            Shape::Torus { centre, ring: 1.0, tube: 0.4 },
            Shape::Knot { centre, size: 0.5, tube: 0.2 },
            Shape::Block { centre, half: dvec3(0.4, 0.2, 0.9), right: dvec3(1.0, 0.0, 0.5).normalize() },
        ]
    }

    #[test]
    fn points_lie_apart_and_cover_the_area() {
        let count = 2000;
        for shape in shapes() {
            let points: Vec<Point> = (0..count).map(|i| shape.point(i, count)).collect();
            let spacing = (shape.area() / 2000.0).sqrt();
            let mut nearest: Vec<f64> = (0..count)
                .map(|i| {
                    let others = (0..count).filter(|&j| j != i);
                    others
                        .map(|j| points[i].position.distance(points[j].position))
                        .fold(f64::INFINITY, f64::min)
                })
                .collect();
            nearest.sort_by(f64::total_cmp);
            assert!(nearest[100] > 0.5 * spacing, "{shape:?}: too close {} {spacing}", nearest[100]);
            assert!(nearest[1900] < 1.2 * spacing, "{shape:?}: too far {} {spacing}", nearest[1900]);
            for p in points {
                assert!((p.normal.length() - 1.0).abs() < 1e-12 && (p.tangent.length() - 1.0).abs() < 1e-12);
                assert!(p.normal.dot(p.tangent).abs() < 1e-9, "{shape:?}");
            }
        }
    }

    #[test]
    fn quaternions_turn_the_axes() {
        for (x, n) in [([1.0, 2.0, 3.0], [0.3, -1.0, 0.2]), ([-1.0, 0.1, 0.0], [0.0, 0.0, -1.0])] {
            let z = Vec3::from(n).normalize();
            let x = tangent(Vec3::from(x), z);
            let y = z.cross(x);
            let [w, i, j, k] = quaternion(x, y, z);
            let turned_x = dvec3(1.0 - 2.0 * (j * j + k * k), 2.0 * (i * j + w * k), 2.0 * (i * k - w * j));
            let turned_z = dvec3(2.0 * (i * k + w * j), 2.0 * (j * k - w * i), 1.0 - 2.0 * (i * i + j * j));
            assert!(turned_x.distance(x) < 1e-12 && turned_z.distance(z) < 1e-12);
        }
    }
}
