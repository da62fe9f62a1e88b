//! Rotations as quaternions (w, x, y, z).

/// Returns the quaternion (w, x, y, z) of rotations by `angles`, in degrees, about x, then y, then z.
pub(crate) fn quaternion(angles: [f64; 3]) -> [f64; 4] {
    let [(sx, cx), (sy, cy), (sz, cz)] = angles.map(|angle| libm::sincos(angle.to_radians() / 2.0));
    product([cz, 0.0, 0.0, sz], product([cy, 0.0, sy, 0.0], [cx, sx, 0.0, 0.0]))
}

/// Returns the rotation by `b` followed by the rotation by `a`.
pub(crate) fn product(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    let ([aw, ax, ay, az], [bw, bx, by, bz]) = (a, b);
    [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]
}

/// Returns `v` rotated by the quaternion `q`, of length 1.
pub(crate) fn turned(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let [w, x, y, z] = q;
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let u = [x, y, z];
    let once = cross(u, v);
    let twice = cross(u, once);
    [0, 1, 2].map(|k| v[k] + 2.0 * (w * once[k] + twice[k]))
}
