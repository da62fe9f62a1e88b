// Projects Gaussians in the world to ellipses on screen, like `cpu::project`.
@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> starts: array<u32>;
@group(0) @binding(3) var<storage, read> gaussians: array<u32>;
@group(0) @binding(4) var<storage, read> bodies: array<vec4<f32>>;
// The log scales and the opacity logit, then the quaternion (w, x, y, z).
@group(0) @binding(5) var<storage, read> shapes: array<vec4<f32>>;
// The centre, and the conic's xx and xy.
@group(0) @binding(6) var<storage, read_write> centres: array<vec4<f32>>;
// The conic's yy and determinant, the opacity, and the level of the quadratic form. Beyond this level the opacity is
// certainly below ALPHA_MIN.
@group(0) @binding(7) var<storage, read_write> conics: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read_write> keys: array<u32>;
// The tiles that the Gaussian may touch: the first tile, and the first tile after the last, each as column + row * 2^16.
@group(0) @binding(9) var<storage, read_write> rects: array<vec2<u32>>;

// Returns one of the three standard deviations as a vector on screen.
fn on_screen(axis: vec3<f32>, jx: vec2<f32>, jy: vec2<f32>) -> vec2<f32> {
    let x = dot(frame.right, axis);
    let y = dot(frame.down, axis);
    let z = dot(frame.forward, axis);
    return vec2<f32>(jx.x * x + jx.y * z, jy.x * y + jy.y * z);
}

fn crossed(p: vec2<f32>, q: vec2<f32>) -> f32 {
    let w = p.x * q.y - p.y * q.x;
    return w * w;
}

@compute @workgroup_size(GROUP)
fn project(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let first = min(starts[chunk.first_block], frame.slots);
    let end = min(starts[chunk.first_block + chunk.blocks], frame.slots);
    let slot = first + group_number(group, groups) * GROUP + lane;
    if slot >= end {
        return;
    }
    // A slot that is not drawn touches no tile, and comes last in the order.
    keys[slot] = KEY_LAST;
    rects[slot] = vec2<u32>(0u);
    let i = gaussians[slot] - chunk.first;
    let body = bodies[i];
    let d = body.xyz - frame.position;
    let view = vec3<f32>(dot(frame.right, d), dot(frame.down, d), dot(frame.forward, d));
    let z = view.z;
    if !(z > frame.near) {
        return;
    }
    let ndc = view.xy / frame.tangents * (1.0 / (z + W_EPSILON * (frame.near / NEAR_Z)));
    let centre = ((ndc + 1.0) * frame.size - 1.0) * 0.5;

    let shape = shapes[2u * i];
    let s = exp(shape.xyz);
    let raw = shapes[2u * i + 1u];
    let q = raw / max(length(raw), QUATERNION_FLOOR);
    let w = q.x;
    let v = q.yzw;
    let axis_x = s.x * vec3<f32>(1.0 - 2.0 * (v.y * v.y + v.z * v.z), 2.0 * (v.x * v.y + w * v.z), 2.0 * (v.x * v.z - w * v.y));
    let axis_y = s.y * vec3<f32>(2.0 * (v.x * v.y - w * v.z), 1.0 - 2.0 * (v.x * v.x + v.z * v.z), 2.0 * (v.y * v.z + w * v.x));
    let axis_z = s.z * vec3<f32>(2.0 * (v.x * v.z + w * v.y), 2.0 * (v.y * v.z - w * v.x), 1.0 - 2.0 * (v.x * v.x + v.y * v.y));
    let limit = TAN_LIMIT * frame.tangents;
    let t = clamp(view.xy / z, -limit, limit) * z;
    let jx = vec2<f32>(frame.focal.x / z, -(frame.focal.x * t.x) / (z * z));
    let jy = vec2<f32>(frame.focal.y / z, -(frame.focal.y * t.y) / (z * z));
    let x = on_screen(axis_x, jx, jy);
    let y = on_screen(axis_y, jx, jy);
    let u = on_screen(axis_z, jx, jy);

    var a = x.x * x.x + y.x * y.x + u.x * u.x;
    let b = x.x * x.y + y.x * y.y + u.x * u.y;
    var c = x.y * x.y + y.y * y.y + u.y * u.y;
    // The determinant is a sum of squares (Cauchy-Binet), so it is never negative.
    let plain = crossed(x, y) + crossed(y, u) + crossed(u, x);
    let det = plain + DILATION * (a + c) + DILATION * DILATION;
    if !(det > 0.0 && det < FAR_LIMIT) {
        return;
    }
    a += DILATION;
    c += DILATION;
    let mid = 0.5 * (a + c);
    let half = 0.5 * (a - c);
    let spread = sqrt(max(half * half + b * b, EIGEN_FLOOR));
    let radius = ceil(RADIUS_SIGMAS * sqrt(mid + spread));
    var opacity = 1.0 / (1.0 + exp(-shape.w));
    if frame.antialiased == 1u {
        opacity *= sqrt(max(plain / det, ANTIALIAS_FLOOR));
    }
    if !(opacity >= ALPHA_MIN && all(abs(centre) < vec2<f32>(FAR_LIMIT))) {
        return;
    }
    let level = 2.0 * (log(opacity / ALPHA_MIN) + POWER_SLACK);
    let grid = vec2<f32>(f32(frame.columns), f32(frame.rows));
    let tile = f32(TILE);
    // INRIA's getRect truncates toward zero. The floor does the same here, because clamped numbers are not negative.
    let low = floor(clamp((centre - radius) / tile, vec2<f32>(0.0), grid));
    let high = floor(clamp((centre + radius + (tile - 1.0)) / tile, vec2<f32>(0.0), grid));
    // The tiles with a pixel inside the ellipse of `level`, and possibly a few more.
    let reach = sqrt(level * vec2<f32>(a, c)) * (1.0 + REACH_SLACK) + REACH_MARGIN;
    let least = max(low, ceil(clamp((centre - reach - (tile - 1.0)) / tile, vec2<f32>(0.0), grid)));
    let most = min(high, floor(clamp((centre + reach) / tile + 1.0, vec2<f32>(0.0), grid)));
    if any(least >= most) {
        return;
    }
    let corner = vec2<u32>(least);
    let corner_end = vec2<u32>(most);
    keys[slot] = bitcast<u32>(z) - bitcast<u32>(frame.near);
    rects[slot] = vec2<u32>(corner.x | (corner.y << 16u), corner_end.x | (corner_end.y << 16u));
    centres[slot] = vec4<f32>(centre, c / det, -b / det);
    conics[slot] = vec4<f32>(a / det, 1.0 / det, opacity, level);
}
