// Marks the Gaussians that may be visible. The test is coarse and works on bounding spheres. It marks every Gaussian that
// is visible, and some others.
@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> chunk: Chunk;
// Position, and largest standard deviation. The latter is -1 for Gaussians that are never drawn.
@group(0) @binding(2) var<storage, read> bodies: array<vec4<f32>>;
// One bit for each Gaussian: whether it is marked.
@group(0) @binding(3) var<storage, read_write> masks: array<u32>;
// Number of Gaussians marked in each block.
@group(0) @binding(4) var<storage, read_write> starts: array<u32>;
// The rows of tiles in which Gaussians are searched for. They are all rows of the picture, or a band of them if the
// buffers do not hold the Gaussians of all rows.
@group(0) @binding(5) var<uniform> band: Band;

var<workgroup> words: array<atomic<u32>, MASK_WORDS>;

fn may_be_seen(body: vec4<f32>) -> bool {
    let d = body.xyz - frame.position;
    let z = dot(frame.forward, d);
    if !(body.w >= 0.0 && z > frame.near * (1.0 - CULL_SLACK) && z < FAR_LIMIT) {
        return false;
    }
    let ratio = vec2<f32>(dot(frame.right, d), dot(frame.down, d)) / z;
    let limit = TAN_LIMIT * frame.tangents;
    let t = clamp(ratio, -limit, limit);
    // A variance on screen is at most the largest variance in the world times the squared length of the Jacobian's row.
    // The larger eigenvalue is at most the sum of both variances.
    let scale = body.w * frame.focal / z;
    let variance = dot(scale * scale, vec2<f32>(1.0) + t * t) + 2.0 * DILATION + sqrt(EIGEN_FLOOR);
    let radius = RADIUS_SIGMAS * sqrt(variance) * (1.0 + CULL_SLACK) + 1.0;
    let centre = ((ratio / frame.tangents + 1.0) * frame.size - 1.0) * 0.5;
    // The margin is two pixels larger than a tile, because this kernel rounds the centre differently from `project`.
    let margin = radius + f32(TILE) + 2.0;
    let top = f32(band.first * TILE);
    let bottom = f32((band.first + band.rows) * TILE);
    let low = vec2<f32>(0.0, top) - margin;
    let high = vec2<f32>(frame.size.x, bottom) + margin;
    return all(centre > low) && all(centre < high);
}

@compute @workgroup_size(GROUP)
fn cull(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if lane < MASK_WORDS {
        atomicStore(&words[lane], 0u);
    }
    workgroupBarrier();
    let block = group_number(group, groups);
    let i = block * GROUP + lane;
    if block < chunk.blocks && i < chunk.count {
        if may_be_seen(bodies[i]) {
            atomicOr(&words[lane / 32u], 1u << (lane % 32u));
        }
    }
    workgroupBarrier();
    if block < chunk.blocks && lane < MASK_WORDS {
        masks[(chunk.first_block + block) * MASK_WORDS + lane] = atomicLoad(&words[lane]);
    }
    if block < chunk.blocks && lane == 0u {
        var count = 0u;
        for (var w = 0u; w < MASK_WORDS; w++) {
            count += countOneBits(atomicLoad(&words[w]));
        }
        starts[chunk.first_block + block] = count;
    }
}
